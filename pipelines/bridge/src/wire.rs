//! The messages between the two ends of a bridge: the version of the protocol, followed by CDR, compressed with
//! Zstandard.

use super::difference;
use gridweave_runtime::message::{FixedText, LogTime, MessageHeader};
use gridweave_runtime::ros::{decode, encode};
use serde::de::{DeserializeOwned, Error as _, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use std::fmt;
use std::io::Read as _;
use std::marker::PhantomData;
use zstd::stream::read::Decoder;

/// The version of the protocol. Ends of different versions report an error, and transport nothing.
pub(super) const VERSION: u32 = 1;

/// A batch of a sender, which the receiver takes as a whole or not at all.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Batch {
    /// The name of the sender.
    pub(super) sender: String,
    /// The session of the sender, which distinguishes it from earlier ones of the same name.
    pub(super) session: u64,
    /// The number of the sender's last handshake.
    pub(super) handshake: u64,
    /// The number of the batch: 0 for a handshake, the others are counted from 1.
    pub(super) number: u64,
    /// The number of the receiver; 0 in a handshake.
    pub(super) receiver: u64,
    /// The clock offset of the receiver, nanoseconds.
    pub(super) clock_offset: i64,
    /// The number of all messages that the sender has dropped.
    pub(super) dropped: u64,
    /// Whether this is the end of the stream.
    pub(super) is_end: bool,
    /// The links of the sender, in a handshake.
    #[serde(deserialize_with = "limited")]
    pub(super) links: Vec<Link>,
    /// The messages and channels.
    #[serde(deserialize_with = "limited")]
    pub(super) entries: Vec<Entry>,
}

/// The maximum number of links, and of entries, of a batch. Each takes more memory than bytes in a batch.
const MAX_ELEMENTS: usize = 1 << 16;

/// Deserialises a sequence of at most [`MAX_ELEMENTS`].
fn limited<'de, D: Deserializer<'de>, T: Deserialize<'de>>(deserializer: D) -> Result<Vec<T>, D::Error> {
    struct Limited<T>(PhantomData<T>);

    impl<'de, T: Deserialize<'de>> Visitor<'de> for Limited<T> {
        type Value = Vec<T>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            write!(f, "a sequence of at most {MAX_ELEMENTS} elements")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<Vec<T>, A::Error> {
            let mut elements = Vec::new();
            while let Some(element) = sequence.next_element()? {
                if elements.len() == MAX_ELEMENTS {
                    return Err(A::Error::custom(format!("it has more than {MAX_ELEMENTS} elements")));
                }
                elements.push(element);
            }
            Ok(elements)
        }
    }

    deserializer.deserialize_seq(Limited(PhantomData))
}

/// The first fields of a [`Batch`].
#[derive(Deserialize)]
struct Head {
    #[allow(dead_code, reason = "it is before the session")]
    sender: String,
    session: u64,
}

/// The size of the restored beginning of a batch that holds its [`Head`], bytes: the name of a sender has at most 100.
const HEAD_SIZE: u64 = 256;

/// The session of the sender of an encoded [`Batch`], if it can be read. Only the first bytes are restored, so it takes
/// little time and memory, whatever the rest expands to.
pub(super) fn session_of(bytes: &[u8]) -> Option<u64> {
    let (version, packed) = bytes.split_first_chunk::<4>()?;
    if u32::from_le_bytes(*version) != VERSION {
        return None;
    }
    let mut decoder = Decoder::with_buffer(packed).ok()?;
    decoder.window_log_max(difference::LARGEST_WINDOW).ok()?;
    let mut plain = Vec::new();
    decoder.take(HEAD_SIZE).read_to_end(&mut plain).ok()?;
    decode::<Head>(&plain).ok().map(|head| head.session)
}

/// A link of a bridge.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Link {
    /// The name of the output.
    pub(super) port: String,
    /// The ROS 2 type of its messages; empty for any.
    pub(super) ros_type: String,
}

/// A message, or the announcement of a channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Entry {
    /// The index of the link in the handshake.
    pub(super) link: u32,
    pub(super) form: Form,
    pub(super) channel: u32,
    pub(super) log_sequence: u32,
    pub(super) log_time: u64,
    pub(super) publish_time: u64,
    pub(super) robot: String,
    pub(super) topic: String,
    #[serde(with = "serde_bytes")]
    pub(super) bytes: Vec<u8>,
}

