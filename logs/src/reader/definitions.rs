//! The channels and schemas that a log describes.

use super::definition_records::{ChannelFields, ChannelRecord, SchemaFields, SchemaRecord};
use super::record::{Fields, Record};
use super::ros1::{self, Converted};
use crate::dynamic::Recoder;
use crate::qos;
use gridweave_runtime::message::Channel;
use mcap::records::op;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Arc;

/// The maximum number of channels in a log: their numbers have 16 bits, and 0 and 65535 are reserved.
pub(crate) const MOST_CHANNELS: usize = 65534;

/// The maximum size of the descriptions of all channels of a log, bytes. Each channel counts with its schema, also if
/// they share one: readers keep a parsed copy for each.
pub(crate) const MOST_BYTES: usize = 64 << 20;

/// The channels and schemas of one file, by number. They take at most [`MOST_BYTES`].
#[derive(Clone, Debug, Default)]
pub(crate) struct Definitions {
    schemas: BTreeMap<u16, SchemaRecord>,
    channels: BTreeMap<u16, ChannelRecord>,
    /// The size of all that is kept, bytes.
    size: usize,
    /// The numbers of the schemas and channels that were too large together with those before.
    refused_schemas: BTreeSet<u16>,
    refused_channels: BTreeSet<u16>,
    /// The converters of ROS 1 messages, by channel. Channels of one schema share theirs.
    ros1: BTreeMap<u16, Arc<Recoder>>,
    /// The number of redefinitions that differ.
    pub(crate) redefined: usize,
}

impl Definitions {
    /// Adds the channel or schema in a record, if it contains one. A truncated record is ignored.
    pub(crate) fn read(&mut self, record: &Record<'_>) {
        let is_schema = match record.opcode {
            op::SCHEMA => true,
            op::CHANNEL => false,
            _ => return,
        };
        let Some(id) = Fields(record.body).u16() else { return };
        let refused = if is_schema { &mut self.refused_schemas } else { &mut self.refused_channels };
        // Its texts are copied only if they may fit.
        if record.body.len() > MOST_BYTES {
            refused.insert(id);
            return;
        }
        if is_schema {
            let Some(schema) = SchemaFields::of(record.body) else { return };
            match self.schemas.get(&id) {
                Some(known) => self.redefined += usize::from(!schema.is(known)),
                None if !fits(&mut self.size, schema.size()) => _ = refused.insert(id),
                None => _ = self.schemas.insert(id, schema.to_schema()),
            }
        } else {
            let Some(channel) = ChannelFields::of(record.body) else { return };
            match self.channels.get(&id) {
                Some(known) => self.redefined += usize::from(!channel.is(known)),
                None if !fits(&mut self.size, channel.size()) => _ = refused.insert(id),
                None => _ = self.channels.insert(id, channel.to_record()),
            }
        }
    }

    /// Adds a channel with its schema under a number that is neither 0 nor the maximum, unless it is too large.
    pub(crate) fn insert(&mut self, number: u16, channel: Channel) {
        let Channel { topic, message_encoding, schema_name: name, schema_encoding: encoding, schema: text, metadata } =
            channel;
        let schema = if name.is_empty() { 0 } else { number };
        let described = SchemaRecord { name, encoding, text };
        let channel = ChannelRecord { schema, topic, message_encoding, metadata };
        if !fits(&mut self.size, described.size() + channel.size()) {
            self.refuse(number);
            return;
        }
        self.schemas.insert(schema, described);
        self.channels.insert(number, channel);
    }

    /// Leaves out a channel that is too large.
    pub(crate) fn refuse(&mut self, number: u16) {
        self.refused_channels.insert(number);
    }

    /// Adds the definitions in another part of the same file.
    pub(crate) fn merge(&mut self, other: Self) {
        self.redefined += other.redefined;
        self.refused_schemas.extend(other.refused_schemas);
        self.refused_channels.extend(other.refused_channels);
        for (id, schema) in other.schemas {
            match self.schemas.get(&id) {
                Some(known) => self.redefined += usize::from(*known != schema),
                None if !fits(&mut self.size, schema.size()) => _ = self.refused_schemas.insert(id),
                None => _ = self.schemas.insert(id, schema),
            }
        }
        for (id, channel) in other.channels {
            match self.channels.get(&id) {
                Some(known) => self.redefined += usize::from(*known != channel),
                None if !fits(&mut self.size, channel.size()) => _ = self.refused_channels.insert(id),
                None => _ = self.channels.insert(id, channel),
            }
        }
    }

    /// Removes the channels with the greatest numbers if the descriptions of all are too large together, and those
    /// without the schema that was too large. Returns the number of all that are left out.
    pub(crate) fn limit(&mut self) -> usize {
        let (mut refused, mut left) = (std::mem::take(&mut self.refused_channels), MOST_BYTES);
        refused.retain(|number| !self.channels.contains_key(number));
        let (before, schemas, refused_schemas) = (self.channels.len(), &self.schemas, &self.refused_schemas);
        self.channels.retain(|_, channel| {
            let schema = schemas.get(&channel.schema);
            if schema.is_none() && refused_schemas.contains(&channel.schema) {
                return false;
            }
            left = left.saturating_sub(schema.map_or(0, SchemaRecord::size) + channel.size());
            left > 0
        });
        refused.len() + before - self.channels.len()
    }

