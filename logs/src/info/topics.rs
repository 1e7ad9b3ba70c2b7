//! The topics of logs.

use super::LogInfo;
use super::clocks::{ClockInfo, HeaderPlace};
use super::robots::RobotSurvey;
use crate::names::Names;
use crate::qos;
use crate::reader::{IndexedChannel, LogFile};
use crate::robots::Role;
use gridweave_runtime::message::{Channel, LogTime};
use gridweave_runtime::ros::Header;
use serde::Serialize;
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

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

/// The topics found so far. Channels with equal topic, type and encoding are one topic.
pub(super) struct Topics {
    /// By file and channel number: the index of the entry, once known.
    known: Vec<Vec<Option<usize>>>,
    /// By topic, type and encoding: the index of the entry.
    by_name: BTreeMap<[String; 3], usize>,
    entries: Vec<Entry>,
}

/// A topic, its role and its robot.
pub(super) struct Entry {
    pub(super) role: Role,
    pub(super) robot: String,
    pub(super) header: HeaderPlace,
    pub(super) info: TopicInfo,
}

impl Topics {
    /// No topics, for so many files.
    pub(super) fn new(files: usize) -> Self {
        Self { known: vec![Vec::new(); files], by_name: BTreeMap::new(), entries: Vec::new() }
    }

    /// The topics, in the order of their first messages.
    pub(super) fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// The topics with their rates, by name and then by type.
    pub(super) fn finish(self) -> Vec<TopicInfo> {
        let with_rate = |Entry { mut info, .. }: Entry| {
            let seconds = info.last - info.first;
            info.rate = (info.messages > 1 && seconds > 0.0).then(|| (info.messages - 1) as f64 / seconds);
            info
        };
        let mut topics: Vec<TopicInfo> = self.entries.into_iter().map(with_rate).collect();
        topics.sort_by(|a, b| (&a.topic, &a.type_name).cmp(&(&b.topic, &b.type_name)));
        topics
    }

    /// Replaces the sampled statistics by those of all messages, from the indexes. Returns the times of the first and
    /// the last message.
    pub(super) fn complete(
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
                let (first, last) = topic.add_index(indexed, file.later());
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

    /// The entry of a channel of a file, created if it is new; `None` if the channel is unknown.
    pub(super) fn find(
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
                let key = [&channel.topic, &channel.schema_name, &channel.message_encoding].map(String::clone);
                let index = *self.by_name.entry(key).or_insert(self.entries.len());
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

impl TopicInfo {
    /// Adds the time and the size (bytes) of a message.
    pub(super) fn add_message(&mut self, time: LogTime, size: usize) {
        match self.messages {
            0 => self.first = time.seconds(),
            _ => self.largest_gap = self.largest_gap.max(time.seconds() - self.last),
        }
        self.last = time.seconds();
        self.messages += 1;
        self.bytes += size as u64;
    }

    /// Adds the header of a message of that log time, in a file whose log times are shifted by `later` nanoseconds.
    /// `frame` is the name of its frame under the robot.
    pub(super) fn add_header(&mut self, header: &Header, time: LogTime, later: i64, frame: Cow<'_, str>) {
        self.clock.get_or_insert_default().add(header, time, later);
        if self.frames.len() < MOST_FRAMES && !self.frames.contains(&*frame) {
            self.frames.insert(frame.into_owned());
        }
    }

    /// Adds the messages of a channel by the index of its file, whose log times are shifted by `later` nanoseconds.
    /// Returns the times of the first and the last one.
    fn add_index(&mut self, indexed: &IndexedChannel, later: i64) -> (LogTime, LogTime) {
        let [first, last] = [indexed.first, indexed.last].map(|time| LogTime(time.saturating_add_signed(later)));
        let gap = indexed.largest_gap as f64 * 1e-9;
        match self.messages {
            0 => (self.first, self.last, self.largest_gap) = (first.seconds(), last.seconds(), gap),
            // The files of a split bag are consecutive.
            _ => {
                self.largest_gap = self.largest_gap.max(gap).max(first.seconds() - self.last);
                self.first = self.first.min(first.seconds());
                self.last = self.last.max(last.seconds());
            }
        }
        self.messages += indexed.messages;
        (first, last)
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