impl Entry {
    /// The entry of a message or a channel of a link, with the given bytes.
    pub(super) fn new(link: u32, header: &MessageHeader, form: Form, bytes: Vec<u8>) -> Self {
        Self {
            link,
            form,
            channel: header.channel,
            log_sequence: header.log_sequence,
            log_time: header.log_time.0,
            publish_time: header.publish_time,
            robot: header.robot.as_str().to_owned(),
            topic: header.topic.as_str().to_owned(),
            bytes,
        }
    }

    /// The header of the message.
    ///
    /// # Errors
    /// A name in it is too long.
    pub(super) fn header(&self) -> Result<MessageHeader, String> {
        Ok(MessageHeader {
            log_time: LogTime(self.log_time),
            publish_time: self.publish_time,
            channel: self.channel,
            log_sequence: self.log_sequence,
            robot: FixedText::new(&self.robot).map_err(|error| error.to_string())?,
            topic: FixedText::new(&self.topic).map_err(|error| error.to_string())?,
            ..Default::default()
        })
    }
}

/// The encoding of an entry's bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Form {
    /// A message.
    Whole,
    /// The difference of a message to the previous one of its link and topic.
    Difference,
    /// A compressed message, to which the next difference of its link and topic refers.
    Beginning,
    /// A channel.
    Channel,
}

/// The answer of a receiver.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Answer {
    /// The number of the receiver, another one after each start.
    pub(super) receiver: u64,
    /// The number of the batch.
    pub(super) number: u64,
    /// The outcome of the batch.
    pub(super) outcome: Outcome,
    /// When the batch was received, nanoseconds by the clock of the receiver.
    pub(super) came: i64,
    /// When the answer was sent, nanoseconds by the clock of the receiver.
    pub(super) answered: i64,
    /// The error, for people.
    pub(super) text: String,
}

/// The outcome of a batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Outcome {
    /// It was taken, at this time or before.
    Taken,
    /// The receiver misses the state that the batch depends on: the sender must restart.
    Unknown,
    /// It cannot be read.
    Unreadable,
}

/// Encodes a message between the ends.
pub(super) fn to_bytes<T: Serialize>(content: &T) -> Result<Vec<u8>, String> {
    let plain = encode(content).map_err(|error| error.to_string())?;
    let packed = difference::difference(&[], &plain).map_err(|error| error.to_string())?;
    Ok([VERSION.to_le_bytes().as_slice(), &packed].concat())
}

/// Decodes the bytes of [`to_bytes`].
///
/// # Errors
/// They are of another version, or invalid.
pub(super) fn from_bytes<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, String> {
    let (version, packed) = bytes.split_first_chunk::<4>().ok_or_else(|| "it is truncated".to_owned())?;
    let version = u32::from_le_bytes(*version);
    if version != VERSION {
        return Err(format!("it has version {version} of the bridge protocol, and this end has version {VERSION}"));
    }
    let plain = difference::message(&[], packed, difference::MAX_SIZE).map_err(|error| error.to_string())?;
    decode(&plain).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_session_of_a_batch_is_read_from_its_first_bytes() {
        let sender = "r".repeat(100);
        let entry = Entry::new(0, &MessageHeader::default(), Form::Whole, vec![7; 3 << 20]);
        let batch = Batch { sender, session: 0x1234_5678_9abc, entries: vec![entry], ..Batch::default() };
        let bytes = to_bytes(&batch).unwrap();
        assert_eq!(session_of(&bytes), Some(batch.session));
        assert_eq!(session_of(&to_bytes(&Batch { session: 3, ..Batch::default() }).unwrap()), Some(3));
        for unreadable in [&b""[..], b"abc", b"\x01\0\0\0 and so on", &bytes[..20]] {
            assert_eq!(session_of(unreadable), None);
        }
        let other_version = [&[9, 0, 0, 0], &bytes[4..]].concat();
        assert_eq!(session_of(&other_version), None);
    }

    #[test]
    fn an_answer_is_decoded_and_truncated_or_other_bytes_are_errors() {
        let answer = Answer {
            receiver: 3,
            number: 4,
            outcome: Outcome::Taken,
            came: -5,
            answered: 6,
            text: "all is well".to_owned(),
        };
        let bytes = to_bytes(&answer).unwrap();
        assert_eq!(from_bytes::<Answer>(&bytes), Ok(answer));
        for cut in 0..bytes.len() {
            assert!(from_bytes::<Answer>(&bytes[..cut]).is_err());
        }
        let mut other = bytes;
        other[0] = 200;
        let error = from_bytes::<Answer>(&other).unwrap_err();
        assert!(error.contains("version 200"), "{error}");
    }
}
