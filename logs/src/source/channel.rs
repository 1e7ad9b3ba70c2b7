//! One channel of the logs, and how its messages are sent.

use super::carry::Latch;
use crate::robots::Role;
use crate::robots::TagReader;
use gridweave_runtime::message::{Channel, LogTime, MessageHeader};
use gridweave_runtime::stage::{Out, StageError};

/// What a message is, besides its bytes.
#[derive(Clone, Copy)]
pub(super) struct Stamp {
    pub(super) sequence: u32,
    pub(super) publish_time: u64,
}

/// What is known of one channel. Channels of several files that are the same share it.
pub(super) struct Route {
    pub(super) channel: Channel,
    pub(super) role: Role,
    pub(super) robot: String,
    /// What reads the tags in its messages.
    pub(super) tag_reader: Option<TagReader>,
    /// What all headers of the channel's messages have in common.
    pub(super) header: MessageHeader,
    pub(super) latch: Latch,
    pub(super) announced: bool,
    pub(super) messages: u64,
    /// How many of the messages hold no pose although their type has one.
    pub(super) unreadable: u64,
}

impl Route {
    /// Sends a message of this channel, which is announced before the first of them.
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
