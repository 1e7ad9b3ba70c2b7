//! What is in a log: topics, robots, and what is wrong with it.

mod robots;

#[cfg(test)]
mod tests;

pub use robots::RobotInfo;

use crate::names::{self, Input, NameError, NameRules, Names, Renamed};
use crate::reader::{Damage, LogFile, LogReader};
use crate::source::Role;
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
}

/// Reads logs through, and says what is in them. `rules` say what topics are called, and `robots` how they are told apart.
///
/// # Errors
/// A log cannot be read, or the rules do not fit what is in them.
pub fn inspect(inputs: &[Input], rules: &NameRules, robots: &RobotTopics) -> Result<LogInfo, NameError> {
    let (mut reader, names) = names::open(inputs, rules, robots)?;
    let files = reader.files().clone();
    let mut info = LogInfo { files: files.iter().map(file_info).collect(), ..Default::default() };
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
        let Entry { role, robot, info: topic, .. } = entry;
        if topic.messages == 0 {
            topic.first = time.seconds();
        }
        topic.last = time.seconds();
        topic.messages += 1;
        topic.bytes += message.data.len() as u64;
        // Transforms are looked into, and their frames are to have the names that a merge gives them.
        let is_renamed = *role == Role::Tf && names.rename_frames(&message, &mut renamed) == Renamed::Copied;
        survey.take(*role, robot, &topic.topic, if is_renamed { &renamed } else { message.data });
    }
    add_late_damage(&mut reader, &mut info);
    if let Some((first, last)) = times {
        (info.start, info.end) = (Some(first.seconds()), Some(last.seconds()));
        info.duration = last.seconds_since(first);
    }
    info.topics = topics.entries.into_iter().map(|entry| entry.info).collect();
    info.topics.sort_by(|a, b| (&a.topic, &a.type_name).cmp(&(&b.topic, &b.type_name)));
    info.problems = survey.problems(&info);
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
    info: TopicInfo,
}

impl Topics {
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
                    self.entries.push(Entry { role, robot, info: topic_info(channel.clone()) });
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
        topic: channel.topic,
        type_name: channel.schema_name,
        encoding: channel.message_encoding,
        ..Default::default()
    }
}
