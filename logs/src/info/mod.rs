//! What is in a log: topics, robots, and what is wrong with it.

mod clocks;
mod robots;
mod run;

#[cfg(test)]
mod tests;

pub use clocks::ClockInfo;
pub use robots::RobotInfo;
pub use run::RunInfo;

use crate::names::{self, Input, NameError, NameRules, Names, Renamed};
use crate::qos;
use crate::reader::{Damage, LogFile, LogReader};
use crate::robots::{RobotChannels, Role};
use clocks::HeaderPlace;
use gridweave_runtime::message::{Channel, LogTime};
use gridweave_runtime::stage::RobotTopics;
use robots::RobotSurvey;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

/// What is in one or more logs. Times are seconds since the epoch of the logs.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LogInfo {
    /// The files, in the order given.
    pub files: Vec<FileInfo>,
    /// How many messages there are.
    pub messages: u64,
    /// When the first one was logged; `None` if there is none.
    pub start: Option<f64>,
    /// When the last one was logged.
    pub end: Option<f64>,
    /// Seconds from the first message to the last.
    pub duration: f64,
    /// Whether only the index and a few messages were read. Then sizes are estimates; and frames, clocks, tags and poses from
    /// transforms are those of these messages.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub is_sampled: bool,
    /// The topics, by name and then by type.
    pub topics: Vec<TopicInfo>,
    /// How robots were named without being asked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remark: Option<String>,
    /// What was recognised of each robot.
    pub robots: BTreeMap<String, RobotInfo>,
    /// What stands in the way of using the logs, or of merging the robots' maps.
    pub problems: Vec<String>,
}

/// One file of a log.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FileInfo {
    /// Its path.
    pub path: PathBuf,
    /// What it is: `MCAP` or `SQLite`, and whether it is packed.
    pub container: String,
    /// The robot that all of it was put under.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub robot: Option<String>,
    /// Its size in bytes.
    pub size: u64,
    /// How many messages were read from it.
    pub messages: u64,
    /// How many chunks it has; 0 if its messages are not in chunks.
    pub chunks: usize,
    /// How its chunks are compressed: `none`, `lz4`, `zstd`.
    pub compression: Vec<String>,
    /// The run that wrote it, if that is a log of Gridweave.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub run: Option<RunInfo>,
    /// The names of its metadata records, but for those of its run.
    #[serde(skip_serializing_if = "BTreeSet::is_empty")]
    pub metadata: BTreeSet<String>,
    /// How many attachments it has.
    pub attachments: usize,
    /// What is wrong with it, and how often.
    pub damage: BTreeMap<String, u64>,
}

/// One topic of a log.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TopicInfo {
    /// Its name, under that of its robot.
    pub topic: String,
    /// The names that it has in the logs.
    pub logged: BTreeSet<String>,
    /// The type of its messages; empty if the log does not tell.
    #[serde(rename = "type")]
    pub type_name: String,
    /// How its messages are encoded, `cdr` for ROS 2.
    pub encoding: String,
    /// How many messages there are.
    pub messages: u64,
    /// Bytes of the messages, uncompressed.
    pub bytes: u64,
    /// When the first one was logged.
    pub first: f64,
    /// When the last one was logged.
    pub last: f64,
    /// How many there are in a second, from the first to the last; none of a single one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate: Option<f64>,
    /// The longest time between two that follow each other, seconds.
    pub largest_gap: f64,
    /// What the log says of their quality of service: `latched`, `reliable` or `best effort`; empty if it says nothing.
    pub qos: String,
    /// The frames that their headers name, ten at most.
    #[serde(skip_serializing_if = "BTreeSet::is_empty")]
    pub frames: BTreeSet<String>,
    /// How far the stamps of their headers are ahead of the times that they were logged at.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clock: Option<ClockInfo>,
}

/// Of a topic so many frames are told.
const MOST_FRAMES: usize = 10;

