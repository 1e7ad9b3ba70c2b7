//! Reads what is known of a merge out of logs and map files.

use super::MergeState;
use crate::job::NamingOptions;
use anyhow::Result;
use gridweave_logs::map_file::{Thresholds, load_as};
use gridweave_logs::names::{self, Convention, Input, Names};
use gridweave_logs::reader::{LogMessage, LogReader};
use gridweave_logs::source::map_file::robot_names;
use gridweave_runtime::message::{Channel, LogTime};
use gridweave_runtime::ros::{Header, OccupancyGrid, encode};
use gridweave_runtime::stage::RobotTopics;
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Logs that are open, and what is known of the merge as far as they were read.
pub(crate) struct Opened {
    reader: LogReader,
    names: Names,
    topics: RobotTopics,
    /// When the first message was logged.
    start: Option<LogTime>,
    /// What was read and is not taken up yet.
    early: Option<Early>,
    /// What is known.
    pub(crate) state: MergeState,
    /// What was wrong with the logs.
    pub(crate) problems: BTreeSet<String>,
}

impl Opened {
    /// Opens logs.
    ///
    /// # Errors
    /// One cannot be read, or their names do not fit.
    pub(crate) fn new(logs: &[PathBuf], naming: &NamingOptions) -> Result<Self> {
        let inputs: Vec<Input> = logs.iter().map(|input| Input::new(input)).collect();
        let topics = RobotTopics::default();
        let (reader, names) = names::open(&inputs, &naming.rules(Convention::ByRobot)?, &topics)?;
        let problems = reader.files().iter().flat_map(|file| file.damage()).map(ToString::to_string).collect();
        let state = MergeState::default();
        Ok(Self { reader, names, topics, start: None, early: None, state, problems })
    }

    /// What the logs tell of how they were made: the name of a record and of an entry, and its text.
    pub(crate) fn metadata(&self) -> Vec<(String, String)> {
        let mut found = Vec::new();
        for file in self.reader.files().iter() {
            for record in file.metadata_names() {
                let entries = file.metadata(record).into_iter().flatten();
                found.extend(entries.map(|(name, text)| (format!("{record}: {name}"), text.clone())));
            }
        }
        found
    }

    /// Reads on up to a moment, in seconds from the first message on, or to the end. `each` is told of every message that was
    /// taken up: when it was logged, in seconds, and its channel.
    pub(crate) fn read_until(&mut self, end: Option<f64>, mut each: impl FnMut(f64, &Channel)) {
        let is_later = |seconds: f64| end.is_some_and(|end| seconds > end);
        if let Some(early) = self.early.take() {
            if is_later(early.seconds) {
                self.early = Some(early);
                return;
            }
            let Early { seconds, file, channel, data } = early;
            take(&self.names, &self.topics, &mut self.state, &mut self.problems, (file, channel), &data, |channel| {
                each(seconds, channel);
            });
        }
        while let Some(message) = self.reader.next_message() {
            let start = *self.start.get_or_insert(message.log_time);
            let seconds = message.log_time.0.saturating_sub(start.0) as f64 / 1e9;
            let LogMessage { file, channel, data, .. } = message;
            if is_later(seconds) {
                self.early = Some(Early { seconds, file, channel, data: data.to_vec() });
                return;
            }
            take(&self.names, &self.topics, &mut self.state, &mut self.problems, (file, channel), data, |channel| {
                each(seconds, channel);
            });
        }
        let damage = self.reader.take_damage();
        self.problems.extend(damage.iter().map(|(_, damage)| damage.to_string()));
    }
}

/// A message that was read before its time.
struct Early {
    seconds: f64,
    file: usize,
    channel: u16,
    data: Vec<u8>,
}

/// Takes up a message of a channel, which is told if it was.
fn take(
    names: &Names,
    topics: &RobotTopics,
    state: &mut MergeState,
    problems: &mut BTreeSet<String>,
    (file, number): (usize, u16),
    data: &[u8],
    mut each: impl FnMut(&Channel),
) {
    let Some(channel) = names.channel(file, number).filter(|_| names.wants(file, number)) else { return };
    match state.take(channel, topics, data) {
        Ok(()) => each(channel),
        Err(error) => {
            problems.insert(format!("a message on {} was left out: {error}", channel.topic));
        }
    }
}

/// The maps of map files, each of a robot that is called as the file.
///
/// # Errors
/// A file cannot be read, is no map, or two are of one name.
pub(crate) fn map_files(files: &[PathBuf]) -> Result<MergeState> {
    let mut state = MergeState::default();
    for (robot, file) in robot_names(files)?.iter().zip(files) {
        let (map, _) = load_as(file, Thresholds::ByPicture)?;
        let data: Vec<u8> = map.cells.iter().map(|cell| cell.cast_unsigned()).collect();
        let grid = OccupancyGrid { header: Header::default(), info: map.info, data: &data };
        state.robot(robot).map = Some(encode(&grid)?);
    }
    Ok(state)
}
