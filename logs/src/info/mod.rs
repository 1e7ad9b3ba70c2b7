//! The contents of logs: topics, robots, and problems.

mod channels;
mod clocks;
mod robots;
mod run;

#[cfg(test)]
mod tests;

pub use channels::{holds_tags_alone, robots_with_scans_only};
pub use clocks::ClockInfo;
pub use robots::RobotInfo;
pub use run::RunInfo;

use crate::names::{self, Input, NameError, NameRules, Names, Renamed};
use crate::one_map::OneMap;
use crate::qos;
use crate::reader::{Damage, LogFile, LogReader};
use crate::robots::Role;
use clocks::HeaderPlace;
use gridweave_runtime::message::{Channel, LogTime};
use gridweave_runtime::stage::RobotTopics;
use robots::RobotSurvey;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

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

/// A topic.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TopicInfo {
    /// The name, under its robot.
    pub topic: String,
    /// The names in the logs.
    pub logged: BTreeSet<String>,
    /// The message type; empty if the log does not contain it.
    #[serde(rename = "type")]
    pub type_name: String,
    /// The message encoding, `cdr` for ROS 2.
    pub encoding: String,
    /// The number of messages.
    pub messages: u64,
    /// The size of the messages, uncompressed, bytes.
    pub bytes: u64,
    /// The log time of the first message.
    pub first: f64,
    /// The log time of the last message.
    pub last: f64,
    /// The mean number of messages per second, from the first to the last; `None` for a single one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate: Option<f64>,
    /// The longest time between consecutive messages, seconds.
    pub largest_gap: f64,
    /// The quality of service: `latched`, `reliable` or `best effort`; empty if unknown.
    pub qos: String,
    /// The frames in the headers, at most ten.
    #[serde(skip_serializing_if = "BTreeSet::is_empty")]
    pub frames: BTreeSet<String>,
    /// The offset of the stamps in the headers from the log times.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clock: Option<ClockInfo>,
}

/// The maximum number of frames listed for a topic.
const MOST_FRAMES: usize = 10;

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
    let mut info = LogInfo { is_sampled, files: files.iter().map(file_info).collect(), ..Default::default() };
    info.note = names.note().map(str::to_owned);
    for (number, file) in info.files.iter_mut().enumerate() {
        file.robot = names.robot_of_file(number).map(str::to_owned);
    }
    for (file, log) in info.files.iter_mut().zip(files.iter()) {
        log.damage().iter().for_each(|damage| file.add(damage));
    }
    let mut topics = Topics { known: vec![Vec::new(); files.len()], entries: Vec::new() };
    let mut survey = RobotSurvey::new(robots.clone(), names.channels());
    survey.set_one_map(OneMap::read(&files, &names, robots));
    let mut renamed = Vec::new();
    let mut times: Option<(LogTime, LogTime)> = None;
    while let Some(message) = reader.next_message() {
        let (index, time) = (message.file, message.log_time);
        let Some(file) = info.files.get_mut(index) else { continue };
        if !names.wants(index, message.channel) {
            continue;
        }
        let Some(entry) = topics.find(&files, &names, index, message.channel, &mut survey) else {
            file.add(&Damage::UnknownChannel { channel: message.channel });
            continue;
        };
        let first = times.map_or(time, |(first, _)| first);
        times = Some((first, time));
        file.messages += 1;
        info.messages += 1;
        let Entry { role, robot, info: topic, header, .. } = entry;
        match topic.messages {
            0 => topic.first = time.seconds(),
            _ => topic.largest_gap = topic.largest_gap.max(time.seconds() - topic.last),
        }
        if let Some(header) = header.read(message.data) {
            let later = files.get(index).map_or(0, LogFile::later);
            topic.clock.get_or_insert_default().add(&header, time, later);
            let frame = names.frame(index, message.channel, &header.frame_id);
            if topic.frames.len() < MOST_FRAMES && !topic.frames.contains(&*frame) {
                topic.frames.insert(frame.into_owned());
            }
        }
        topic.last = time.seconds();
        topic.messages += 1;
        topic.bytes += message.data.len() as u64;
        // The frames must have the names that a merge gives them.
        let is_renamed = RobotSurvey::reads(*role) && names.rename_frames(&message, &mut renamed) == Renamed::Copied;
        survey.take(*role, robot, &topic.topic, if is_renamed { &renamed } else { message.data });
    }
    add_late_damage(&mut reader, &mut info);
    if is_sampled {
        times = topics.complete(&files, &names, &mut survey, &mut info);
    }
    if let Some((first, last)) = times {
        (info.start, info.end) = (Some(first.seconds()), Some(last.seconds()));
        info.duration = last.seconds_since(first);
    }
    survey.remove_merged_maps();
    let robots = topics.entries.iter().map(|entry| (entry.robot.as_str(), &entry.info));
    let clocks = clocks::notes(robots.filter(|(robot, _)| survey.is_known(robot)));
    let finished = |Entry { mut info, .. }: Entry| {
        let seconds = info.last - info.first;
        info.rate = (info.messages > 1 && seconds > 0.0).then(|| (info.messages - 1) as f64 / seconds);
        info
    };
    info.topics = topics.entries.into_iter().map(finished).collect();
    info.topics.sort_by(|a, b| (&a.topic, &a.type_name).cmp(&(&b.topic, &b.type_name)));
    info.problems = survey.problems(&info);
    info.problems.extend(clocks);
    info.robots = survey.into_robots();
    Ok(info)
}

