//! The queue of a tapped link.

use super::super::wire::{Entry, Form};
use super::requests::Passed;
use gridweave_runtime::message::{Message, MessageFlags};
use std::collections::{BTreeMap, VecDeque};

/// The maximum size of a batch with several messages, bytes.
const BATCH_SIZE: usize = 128 * 1024;

/// The limits of the queue, which always keeps the last message. They are small: a tap is for current messages, not old
/// ones.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    pub(super) messages: usize,
    /// The size of the messages, bytes.
    pub(super) bytes: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self { messages: 1000, bytes: 8 << 20 }
    }
}

/// The pending messages of a tapped link.
#[derive(Debug, Default)]
pub(super) struct MessageQueue {
    limits: Limits,
    entries: VecDeque<Passed>,
    messages: usize,
    bytes: usize,
    /// The announced channels, by number.
    channels: BTreeMap<u32, Vec<u8>>,
    dropped: u64,
}

impl MessageQueue {
    pub(super) fn new(limits: Limits) -> Self {
        Self { limits, ..Self::default() }
    }

    /// The number of dropped messages.
    pub(super) fn dropped(&self) -> u64 {
        self.dropped
    }

    pub(super) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Adds a message. Announcements are never dropped: each channel has one.
    pub(super) fn push(&mut self, message: &Message) {
        let header = message.header();
        let form = match header.flags.contains(MessageFlags::CHANNEL) {
            true => Form::Channel,
            false => Form::Whole,
        };
        let bytes = message.bytes().to_vec();
        match form {
            Form::Channel => {
                if self.channels.get(&header.channel) == Some(&bytes) {
                    return;
                }
                self.channels.insert(header.channel, bytes.clone());
            }
            _ => {
                while self.messages > 0
                    && (self.messages >= self.limits.messages || self.bytes + bytes.len() > self.limits.bytes)
                {
                    self.drop_oldest();
                }
                self.messages += 1;
                self.bytes += bytes.len();
            }
        }
        self.entries.push_back(Passed { sequence: header.sequence, entry: Entry::new(0, header, form, bytes) });
    }

    fn drop_oldest(&mut self) {
        let oldest = self.entries.iter().position(|passed| passed.entry.form != Form::Channel);
        if let Some(dropped) = oldest.and_then(|oldest| self.entries.remove(oldest)) {
            self.note_gone(&dropped);
            self.dropped += 1;
        }
    }

    fn note_gone(&mut self, gone: &Passed) {
        if gone.entry.form != Form::Channel {
            self.messages -= 1;
            self.bytes -= gone.entry.bytes.len();
        }
    }

    /// Removes the next batch: the first message, and further ones that fit.
    pub(super) fn batch(&mut self) -> Vec<Passed> {
        let (mut batch, mut size) = (Vec::new(), 0);
        while let Some(next) = self.entries.front()
            && (batch.is_empty() || size + next.entry.bytes.len() <= BATCH_SIZE)
            && let Some(next) = self.entries.pop_front()
        {
            self.note_gone(&next);
            size += next.entry.bytes.len();
            batch.push(next);
        }
        batch
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::message::MessageHeader;

    fn message(sequence: u64, flags: MessageFlags, channel: u32, size: usize) -> Message {
        Message::from_vec(MessageHeader { sequence, flags, channel, ..Default::default() }, vec![sequence as u8; size])
    }

    fn numbers(batch: &[Passed]) -> Vec<u64> {
        batch.iter().map(|passed| passed.sequence).collect()
    }

    #[test]
    fn messages_beyond_the_limits_are_dropped_oldest_first_except_announcements() {
        let mut waiting = MessageQueue::new(Limits { messages: 3, bytes: 100 });
        waiting.push(&message(0, MessageFlags::CHANNEL, 7, 10));
        for sequence in 1..6 {
            waiting.push(&message(sequence, MessageFlags::DATA, 7, 10));
        }
        waiting.push(&message(0, MessageFlags::CHANNEL, 7, 10));
        assert_eq!((numbers(&waiting.batch()), waiting.dropped()), (vec![0, 3, 4, 5], 2));
        // By bytes; the last stays, however large.
        for (sequence, size) in [(6, 40), (7, 40), (8, 40), (9, 500)] {
            waiting.push(&message(sequence, MessageFlags::DATA, 7, size));
        }
        assert_eq!((numbers(&waiting.batch()), waiting.dropped()), (vec![9], 5));
        assert!(waiting.is_empty() && waiting.batch().is_empty());
    }

    #[test]
    fn a_batch_is_limited_but_has_at_least_one_message() {
        let mut waiting = MessageQueue::default();
        for (sequence, size) in
            [(1, 2 * BATCH_SIZE), (2, 10), (3, BATCH_SIZE), (4, BATCH_SIZE / 2), (5, BATCH_SIZE / 2)]
        {
            waiting.push(&message(sequence, MessageFlags::DATA, 0, size));
        }
        let batches: Vec<Vec<u64>> = (0..5).map(|_| numbers(&waiting.batch())).collect();
        assert_eq!(batches, [vec![1], vec![2], vec![3], vec![4, 5], vec![]]);
        assert_eq!(waiting.dropped(), 0);
    }
}
