//! A channel of the logs, and how its messages are sent.

use super::latched::Latch;
use crate::robots::Role;
use crate::robots::TagReader;
use gridweave_runtime::message::{Channel, LogTime, MessageHeader};
use gridweave_runtime::stage::{Out, StageError};

/// The metadata of a message.
#[derive(Clone, Copy)]
pub(super) struct Stamp {
    pub(super) sequence: u32,
    pub(super) publish_time: u64,
}

/// The route of a channel's messages. Equal channels of several files share one route.
pub(super) struct Route {
    pub(super) channel: Channel,
    pub(super) role: Role,
    pub(super) robot: String,
    /// Reads the tags in the messages.
    pub(super) tag_reader: Option<TagReader>,
    /// The fields that the headers of all the channel's messages share.
    pub(super) header: MessageHeader,
    pub(super) latch: Latch,
    pub(super) announced: bool,
    pub(super) messages: u64,
    /// The number of messages that contain no pose although their type has one.
    pub(super) unreadable: u64,
}

impl Route {
    /// Sends a message of this channel, after announcing the channel if it is the first.
    pub(super) fn send<T>(
        &mut self,
        stamp: Stamp,
        data: &[u8],
        out: &Out<T>,
        log_time: LogTime,
    ) -> Result<(), StageError> {
        if !self.announced {
            self.announced = true;
            out.announce(self.header.channel, &self.channel)?;
        }
        self.messages += 1;
        let Stamp { sequence: log_sequence, publish_time } = stamp;
        out.send_encoded(MessageHeader { log_time, publish_time, log_sequence, ..self.header }, data)
    }
}
