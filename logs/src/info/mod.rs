//! The contents of logs: topics, robots, and problems.

mod channels;
mod clocks;
mod robots;
mod run;
mod topics;

#[cfg(test)]
mod tests;

pub use channels::{holds_tags_alone, robots_with_scans_only};
pub use clocks::ClockInfo;
pub use robots::RobotInfo;
pub use run::RunInfo;
pub use topics::TopicInfo;

use crate::names::{self, Input, NameError, NameRules, Names, Renamed};
use crate::one_map::OneMap;
use crate::reader::{Damage, LogFile, LogReader};
use gridweave_runtime::message::LogTime;
use gridweave_runtime::stage::RobotTopics;
use robots::RobotSurvey;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use topics::{Entry, Topics};

/// The contents of one or more logs. Times are seconds since the epoch.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LogInfo {
    /// The files, in the given order.
    pub files: Vec<FileInfo>,
    /// The number of messages.
    pub messages: u64,
    /// The log time of the first message; `None` without messages.
    pub start: Option<f64>,
    /// The log time of the last message.
    pub end: Option<f64>,
    /// Seconds from the first message to the last.
    pub duration: f64,
    /// Whether only the index and a few messages were read. Then sizes are estimates, and frames, clocks, tags and
    /// poses from transforms are those of these messages.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub is_sampled: bool,
    /// The topics, by name and then by type.
    pub topics: Vec<TopicInfo>,
    /// A note about robot names that were inferred.
    #[serde(rename = "remark", skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
    /// The robots.
    pub robots: BTreeMap<String, RobotInfo>,
    /// Problems with reading the logs or merging the robots' maps.
    pub problems: Vec<String>,
}

/// A log file.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FileInfo {
    /// The path.
    pub path: PathBuf,
    /// The container, such as `MCAP` or `SQLite`, and whether it is compressed.
    pub container: String,
    /// The robot that the whole file was put under.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub robot: Option<String>,
    /// The size in bytes.
    pub size: u64,
    /// The number of messages that were read.
    pub messages: u64,
    /// The number of chunks; 0 if messages are not in chunks.
    pub chunks: usize,
    /// The compressions of the chunks: `none`, `lz4`, `zstd`.
    pub compression: Vec<String>,
    /// The run that wrote the file, if it is a log of Gridweave.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub run: Option<RunInfo>,
    /// The names of its metadata records, except those about its run.
    #[serde(skip_serializing_if = "BTreeSet::is_empty")]
    pub metadata: BTreeSet<String>,
    /// The number of attachments.
    pub attachments: usize,
    /// Descriptions of the damage, with the number of times each occurred.
    pub damage: BTreeMap<String, u64>,
}

/// Reads logs completely and returns their contents. `rules` name the topics, and `robots` are the topic patterns.
///
/// # Errors
/// A log cannot be read, or the rules do not match the logs.
pub fn inspect(inputs: &[Input], rules: &NameRules, robots: &RobotTopics) -> Result<LogInfo, NameError> {
    look(inputs, rules, robots, u64::MAX)
}

/// The same, but reads only the index and a few messages of large logs with an intact index.
///
/// # Errors
/// A log cannot be read, or the rules do not match the logs.
pub fn glance(inputs: &[Input], rules: &NameRules, robots: &RobotTopics) -> Result<LogInfo, NameError> {
    look(inputs, rules, robots, LARGE)
}

/// Logs with fewer bytes are always read completely.
const LARGE: u64 = 64 << 20;
/// The number of blocks that are read at the beginning and at the end of a large log, in addition to those in which a
/// topic begins.
const SAMPLE: usize = 2;

