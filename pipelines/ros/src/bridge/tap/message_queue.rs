//! What has passed on a link and was not asked for yet.

use super::super::wire::{Entry, Form};
use super::requests::Passed;
use gridweave_runtime::message::{Message, MessageFlags};
use std::collections::{BTreeMap, VecDeque};

/// A batch takes nothing further when it has this many bytes.
const BATCH_SIZE: usize = 128 * 1024;

/// How much may wait; the last message does in any case. Not much: who taps wants to see what passes, and not what has passed long ago.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    pub(super) messages: usize,
    /// Bytes of their contents.
    pub(super) bytes: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self { messages: 1000, bytes: 8 << 20 }
    }
}

/// What waits.
#[derive(Debug, Default)]
pub(super) struct MessageQueue {
    limits: Limits,
    entries: VecDeque<Passed>,
    messages: usize,
    bytes: usize,
    /// What was announced, by number.
    channels: BTreeMap<u32, Vec<u8>>,
    dropped: u64,
}

impl MessageQueue {
    pub(super) fn new(limits: Limits) -> Self {
        Self { limits, ..Self::default() }
    }

    /// How many messages were dropped.
    pub(super) fn dropped(&self) -> u64 {
        self.dropped
    }

    pub(super) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Takes what has passed. Announcements are never dropped: each channel has one.
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

    /// Takes the next batch out: the first, and what there is room for beside it.
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
    fn what_there_is_no_room_for_is_dropped_oldest_first_but_for_announcements() {
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
    fn a_batch_is_bounded_but_holds_one_message() {
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
