//! What has been sent to a viewer and not been taken by it.

use foxglove::ChannelId;
use std::collections::VecDeque;

/// How much may wait for one viewer, and for all together, bytes. What is larger is sent where nothing waits.
const MOST_FOR_ONE: usize = 32 << 20;
const MOST_FOR_ALL: usize = 256 << 20;
/// What a message takes beside its bytes.
const OVERHEAD: usize = 256;

/// The messages that wait for a viewer, oldest first.
///
/// The server drops some without a word: the oldest, where there are too many, and those of a topic that the viewer has left.
/// They are kept here until a later message is taken, so never less is counted than waits.
#[derive(Default)]
pub(super) struct Waiting {
    sent: VecDeque<Sent>,
    bytes: usize,
}

struct Sent {
    channel: ChannelId,
    log_time: u64,
    length: usize,
}

impl Waiting {
    /// How much waits, bytes.
    pub(super) fn bytes(&self) -> usize {
        self.bytes
    }

    /// Whether a message may be sent while `all` bytes wait for all viewers together.
    pub(super) fn has_room(&self, length: usize, all: usize) -> bool {
        let fits = |waiting: usize, most: usize| waiting == 0 || waiting + length + OVERHEAD <= most;
        fits(self.bytes, MOST_FOR_ONE) && fits(all, MOST_FOR_ALL)
    }

    /// Whether a message of a channel waits.
    pub(super) fn has(&self, channel: ChannelId) -> bool {
        self.sent.iter().any(|sent| sent.channel == channel)
    }

    /// A message has been sent.
    pub(super) fn add(&mut self, channel: ChannelId, log_time: u64, length: usize) {
        self.sent.push_back(Sent { channel, log_time, length });
        self.bytes += length + OVERHEAD;
    }

    /// The viewer has taken a message, and so all before it.
    pub(super) fn take(&mut self, log_time: u64, length: usize) {
        let taken = self.sent.iter().position(|sent| sent.length == length && sent.log_time == log_time);
        for sent in self.sent.drain(..taken.map_or(0, |place| place + 1)) {
            self.bytes -= sent.length + OVERHEAD;
        }
    }

    /// The viewer has taken all.
    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_is_room_up_to_the_limits_and_for_anything_where_nothing_waits() {
        let channel = ChannelId::new(1);
        let mut waiting = Waiting::default();
        assert!(waiting.has_room(10 * MOST_FOR_ALL, 0));
        assert!(!waiting.has_room(1000, MOST_FOR_ALL), "of others");
        waiting.add(channel, 5, MOST_FOR_ONE - 1000);
        assert!(waiting.has_room(1000 - 2 * OVERHEAD, waiting.bytes()));
        assert!(!waiting.has_room(1001 - 2 * OVERHEAD, waiting.bytes()));
        assert!(waiting.has(channel));
        waiting.take(5, MOST_FOR_ONE - 1000);
        assert_eq!((waiting.bytes(), waiting.has(channel)), (0, false));
    }

    #[test]
    fn messages_that_the_server_has_dropped_wait_no_longer_than_the_next() {
        let mut waiting = Waiting::default();
        for log_time in 0..100 {
            waiting.add(ChannelId::new(1), log_time, 7);
        }
        waiting.take(3, 8);
        assert_eq!(waiting.bytes(), 100 * (7 + OVERHEAD), "what was not sent is not taken");
        waiting.take(97, 7);
        assert_eq!(waiting.bytes(), 2 * (7 + OVERHEAD));
        waiting.clear();
        assert_eq!(waiting.bytes(), 0);
    }

    #[test]
    fn empty_messages_take_room() {
        let mut waiting = Waiting::default();
        let sent = (0..).take_while(|&log_time| {
            let has_room = waiting.has_room(0, 0);
            waiting.add(ChannelId::new(1), log_time, 0);
            has_room
        });
        assert!(sent.count() <= MOST_FOR_ONE / OVERHEAD);
    }
}