    /// Describes ROS 1 channels as ROS 2 ones. Their messages are yet to be converted, by [`Self::ros1`]. A channel whose
    /// definition cannot be used is unchanged.
    pub(crate) fn convert_ros1(&mut self) {
        let (mut recoders, mut by_text) = (BTreeMap::new(), HashMap::new());
        for (id, schema) in self.schemas.iter_mut().filter(|(_, schema)| schema.encoding == ros1::DEFINITION) {
            // Connections of one type have one text, and a schema each.
            let converted = by_text
                .entry((schema.name.clone(), schema.text.clone()))
                .or_insert_with_key(|(name, text)| Converted::of(name, &String::from_utf8_lossy(text)));
            if let Some(Converted { type_name, definition, recoder }) = converted {
                let (name, text) = (type_name.clone(), definition.clone().into_bytes());
                *schema = SchemaRecord { name, encoding: "ros2msg".to_owned(), text };
                recoders.insert(*id, Arc::clone(recoder));
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

/// Takes the size of a definition from the room that is left, unless it does not fit.
fn fits(taken: &mut usize, size: usize) -> bool {
    let fits = size <= MOST_BYTES - *taken;
    *taken += if fits { size } else { 0 };
    fits
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_descriptions_of_all_channels_are_limited_together() {
        let mut definitions = Definitions::default();
        definitions
            .schemas
            .insert(1, SchemaRecord { name: "a/A".into(), encoding: "ros2msg".into(), text: vec![b' '; 1 << 20] });
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

    fn block(bytes: &[u8]) -> Vec<u8> {
        [&(bytes.len() as u32).to_le_bytes(), bytes].concat()
    }

    fn read(definitions: &mut Definitions, opcode: u8, body: &[u8]) {
        definitions.read(&Record { opcode, position: 0, length: body.len(), body });
    }

    fn schema_record(number: u16, text: &[u8]) -> Vec<u8> {
        [&number.to_le_bytes()[..], &block(b"a/A"), &block(b"ros2msg"), &block(text)].concat()
    }

    fn channel_record(number: u16, schema: u16, topic: &[u8], pairs: &[u8]) -> Vec<u8> {
        let numbers = [number.to_le_bytes(), schema.to_le_bytes()].concat();
        [&numbers[..], &block(topic), &block(b"cdr"), &block(pairs)].concat()
    }

    #[test]
    fn definitions_that_are_too_large_are_refused_as_they_are_read_and_their_channels_counted() {
        let mut definitions = Definitions::default();
        let text = vec![b'#'; 20 << 20];
        for number in 1..=10 {
            read(&mut definitions, op::SCHEMA, &schema_record(number, &text));
            read(&mut definitions, op::CHANNEL, &channel_record(number, number, b"/a", b""));
        }
        assert_eq!(definitions.schemas.len(), 3);
        let mut part = Definitions::default();
        for number in 11..=20 {
            read(&mut part, op::CHANNEL, &channel_record(number, 0, &text, b""));
        }
        assert_eq!(part.channels.len(), 3);
        definitions.merge(part);
        assert!(definitions.size <= MOST_BYTES);
        let channel = Channel { topic: "/b".into(), schema: text, ..Default::default() };
        definitions.insert(21, channel);
        assert_eq!((definitions.limit(), definitions.channel_count()), (7 + 10 + 1, 3));
        assert!(definitions.size <= MOST_BYTES);
    }

    #[test]
    fn the_entries_of_the_metadata_count_with_what_they_take_in_memory() {
        let pairs: Vec<u8> =
            (0..1_000_000_u32).flat_map(|key| [block(&key.to_le_bytes()), block(b"")].concat()).collect();
        let mut definitions = Definitions::default();
        read(&mut definitions, op::CHANNEL, &channel_record(1, 0, b"/a", &pairs));
        assert_eq!((definitions.limit(), definitions.channel_count()), (1, 0));
    }

    #[test]
    fn connections_of_one_type_share_its_converter() {
        let mut definitions = Definitions::default();
        for number in 1..=2 {
            let channel = Channel {
                topic: format!("/a{number}"),
                message_encoding: ros1::MESSAGES.into(),
                schema_name: "a/A".into(),
                schema_encoding: ros1::DEFINITION.into(),
                schema: b"int8 x".to_vec(),
                ..Default::default()
            };
            definitions.insert(number, channel);
        }
        definitions.convert_ros1();
        assert!(Arc::ptr_eq(&definitions.ros1[&1], &definitions.ros1[&2]));
    }

    #[test]
    fn a_channel_with_its_entries_in_another_order_is_the_same() {
        let [one, other] =
            [["a", "b"], ["b", "a"]].map(|keys| keys.map(|key| [block(key.as_bytes()), block(b"1")].concat()).concat());
        let mut definitions = Definitions::default();
        for (pairs, redefined) in [(&one[..], 0), (&other, 0), (b"", 1)] {
            read(&mut definitions, op::CHANNEL, &channel_record(1, 0, b"/a", pairs));
            assert_eq!(definitions.redefined, redefined);
        }
    }
}
