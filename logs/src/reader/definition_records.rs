//! A schema and a channel of a log, and their records.

use super::record::Fields;
use std::borrow::Cow;
use std::collections::BTreeMap;

/// What an entry of a channel's metadata takes in memory beside its texts, bytes.
const ENTRY: usize = 80;

/// The definition of a message type in a file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SchemaRecord {
    pub(super) name: String,
    pub(super) encoding: String,
    pub(super) text: Vec<u8>,
}

/// A channel of a file: its topic, encoding and message type.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ChannelRecord {
    pub(super) schema: u16,
    pub(super) topic: String,
    pub(super) message_encoding: String,
    pub(super) metadata: BTreeMap<String, String>,
}

impl SchemaRecord {
    pub(super) fn size(&self) -> usize {
        self.name.len() + self.encoding.len() + self.text.len()
    }
}

impl ChannelRecord {
    pub(super) fn size(&self) -> usize {
        let pairs: usize = self.metadata.iter().map(|(key, value)| key.len() + value.len() + ENTRY).sum();
        self.topic.len() + self.message_encoding.len() + pairs
    }
}

/// A schema in a record, not copied.
pub(super) struct SchemaFields<'a> {
    pub(super) name: Cow<'a, str>,
    pub(super) encoding: Cow<'a, str>,
    pub(super) text: &'a [u8],
}

impl<'a> SchemaFields<'a> {
    pub(super) fn of(body: &'a [u8]) -> Option<Self> {
        let mut fields = Fields(body);
        fields.u16()?;
        Some(Self { name: fields.str()?, encoding: fields.str()?, text: fields.block()?.0 })
    }

    pub(super) fn size(&self) -> usize {
        self.name.len() + self.encoding.len() + self.text.len()
    }

    pub(super) fn is(&self, known: &SchemaRecord) -> bool {
        (&*self.name, &*self.encoding, self.text) == (known.name.as_str(), known.encoding.as_str(), &*known.text)
    }

    pub(super) fn to_schema(&self) -> SchemaRecord {
        SchemaRecord { name: self.name.to_string(), encoding: self.encoding.to_string(), text: self.text.to_vec() }
    }
}

/// A channel in a record, not copied.
pub(super) struct ChannelFields<'a> {
    pub(super) schema: u16,
    pub(super) topic: Cow<'a, str>,
    pub(super) message_encoding: Cow<'a, str>,
    /// The keys and values of its metadata.
    pairs: &'a [u8],
    /// The number of pairs.
    count: usize,
}

impl<'a> ChannelFields<'a> {
    pub(super) fn of(body: &'a [u8]) -> Option<Self> {
        let mut fields = Fields(body);
        fields.u16()?;
        let (schema, topic, message_encoding) = (fields.u16()?, fields.str()?, fields.str()?);
        let pairs = fields.block()?.0;
        let (mut rest, mut count) = (Fields(pairs), 0);
        while !rest.0.is_empty() {
            rest.block()?;
            rest.block()?;
            count += 1;
        }
        Some(Self { schema, topic, message_encoding, pairs, count })
    }

    pub(super) fn pairs(&self) -> impl Iterator<Item = (Cow<'a, str>, Cow<'a, str>)> {
        let mut rest = Fields(self.pairs);
        std::iter::from_fn(move || Some((rest.str()?, rest.str()?)))
    }

    /// The size in memory at most, bytes.
    pub(super) fn size(&self) -> usize {
        self.topic.len() + self.message_encoding.len() + self.pairs.len() + self.count * ENTRY
    }

    pub(super) fn is(&self, known: &ChannelRecord) -> bool {
        self.schema == known.schema
            && self.topic == known.topic
            && self.message_encoding == known.message_encoding
            && self.count == known.metadata.len()
            && self.pairs().all(|(key, value)| known.metadata.get(&*key).is_some_and(|known| *known == value))
    }

    pub(super) fn to_record(&self) -> ChannelRecord {
        ChannelRecord {
            schema: self.schema,
            topic: self.topic.to_string(),
            message_encoding: self.message_encoding.to_string(),
            metadata: self.pairs().map(|(key, value)| (key.into_owned(), value.into_owned())).collect(),
        }
    }
}
