//! Logs put together from robots of other logs, with some of their tags.

use anyhow::{Context, Result};
use gridweave_logs::reader;
use gridweave_logs::schemas::full_type_name;
use gridweave_logs::sink::{LogOptions, LogWriter, Outcome};
use gridweave_runtime::message::Channel;
use gridweave_runtime::ros::{PoseStamped, RosMessage, TagRange, decode, encode};
use mcap::records::MessageHeader;
use nalgebra::Point2;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// How far tags are read, metres.
const REACH: f64 = 3.0;

/// One robot of a log, and which of its tags are kept.
#[derive(Clone, Debug)]
pub(super) struct Member<'a> {
    /// The log.
    pub(super) log: &'a Path,
    /// The robot: the first part of its topics.
    pub(super) robot: &'a str,
    /// The tags that are kept; the readings of all others are left out.
    pub(super) tags: BTreeMap<String, Kept>,
}

/// A tag that is kept.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Kept {
    /// What it is called.
    pub(super) name: String,
    /// From where to where it is moved in the robot's map, metres, if it is.
    pub(super) moved: Option<[Point2<f64>; 2]>,
}

impl Kept {
    /// A tag that stays where it is.
    pub(super) fn named(name: impl Into<String>) -> Self {
        Self { name: name.into(), moved: None }
    }

    /// The reading of the tag by this name and at its place, by a robot at `position`; it keeps its noise. None if it
    /// is out of reach there.
    fn reading(&self, mut reading: TagRange, position: &Point2<f64>) -> Option<TagRange> {
        reading.tag_id.clone_from(&self.name);
        if let Some([from, to]) = &self.moved {
            reading.range += (position - to).norm() - (position - from).norm();
        }
        (self.moved.is_none() || (0.0..=REACH).contains(&reading.range)).then_some(reading)
    }
}

/// A message of a member.
struct Record {
    channel: Channel,
    log_time: u64,
    publish_time: u64,
    data: Vec<u8>,
}

/// Writes a log of some robots. Their times are those of their logs, counted from the first message of each.
pub(super) fn write(members: &[Member<'_>], to: &Path) -> Result<()> {
    let mut records = Vec::new();
    for member in members {
        let doing = || format!("cannot take {} from {}", member.robot, member.log.display());
        read(member, &mut records).with_context(doing)?;
    }
    records.sort_by_key(|record| record.log_time);
    let mut writer = LogWriter::create(to, LogOptions::default())?;
    for (sequence, record) in (0..).zip(&records) {
        let channel_id = writer.channel(&record.channel)?;
        let header =
            MessageHeader { channel_id, sequence, log_time: record.log_time, publish_time: record.publish_time };
        writer.write(&header, &record.data)?;
    }
    writer.finish(Outcome::Complete)?;
    Ok(())
}

fn read(member: &Member<'_>, into: &mut Vec<Record>) -> Result<()> {
    let prefix = format!("/{}/", member.robot);
    let mut position = Point2::origin();
    let mut reader = reader::open(&[member.log.to_owned()])?;
    let files = Arc::clone(reader.files());
    let mut start = None;
    while let Some(message) = reader.next_message() {
        let start = *start.get_or_insert(message.log_time.0);
        let channel = files[message.file].channel(message.channel);
        let Some(channel) = channel.filter(|channel| channel.topic.starts_with(&prefix)) else { continue };
        let ros_type = full_type_name(&channel.schema_name);
        let mut data = message.data.to_vec();
        if ros_type == PoseStamped::NAME {
            position = decode::<PoseStamped>(message.data)?.pose.planar().translation.vector.into();
        } else if ros_type == TagRange::NAME {
            let reading: TagRange = decode(message.data)?;
            let kept = member.tags.get(&reading.tag_id);
            let Some(reading) = kept.and_then(|kept| kept.reading(reading, &position)) else { continue };
            data = encode(&reading)?;
        }
        let since_start = |time: u64| time.saturating_sub(start);
        let (log_time, publish_time) = (since_start(message.log_time.0), since_start(message.publish_time));
        into.push(Record { channel, log_time, publish_time, data });
    }
    Ok(())
}
