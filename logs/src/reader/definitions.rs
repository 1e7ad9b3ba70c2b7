//! The channels and schemas that a log describes.

use super::record::{Fields, Record};
use super::ros1::{self, Converted};
use crate::dynamic::Recoder;
use crate::qos;
use gridweave_runtime::message::Channel;
use mcap::records::op;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The maximum number of channels in a log: their numbers have 16 bits, and 0 and 65535 are reserved.
pub(crate) const MOST_CHANNELS: usize = 65534;

/// The maximum size of the descriptions of all channels of a log, bytes. Each channel counts with its schema, also if
/// they share one: readers keep a parsed copy for each.
const MOST_BYTES: usize = 64 << 20;

/// The channels and schemas of one file, by number.
#[derive(Clone, Debug, Default)]
pub(crate) struct Definitions {
    schemas: BTreeMap<u16, Schema>,
    channels: BTreeMap<u16, ChannelRecord>,
    /// The converters of ROS 1 messages, by channel. Channels of one schema share theirs.
    ros1: BTreeMap<u16, Arc<Recoder>>,
    /// The number of redefinitions that differ.
    pub(crate) redefined: usize,
}

#[derive(Clone, Debug, PartialEq)]
struct Schema {
    name: String,
    encoding: String,
    text: Vec<u8>,
}

#[derive(Clone, Debug, PartialEq)]
struct ChannelRecord {
    schema: u16,
    topic: String,
    message_encoding: String,
    metadata: BTreeMap<String, String>,
}

impl Definitions {
    /// Adds the channel or schema in a record, if it contains one. A truncated record is ignored.
    pub(crate) fn read(&mut self, record: &Record<'_>) {
        match record.opcode {
            op::SCHEMA => {
                if let Some((id, schema)) = read_schema(record.body) {
                    self.redefined += usize::from(differs(&mut self.schemas, id, schema));
                }
            }
            op::CHANNEL => {
                if let Some((id, channel)) = read_channel(record.body) {
                    self.redefined += usize::from(differs(&mut self.channels, id, channel));
                }
            }
            _ => {}
        }
    }

    /// Adds a channel with its schema under a number that is neither 0 nor the maximum.
    pub(crate) fn insert(&mut self, number: u16, channel: Channel) {
        let Channel { topic, message_encoding, schema_name: name, schema_encoding: encoding, schema: text, metadata } =
            channel;
        let schema = if name.is_empty() { 0 } else { number };
        self.schemas.insert(schema, Schema { name, encoding, text });
        self.channels.insert(number, ChannelRecord { schema, topic, message_encoding, metadata });
    }

    /// Adds the definitions in another part of the same file.
    pub(crate) fn merge(&mut self, other: Self) {
        self.redefined += other.redefined;
        for (id, schema) in other.schemas {
            self.redefined += usize::from(differs(&mut self.schemas, id, schema));
        }
        for (id, channel) in other.channels {
            self.redefined += usize::from(differs(&mut self.channels, id, channel));
        }
    }

    /// Removes the channels with the greatest numbers if the descriptions of all are too large together. Returns the
    /// number of those that it has removed.
    pub(crate) fn limit(&mut self) -> usize {
        let (before, mut left, schemas) = (self.channels.len(), MOST_BYTES, &self.schemas);
        self.channels.retain(|_, channel| {
            let schema = schemas.get(&channel.schema).map_or(0, |schema| schema.name.len() + schema.text.len());
            let pairs: usize = channel.metadata.iter().map(|(key, value)| key.len() + value.len()).sum();
            let size = schema + channel.topic.len() + channel.message_encoding.len() + pairs;
            left = left.saturating_sub(size);
            left > 0
        });
        before - self.channels.len()
    }

    /// Describes ROS 1 channels as ROS 2 ones. Their messages are yet to be converted, by [`Self::ros1`]. A channel whose
    /// definition cannot be used is unchanged.
    pub(crate) fn convert_ros1(&mut self) {
        let mut recoders = BTreeMap::new();
        for (id, schema) in self.schemas.iter_mut().filter(|(_, schema)| schema.encoding == ros1::DEFINITION) {
            if let Some(converted) = Converted::of(&schema.name, &String::from_utf8_lossy(&schema.text)) {
                let Converted { type_name: name, definition, recoder } = converted;
                *schema = Schema { name, encoding: "ros2msg".to_owned(), text: definition.into_bytes() };
                recoders.insert(*id, Arc::new(recoder));
            }
        }
        for (id, channel) in self.channels.iter_mut().filter(|(_, channel)| channel.message_encoding == ros1::MESSAGES)
        {
            let Some(recoder) = recoders.get(&channel.schema) else { continue };
            self.ros1.insert(*id, Arc::clone(recoder));
            channel.message_encoding = "cdr".to_owned();
            // A name without a slash at its beginning is relative to the root, as in `rosbag play`.
            if !channel.topic.starts_with('/') {
                channel.topic.insert(0, '/');
            }
            let latching = channel.metadata.remove(ros1::LATCHING).unwrap_or_default();
            let is_latching = latching == "1" || latching.eq_ignore_ascii_case("true");
            let offered = if is_latching { qos::LATCHED } else { "" };
            channel.metadata.insert(qos::KEY.to_owned(), offered.to_owned());
        }
    }