/// Reads logs through, and says what is in them. `rules` say what topics are called, and `robots` how they are told apart.
///
/// # Errors
/// A log cannot be read, or the rules do not fit what is in them.
pub fn inspect(inputs: &[Input], rules: &NameRules, robots: &RobotTopics) -> Result<LogInfo, NameError> {
    look(inputs, rules, robots, u64::MAX)
}

/// The same, but of logs that are large and have an index that is whole only the index is read and a few messages.
///
/// # Errors
/// A log cannot be read, or the rules do not fit what is in them.
pub fn glance(inputs: &[Input], rules: &NameRules, robots: &RobotTopics) -> Result<LogInfo, NameError> {
    look(inputs, rules, robots, LARGE)
}

/// Logs of fewer bytes are always read through.
const LARGE: u64 = 64 << 20;
/// Of a large log the messages in so many blocks are read, at its beginning and at its end, and in those in which a topic begins.
const SAMPLE: usize = 2;

/// Says what is in logs. Those of more than `large` bytes are not read through if their index is whole.
fn look(inputs: &[Input], rules: &NameRules, robots: &RobotTopics, large: u64) -> Result<LogInfo, NameError> {
    let (mut reader, names) = names::open(inputs, rules, robots)?;
    let files = reader.files().clone();
    let size = files.iter().map(LogFile::size).fold(0, u64::saturating_add);
    let is_sampled = size > large && files.iter().all(|file| file.index().is_some());
    if is_sampled {
        reader.sample(SAMPLE);
    }
    let mut info = LogInfo { is_sampled, files: files.iter().map(file_info).collect(), ..Default::default() };
    info.remark = names.remark().map(str::to_owned);
    for (number, file) in info.files.iter_mut().enumerate() {
        file.robot = names.robot_of_file(number).map(str::to_owned);
    }
    for (file, log) in info.files.iter_mut().zip(files.iter()) {
        log.damage().iter().for_each(|damage| file.add(damage));
    }
    let mut topics = Topics { known: vec![Vec::new(); files.len()], entries: Vec::new() };
    let mut survey = RobotSurvey::new(robots.clone(), names.channels());
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
        // Where frames are looked at, they are to have the names that a merge gives them.
        let is_renamed =
            survey.looks_at_frames(*role, robot) && names.rename_frames(&message, &mut renamed) == Renamed::Copied;
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
    let robots = topics.entries.iter().map(|entry| (entry.robot.as_str(), &entry.info));
    let clocks = clocks::remarks(robots);
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

/// Whether logs hold tags that robots have read or seen, but no map of any robot: then there is nothing to merge but frames.
/// Nothing but the channels is looked at.
///
/// # Errors
/// A log cannot be read, or the rules do not fit what is in them.
pub fn holds_tags_alone(inputs: &[Input], rules: &NameRules, robots: &RobotTopics) -> Result<bool, NameError> {
    let (_, names) = names::open(inputs, rules, robots)?;
    let channels = RobotChannels::new(robots.clone(), names.channels());
    let roles: Vec<Role> = names.channels().map(|channel| channels.classify(channel).role).collect();
    let holds_tags = roles.iter().any(|role| matches!(role, Role::Tags | Role::TagMessage));
    Ok(holds_tags && !roles.contains(&Role::Map) && !roles.contains(&Role::Scan))
}

/// The robots of logs that have scans and no map, by name: their maps can be drawn. Nothing but the channels is looked at.
///
/// # Errors
/// A log cannot be read, or the rules do not fit what is in them.
pub fn robots_to_draw(inputs: &[Input], rules: &NameRules, robots: &RobotTopics) -> Result<Vec<String>, NameError> {
    let (_, names) = names::open(inputs, rules, robots)?;
    let channels = RobotChannels::new(robots.clone(), names.channels());
    Ok(channels.scanned().map(str::to_owned).collect())
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

/// The topics met so far. Channels that agree in topic, type and encoding are one.
struct Topics {
    /// For every file and channel number: the index of the entry, once it is known.
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
    /// Puts what the indexes say of all messages in place of what a sample of them has told. Gives the times of the first and the
    /// last.
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
                    // The files of a split bag follow each other.
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
