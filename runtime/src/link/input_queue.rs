//! What has come in on one wire and is not handled yet.

use crate::message::{LogTime, Message, MessageFlags};
use std::collections::VecDeque;

/// The messages of one wire that wait for their turn, and what is known of those to come.
#[derive(Debug, Default)]
pub struct InputQueue {
    messages: VecDeque<Message>,
    bound: LogTime,
    ended: bool,
    sent_at: u64,
}

impl InputQueue {
    /// Takes what has come in: a message to be handled, a watermark, or the end of the stream.
    pub fn push(&mut self, message: Message) {
        let header = message.header();
        let flags = header.flags;
        self.raise(header.log_time);
        if flags.contains(MessageFlags::END) {
            self.ended = true;
        } else if !flags.contains(MessageFlags::WATERMARK) {
            self.messages.push_back(message);
        }
    }

    /// Notes that nothing before `watermark` will follow.
    pub fn raise(&mut self, watermark: LogTime) {
        self.bound = self.bound.max(watermark);
    }

    /// Notes that nothing will follow, and that the stream had come to this log time.
    pub fn end(&mut self, time: LogTime) {
        self.raise(time);
        self.ended = true;
    }

    /// Notes when the messages that wait were sent, nanoseconds on the monotonic clock. Those of a live link wait one at a
    /// time.
    pub(crate) fn note_sent_at(&mut self, sent_at: u64) {
        self.sent_at = sent_at;
    }

    /// When the messages that wait were sent.
    pub(crate) fn sent_at(&self) -> u64 {
        self.sent_at
    }

    /// The log time to which the stream has come: no message that is still to come lies before it.
    pub fn bound(&self) -> LogTime {
        self.bound
    }

    /// Takes over all that has come in on `other`.
    pub fn append(&mut self, other: &mut InputQueue) {
        self.messages.append(&mut other.messages);
        self.bound = self.bound.max(other.bound);
        self.ended |= other.ended;
    }

    /// The next message.
    pub fn head(&self) -> Option<&Message> {
        self.messages.front()
    }

    /// Takes the next message out.
    pub fn pop(&mut self) -> Option<Message> {
        self.messages.pop_front()
    }

    /// The number of messages that wait.
    pub fn len(&self) -> usize {
        self.messages.len()
    }

    /// Whether no message waits.
    pub fn is_empty(&self) -> bool {
        self.messages.is_empty()
    }

    /// Whether none will come.
    pub(crate) fn has_ended(&self) -> bool {
        self.ended
    }

    /// Whether no message waits and none will come.
    pub fn is_done(&self) -> bool {
        self.ended && self.messages.is_empty()
    }

    /// The earliest log time that the next message can have; `None` if none will come.
    pub fn earliest(&self) -> Option<LogTime> {
        match self.head() {
            Some(message) => Some(message.header().log_time),
            None if self.ended => None,
            None => Some(self.bound),
        }
    }

    /// Whether all messages that wait have the same log time.
    pub fn is_one_moment(&self) -> bool {
        let time = |message: &Message| message.header().log_time;
        self.messages.front().map(time) == self.messages.back().map(time)
    }
}