    /// The converters of the messages of ROS 1 channels, by channel.
    pub(crate) fn ros1(&self) -> &BTreeMap<u16, Arc<Recoder>> {
        &self.ros1
    }

    /// Whether the messages of a channel are encoded as CDR.
    pub(crate) fn is_cdr(&self, id: u16) -> bool {
        self.channels.get(&id).is_some_and(|channel| channel.message_encoding == "cdr")
    }

    /// The number of channels.
    pub(crate) fn channel_count(&self) -> usize {
        self.channels.len()
    }

    /// The numbers of all channels, in order.
    pub(crate) fn channel_numbers(&self) -> impl Iterator<Item = u16> + '_ {
        self.channels.keys().copied()
    }

    /// Whether the schemas of all channels are known.
    pub(crate) fn schemas_complete(&self) -> bool {
        self.channels.values().all(|channel| channel.schema == 0 || self.schemas.contains_key(&channel.schema))
    }

    /// The channel with the given number.
    pub(crate) fn channel(&self, id: u16) -> Option<Channel> {
        let channel = self.channels.get(&id)?;
        // Number 0 is used for a channel without a schema.
        let schema = self.schemas.get(&channel.schema).filter(|_| channel.schema != 0);
        Some(Channel {
            topic: channel.topic.clone(),
            message_encoding: channel.message_encoding.clone(),
            schema_name: schema.map(|schema| schema.name.clone()).unwrap_or_default(),
            schema_encoding: schema.map(|schema| schema.encoding.clone()).unwrap_or_default(),
            schema: schema.map(|schema| schema.text.clone()).unwrap_or_default(),
            metadata: channel.metadata.clone(),
        })
    }
}

/// Inserts `new` unless there is an entry; whether an existing entry differs.
fn differs<T: PartialEq>(known: &mut BTreeMap<u16, T>, id: u16, new: T) -> bool {
    match known.get(&id) {
        Some(old) => *old != new,
        None => {
            known.insert(id, new);
            false
        }
    }
}

fn read_schema(body: &[u8]) -> Option<(u16, Schema)> {
    let mut fields = Fields(body);
    let id = fields.u16()?;
    let (name, encoding) = (fields.text()?, fields.text()?);
    Some((id, Schema { name, encoding, text: fields.block()?.0.to_vec() }))
}

fn read_channel(body: &[u8]) -> Option<(u16, ChannelRecord)> {
    let mut fields = Fields(body);
    let (id, schema) = (fields.u16()?, fields.u16()?);
    let (topic, message_encoding) = (fields.text()?, fields.text()?);
    let mut pairs = fields.block()?;
    let mut metadata = BTreeMap::new();
    while !pairs.0.is_empty() {
        metadata.insert(pairs.text()?, pairs.text()?);
    }
    Some((id, ChannelRecord { schema, topic, message_encoding, metadata }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_descriptions_of_all_channels_are_limited_together() {
        let mut definitions = Definitions::default();
        definitions
            .schemas
            .insert(1, Schema { name: "a/A".into(), encoding: "ros2msg".into(), text: vec![b' '; 1 << 20] });
        let channel = |topic: &str| ChannelRecord {
            schema: 1,
            topic: topic.into(),
            message_encoding: "cdr".into(),
            metadata: BTreeMap::new(),
        };
        for number in 1..=60 {
            definitions.channels.insert(number, channel("/a"));
        }
        assert_eq!((definitions.limit(), definitions.channel_count()), (0, 60));
        for number in 61..=1000 {
            definitions.channels.insert(number, channel("/b"));
        }
        assert_eq!((definitions.limit(), definitions.channel_count()), (937, 63));
        assert!(definitions.channel_numbers().eq(1..=63));
    }
}