/// Inspects logs. Those with more than `large` bytes are not read completely if their index is intact.
fn look(inputs: &[Input], rules: &NameRules, robots: &RobotTopics, large: u64) -> Result<LogInfo, NameError> {
    let (mut reader, names) = names::open(inputs, rules, robots)?;
    let files = reader.files().clone();
    let size = files.iter().map(LogFile::size).fold(0, u64::saturating_add);
    let is_sampled = size > large && files.iter().all(|file| file.index().is_some());
    if is_sampled {
        reader.sample(SAMPLE);
    }
    let mut info = LogInfo { is_sampled, note: names.note().map(str::to_owned), ..Default::default() };
    info.files = files.iter().enumerate().map(|(number, file)| file_info(file, names.robot_of_file(number))).collect();
    let mut survey = RobotSurvey::new(robots.clone(), names.channels());
    survey.set_given_robots(names.given_robots());
    survey.set_one_map(OneMap::read(&files, &names, robots));
    let mut topics = Topics::new(files.len());
    let mut times = read(&mut reader, &names, &mut topics, &mut survey, &mut info);
    if is_sampled {
        times = topics.complete(&files, &names, &mut survey, &mut info);
    }
    Ok(finish(info, topics, survey, times))
}

/// Reads the messages. Returns the times of the first and the last one.
fn read(
    reader: &mut LogReader,
    names: &Names,
    topics: &mut Topics,
    survey: &mut RobotSurvey,
    info: &mut LogInfo,
) -> Option<(LogTime, LogTime)> {
    let files = reader.files().clone();
    let mut renamed = Vec::new();
    let mut times: Option<(LogTime, LogTime)> = None;
    while let Some(message) = reader.next_message() {
        let (index, time) = (message.file, message.log_time);
        let Some(file) = info.files.get_mut(index) else { continue };
        if !names.wants(index, message.channel) {
            continue;
        }
        let Some(entry) = topics.find(&files, names, index, message.channel, survey) else {
            file.add(&Damage::UnknownChannel { channel: message.channel });
            continue;
        };
        times = Some((times.map_or(time, |(first, _)| first), time));
        file.messages += 1;
        info.messages += 1;
        let Entry { role, robot, header, info: topic } = entry;
        if let Some(header) = header.read(message.data) {
            let later = files.get(index).map_or(0, LogFile::later);
            topic.add_header(&header, time, later, names.frame(index, message.channel, &header.frame_id));
        }
        topic.add_message(time, message.data.len());
        // The frames must have the names that a merge gives them.
        let is_renamed = RobotSurvey::reads(*role) && names.rename_frames(&message, &mut renamed) == Renamed::Copied;
        survey.take(*role, robot, &topic.topic, if is_renamed { &renamed } else { message.data });
    }
    for (file, damage) in reader.take_damage() {
        if let Some(file) = info.files.get_mut(file) {
            file.add(&damage);
        }
    }
    times
}

/// Completes the contents with the topics, the robots and the problems. `times` are those of the first and the last
/// message.
fn finish(mut info: LogInfo, topics: Topics, mut survey: RobotSurvey, times: Option<(LogTime, LogTime)>) -> LogInfo {
    if let Some((first, last)) = times {
        (info.start, info.end) = (Some(first.seconds()), Some(last.seconds()));
        info.duration = last.seconds_since(first);
    }
    survey.remove_merged_maps();
    let robots = topics.entries().iter().map(|entry| (entry.robot.as_str(), &entry.info));
    let clocks = clocks::notes(robots.filter(|(robot, _)| survey.is_known(robot)));
    info.topics = topics.finish();
    info.problems = survey.problems(&info);
    info.problems.extend(clocks);
    info.robots = survey.into_robots();
    info
}

fn file_info(file: &LogFile, robot: Option<&str>) -> FileInfo {
    let name = |compression: &String| if compression.is_empty() { "none".to_owned() } else { compression.clone() };
    let mut info = FileInfo {
        path: file.path().to_owned(),
        robot: robot.map(str::to_owned),
        container: file.container(),
        size: file.size(),
        chunks: file.chunks(),
        compression: file.compressions().iter().map(name).collect(),
        run: RunInfo::of(file),
        metadata: file.metadata_names().filter(|name| !run::is_of_run(name)).map(str::to_owned).collect(),
        attachments: file.attachments(),
        ..Default::default()
    };
    file.damage().iter().for_each(|damage| info.add(damage));
    info
}

impl FileInfo {
    fn add(&mut self, damage: &Damage) {
        *self.damage.entry(damage.to_string()).or_default() += 1;
    }
}