fn add_late_damage(reader: &mut LogReader, info: &mut LogInfo) {
    for (file, damage) in reader.take_damage() {
        if let Some(file) = info.files.get_mut(file) {
            file.add(&damage);
        }
    }
}

fn file_info(file: &LogFile) -> FileInfo {
    let name = |compression: &String| if compression.is_empty() { "none".to_owned() } else { compression.clone() };
    FileInfo {
        path: file.path().to_owned(),
        container: file.container(),
        size: file.size(),
        chunks: file.chunks(),
        compression: file.compressions().iter().map(name).collect(),
        run: RunInfo::of(file),
        metadata: file.metadata_names().filter(|name| !run::is_of_run(name)).map(str::to_owned).collect(),
        attachments: file.attachments(),
        ..Default::default()
    }
}

impl FileInfo {
    fn add(&mut self, damage: &Damage) {
        *self.damage.entry(damage.to_string()).or_default() += 1;
    }
}

/// The topics found so far. Channels with equal topic, type and encoding are one topic.
struct Topics {
    /// By file and channel number: the index of the entry, once known.
    known: Vec<Vec<Option<usize>>>,
    entries: Vec<Entry>,
}

struct Entry {
    role: Role,
    robot: String,
    header: HeaderPlace,
    info: TopicInfo,
}

impl Topics {
    /// Replaces the sampled statistics by those of all messages, from the indexes. Returns the times of the first and
    /// the last message.
    fn complete(
        &mut self,
        files: &[LogFile],
        names: &Names,
        survey: &mut RobotSurvey,
        info: &mut LogInfo,
    ) -> Option<(LogTime, LogTime)> {
        info.messages = 0;
        let sampled = |entry: &mut Entry| (std::mem::take(&mut entry.info.messages), entry.info.bytes);
        let mut samples: Vec<(u64, u64)> = self.entries.iter_mut().map(sampled).collect();
        self.entries.iter_mut().for_each(|entry| entry.info.largest_gap = 0.0);
        let mut times: Option<(LogTime, LogTime)> = None;
        for (number, file) in files.iter().enumerate() {
            let mut of_file = 0;
            for (&channel, indexed) in file.index().into_iter().flatten() {
                if indexed.messages == 0 || !names.wants(number, channel) {
                    continue;
                }
                let Some(Entry { info: topic, .. }) = self.find(files, names, number, channel, survey) else {
                    continue;
                };
                let [first, last] =
                    [indexed.first, indexed.last].map(|time| LogTime(time.saturating_add_signed(file.later())));
                let gap = indexed.largest_gap as f64 * 1e-9;
                match topic.messages {
                    0 => {
                        (topic.first, topic.last, topic.largest_gap) = (first.seconds(), last.seconds(), gap);
                    }
                    // The files of a split bag are consecutive.
                    _ => {
                        topic.largest_gap = topic.largest_gap.max(gap).max(first.seconds() - topic.last);
                        topic.first = topic.first.min(first.seconds());
                        topic.last = topic.last.max(last.seconds());
                    }
                }
                topic.messages += indexed.messages;
                of_file += indexed.messages;
                let (earliest, latest) = times.unwrap_or((first, last));
                times = Some((earliest.min(first), latest.max(last)));
            }
            info.messages += of_file;
            if let Some(file) = info.files.get_mut(number) {
                file.messages = of_file;
            }
        }
        samples.resize(self.entries.len(), (0, 0));
        for (Entry { role, robot, info: topic, .. }, (messages, bytes)) in self.entries.iter_mut().zip(samples) {
            survey.add(*role, robot, &topic.topic, topic.messages.saturating_sub(messages));
            let estimate = |messages: u64| (bytes as f64 / messages as f64 * topic.messages as f64) as u64;
            topic.bytes = if messages == 0 { 0 } else { estimate(messages) };
        }
        times
    }

    fn find(
        &mut self,
        files: &[LogFile],
        names: &Names,
        file: usize,
        number: u16,
        survey: &mut RobotSurvey,
    ) -> Option<&mut Entry> {
        let known = self.known.get_mut(file)?;
        let place = usize::from(number);
        if known.len() <= place {
            known.resize(place + 1, None);
        }
        let index = match known[place] {
            Some(index) => index,
            None => {
                let channel = names.channel(file, number)?;
                let index = self.entries.iter().position(|entry| entry.is_of(channel)).unwrap_or(self.entries.len());
                if index == self.entries.len() {
                    let (role, robot) = survey.classify(channel);
                    let header = HeaderPlace::of(channel);
                    self.entries.push(Entry { role, robot, header, info: topic_info(channel.clone()) });
                }
                if let (Some(entry), Some(logged)) = (self.entries.get_mut(index), files.get(file)?.channel(number)) {
                    entry.info.logged.insert(logged.topic);
                }
                known[place] = Some(index);
                index
            }
        };
        self.entries.get_mut(index)
    }
}

impl Entry {
    fn is_of(&self, channel: &Channel) -> bool {
        self.info.topic == channel.topic
            && self.info.type_name == channel.schema_name
            && self.info.encoding == channel.message_encoding
    }
}

fn topic_info(channel: Channel) -> TopicInfo {
    TopicInfo {
        qos: qos::word(&channel.metadata).to_owned(),
        topic: channel.topic,
        type_name: channel.schema_name,
        encoding: channel.message_encoding,
        ..Default::default()
    }
}
