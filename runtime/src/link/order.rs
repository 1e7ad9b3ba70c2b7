//! The order in which a stage takes its inputs.
//!
//! In a replay messages are ordered by log time, then by wire, then as sent. The order depends on the messages only, so
//! it is the same on every engine. In a live run messages are ordered by the time at which they were sent.

use super::InputQueue;
use crate::message::LogTime;
use crate::pipeline::Mode;

/// The criterion for the next message of a stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Order {
    /// The least log time, once no earlier message can follow.
    #[default]
    LogTime,
    /// The earliest sending time among the pending messages.
    Arrival,
}

impl From<Mode> for Order {
    fn from(mode: Mode) -> Self {
        match mode {
            Mode::Replay => Self::LogTime,
            Mode::Live => Self::Arrival,
        }
    }
}

impl Order {
    /// The wire whose head is the next message of the stage, if that is decided.
    pub fn next(self, queues: &[InputQueue]) -> Option<usize> {
        match self {
            Self::LogTime => next_input(queues),
            Self::Arrival => next_sent(queues),
        }
    }
}

/// The wire whose head was sent first.
fn next_sent(queues: &[InputQueue]) -> Option<usize> {
    let waiting = queues.iter().enumerate().filter(|(_, queue)| !queue.is_empty());
    waiting.min_by_key(|(wire, queue)| (queue.sent_at(), *wire)).map(|(wire, _)| wire)
}

/// The wire whose head is the next message of the stage in a replay, if that is decided.
///
/// It is the least by (log time, wire), and only once no other wire can deliver an earlier message.
pub fn next_input(queues: &[InputQueue]) -> Option<usize> {
    let mut least: Option<(LogTime, usize, bool)> = None;
    for (wire, queue) in queues.iter().enumerate() {
        let Some(time) = queue.earliest() else { continue };
        if least.is_none_or(|(least_time, _, _)| time < least_time) {
            least = Some((time, wire, !queue.is_empty()));
        }
    }
    // If the least wire is empty, a message that precedes all others may still arrive on it.
    least.and_then(|(_, wire, has_message)| has_message.then_some(wire))
}

/// The earliest log time that any later input can have; `None` if all inputs have ended.
pub fn lower_bound(queues: &[InputQueue]) -> Option<LogTime> {
    queues.iter().filter_map(InputQueue::earliest).min()
}

/// The latest log time that any input has reached. Once all have ended, it is the same on every engine.
pub fn latest(queues: &[InputQueue]) -> LogTime {
    queues.iter().map(InputQueue::bound).max().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::{Message, MessageFlags, MessageHeader};

    fn message(time: u64) -> Message {
        let header = MessageHeader { log_time: LogTime(time), flags: MessageFlags::DATA, ..Default::default() };
        Message::from_vec(header, Vec::new())
    }

    fn queue(times: &[u64]) -> InputQueue {
        let mut queue = InputQueue::default();
        times.iter().for_each(|&time| queue.push(message(time)));
        queue
    }

    #[test]
    fn the_earliest_message_is_next_and_the_lower_wire_at_equal_times() {
        assert_eq!(next_input(&[queue(&[5]), queue(&[4])]), Some(1));
        assert_eq!(next_input(&[queue(&[4]), queue(&[4])]), Some(0));
    }

    #[test]
    fn a_silent_wire_holds_back_later_messages() {
        assert_eq!(next_input(&[queue(&[5]), queue(&[])]), None);
        let mut silent = queue(&[]);
        silent.raise(LogTime(5));
        assert_eq!(next_input(&[queue(&[5]), silent]), Some(0), "at equal times the lower wire comes first");
        let mut silent = queue(&[]);
        silent.raise(LogTime(5));
        assert_eq!(next_input(&[silent, queue(&[5])]), None, "the lower wire may still bring a message of time 5");
        let mut silent = queue(&[]);
        silent.raise(LogTime(6));
        assert_eq!(next_input(&[silent, queue(&[5])]), Some(1));
    }

    #[test]
    fn in_a_live_run_the_head_that_was_sent_first_is_next() {
        let sent = |time: u64, sent_at: u64| {
            let mut queue = queue(&[time]);
            queue.set_sent_at(sent_at);
            queue
        };
        assert_eq!(Order::Arrival.next(&[queue(&[]), sent(1, 8), sent(2, 7)]), Some(2));
        assert_eq!(
            Order::Arrival.next(&[sent(1, 7), sent(0, 7)]),
            Some(0),
            "at equal times the lower wire comes first"
        );
        assert_eq!(Order::Arrival.next(&[queue(&[])]), None);
    }

    #[test]
    fn an_ended_wire_holds_nothing_back() {
        let mut ended = queue(&[]);
        ended.end(LogTime(1));
        assert_eq!(next_input(&[ended, queue(&[5])]), Some(1));
        let mut ended = queue(&[]);
        ended.end(LogTime(1));
        assert_eq!(lower_bound(&[ended]), None);
    }
}
