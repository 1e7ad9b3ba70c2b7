//! Reads the state of a merge from logs and map files.

use super::MergeState;
use crate::job::NamingOptions;
use anyhow::Result;
use gridweave_logs::map_file::{Thresholds, load_as};
use gridweave_logs::names::{self, Input, Names, TopicNaming};
use gridweave_logs::reader::{LogMessage, LogReader};
use gridweave_runtime::message::{Channel, LogTime};
use gridweave_runtime::ros::{Header, OccupancyGrid, encode};
use gridweave_runtime::stage::RobotTopics;
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Open logs, and the state of the merge as far as they were read.
pub(crate) struct Opened {
    reader: LogReader,
    names: Names,
    topics: RobotTopics,
    /// The log time of the first message.
    start: Option<LogTime>,
    /// A message that was read but is later than the moment.
    pending: Option<Pending>,
    /// The state of the merge.
    pub(crate) state: MergeState,
    /// Problems of the logs.
    pub(crate) problems: BTreeSet<String>,
}

impl Opened {
    /// Opens logs.
    ///
    /// # Errors
    /// A log cannot be read, or the names do not match.
    pub(crate) fn new(logs: &[PathBuf], naming: &NamingOptions) -> Result<Self> {
        let inputs: Vec<Input> = logs.iter().map(|input| Input::new(input)).collect();
        let topics = RobotTopics::default();
        let (reader, names) = names::open(&inputs, &naming.rules(TopicNaming::ByRobot)?, &topics)?;
        let problems = reader.files().iter().flat_map(|file| file.damage()).map(ToString::to_string).collect();
        let state = MergeState::default();
        Ok(Self { reader, names, topics, start: None, pending: None, state, problems })
    }

    /// Lists the metadata of the logs: the name of the record and of the entry, and the text.
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

    /// Reads on up to a moment, in seconds from the first message, or to the end. `each` is called for every ingested
    /// message with its log time in seconds and its channel.
    pub(crate) fn read_until(&mut self, end: Option<f64>, mut each: impl FnMut(f64, &Channel)) {
        let is_later = |seconds: f64| end.is_some_and(|end| seconds > end);
        if let Some(pending) = self.pending.take() {
            if is_later(pending.seconds) {
                self.pending = Some(pending);
                return;
            }
            let Pending { seconds, file, channel, data } = pending;
            take(&self.names, &self.topics, &mut self.state, &mut self.problems, (file, channel), &data, |channel| {
                each(seconds, channel);
            });
        }
        while let Some(message) = self.reader.next_message() {
            let start = *self.start.get_or_insert(message.log_time);
            let seconds = message.log_time.0.saturating_sub(start.0) as f64 / 1e9;
            let LogMessage { file, channel, data, .. } = message;
            if is_later(seconds) {
                self.pending = Some(Pending { seconds, file, channel, data: data.to_vec() });
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

/// A message that was read and is not ingested yet.
struct Pending {
    seconds: f64,
    file: usize,
    channel: u16,
    data: Vec<u8>,
}

/// Ingests a message, and calls `each` with its channel if that has worked.
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

/// Reads map files, each as the map of a robot with the name of the file.
///
/// # Errors
/// A file cannot be read or is not a map, or two have the same name.
pub(crate) fn map_files(files: &[PathBuf]) -> Result<MergeState> {
    let mut state = MergeState::default();
    for (robot, file) in names::name_map_files(files)? {
        let (map, _) = load_as(&file, Thresholds::ByPicture)?;
        let data: Vec<u8> = map.cells.iter().map(|cell| cell.cast_unsigned()).collect();
        let grid = OccupancyGrid { header: Header::default(), info: map.info, data: &data };
        state.robot(&robot).map = Some(encode(&grid)?);
    }
    Ok(state)
}
