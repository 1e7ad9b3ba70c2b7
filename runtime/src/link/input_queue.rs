//! The pending messages of one wire.

use crate::message::{LogTime, Message, MessageFlags, MessageHeader};
use std::collections::VecDeque;

/// The pending messages of one wire, and a lower bound for the log times of those that follow.
#[derive(Debug, Default)]
pub struct InputQueue {
    messages: VecDeque<Message>,
    /// The memory of the pending messages, bytes.
    bytes: usize,
    bound: LogTime,
    ended: bool,
    sent_at: u64,
}

impl InputQueue {
    /// Adds what was received: a message to be handled, a watermark, or the end of the stream.
    pub fn push(&mut self, message: Message) {
        let header = message.header();
        let flags = header.flags;
        self.raise(header.log_time);
        if flags.contains(MessageFlags::END) {
            self.ended = true;
        } else if !flags.contains(MessageFlags::WATERMARK) {
            self.bytes += memory_of(&message);
            self.messages.push_back(message);
        }
    }

    /// Raises the watermark: no message before it will follow.
    pub fn raise(&mut self, watermark: LogTime) {
        self.bound = self.bound.max(watermark);
    }

    /// Ends the stream at the given log time.
    pub fn end(&mut self, time: LogTime) {
        self.raise(time);
        self.ended = true;
    }

    /// Sets when the pending messages were sent, nanoseconds on the monotonic clock. A live link has one pending sample
    /// at a time.
    pub(crate) fn set_sent_at(&mut self, sent_at: u64) {
        self.sent_at = sent_at;
    }

    /// When the pending messages were sent, nanoseconds on the monotonic clock.
    pub(crate) fn sent_at(&self) -> u64 {
        self.sent_at
    }

    /// The watermark of the stream: no message before this log time will follow.
    pub fn bound(&self) -> LogTime {
        self.bound
    }

    /// Moves everything from `other` to the end of this queue.
    pub fn append(&mut self, other: &mut InputQueue) {
        self.messages.append(&mut other.messages);
        self.bytes += std::mem::take(&mut other.bytes);
        self.bound = self.bound.max(other.bound);
        self.ended |= other.ended;
    }

    /// The next message.
    pub fn head(&self) -> Option<&Message> {
        self.messages.front()
    }

    /// Removes the next message.
    pub fn pop(&mut self) -> Option<Message> {
        let message = self.messages.pop_front()?;
        self.bytes -= memory_of(&message);
        Some(message)
    }

    /// The number of pending messages.
    pub fn len(&self) -> usize {
        self.messages.len()
    }

    /// The memory of the pending messages, bytes: of an empty message, too.
    pub(crate) fn bytes(&self) -> usize {
        self.bytes
    }

    /// Whether no message is pending.
    pub fn is_empty(&self) -> bool {
        self.messages.is_empty()
    }

    /// Whether the stream has ended. Messages may still be pending.
    pub(crate) fn has_ended(&self) -> bool {
        self.ended
    }

    /// Whether the stream has ended and no message is pending.
    pub fn is_done(&self) -> bool {
        self.ended && self.messages.is_empty()
    }

    /// The earliest log time that the next message can have; `None` if none will follow.
    pub fn earliest(&self) -> Option<LogTime> {
        match self.head() {
            Some(message) => Some(message.header().log_time),
            None if self.ended => None,
            None => Some(self.bound),
        }
    }

    /// Whether all pending messages have the same log time.
    pub fn has_single_log_time(&self) -> bool {
        let time = |message: &Message| message.header().log_time;
        self.messages.front().map(time) == self.messages.back().map(time)
    }
}

/// The memory that a message takes: here, and in its sample.
fn memory_of(message: &Message) -> usize {
    size_of::<Message>() + MessageHeader::SIZE + message.bytes().len()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(flags: MessageFlags, length: usize) -> Message {
        Message::from_vec(MessageHeader { flags, ..Default::default() }, vec![0; length])
    }

    #[test]
    fn an_empty_message_counts_and_a_message_that_was_taken_does_not() {
        let mut queue = InputQueue::default();
        for length in [0, 1000] {
            queue.push(message(MessageFlags::DATA, length));
        }
        queue.push(message(MessageFlags::WATERMARK, 0));
        let bookkeeping = queue.bytes() - 1000;
        assert!(bookkeeping >= 2 * (size_of::<Message>() + MessageHeader::SIZE), "{bookkeeping}");
        let mut other = InputQueue::default();
        other.append(&mut queue);
        assert_eq!((queue.bytes(), other.bytes()), (0, bookkeeping + 1000));
        while other.pop().is_some() {}
        assert_eq!(other.bytes(), 0);
    }
}
