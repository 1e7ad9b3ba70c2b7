//! What the two ends of a bridge say to each other, in bytes: CDR, compressed with Zstandard, behind the version of the protocol.

use super::difference;
use gridweave_runtime::message::{FixedText, LogTime, MessageHeader};
use gridweave_runtime::ros::{decode, encode};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// The version of the protocol. Ends of different versions tell so, and carry nothing.
pub(super) const VERSION: u32 = 1;

/// What a sender asks a receiver to take, all of it or nothing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Batch {
    /// What to call the sender.
    pub(super) sender: String,
    /// Tells the sender apart from those of its name that were there before it.
    pub(super) session: u64,
    /// Counts how often the sender has begun anew.
    pub(super) greeting: u64,
    /// 0 is a greeting, with which a sender begins with a receiver that does not know it. The others are counted from 1.
    pub(super) number: u64,
    /// The receiver that is meant; 0 in a greeting.
    pub(super) receiver: u64,
    /// What the clock of the receiver shows more than that of the sender, nanoseconds.
    pub(super) clock_offset: i64,
    /// How many messages the sender has dropped in all, because there was no room for them.
    pub(super) dropped: u64,
    /// Whether nothing follows.
    pub(super) is_end: bool,
    /// The links that the sender carries, in a greeting.
    pub(super) links: Vec<Link>,
    /// What is carried.
    pub(super) entries: Vec<Entry>,
}

/// A link that is carried.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Link {
    /// The output that it is one of.
    pub(super) port: String,
    /// The ROS 2 type of its messages; empty for any.
    pub(super) ros_type: String,
}

/// A message, or the announcement of a channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Entry {
    /// By the greeting.
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
    /// That of a message or a channel of a link, with these bytes.
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

    /// The header that a message has.
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

/// What the bytes of an entry are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Form {
    /// A message.
    Whole,
    /// The difference of a message to the last one of its link and topic.
    Difference,
    /// The difference of a message to nothing, with which differences of its link and topic begin.
    Beginning,
    /// A channel.
    Channel,
}

/// What a receiver answers.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Answer {
    /// Who answers: another number after each start.
    pub(super) receiver: u64,
    /// The batch that this answers.
    pub(super) number: u64,
    /// What became of it.
    pub(super) outcome: Outcome,
    /// When the batch came and when this was sent, nanoseconds by the clock of the receiver.
    pub(super) came: i64,
    pub(super) answered: i64,
    /// What was wrong, for people.
    pub(super) text: String,
}

/// What became of a batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Outcome {
    /// It was taken, then or before.
    Taken,
    /// The receiver does not know what the batch builds upon: the sender is to begin anew.
    Unknown,
    /// It cannot be read.
    Unreadable,
}

/// As bytes.
pub(super) fn to_bytes<T: Serialize>(said: &T) -> Result<Vec<u8>, String> {
    let plain = encode(said).map_err(|error| error.to_string())?;
    let packed = difference::difference(&[], &plain).map_err(|error| error.to_string())?;
    Ok([VERSION.to_le_bytes().as_slice(), &packed].concat())
}

/// Reads what [`to_bytes`] wrote.
///
/// # Errors
/// They are of another version, or something else.
pub(super) fn from_bytes<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, String> {
    let (version, packed) = bytes.split_first_chunk::<4>().ok_or_else(|| "it is cut".to_owned())?;
    let version = u32::from_le_bytes(*version);
    if version != VERSION {
        return Err(format!("it is of version {version} of the bridge, and this is version {VERSION}"));
    }
    let plain = difference::message(&[], packed).map_err(|error| error.to_string())?;
    decode(&plain).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_comes_back_and_nothing_else_is_one() {
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
