//! The order in which a stage gets its inputs: by log time, then by wire, then as sent.
//!
//! It depends on the messages only, so every engine comes to the same order.

use super::InputQueue;
use crate::message::LogTime;

/// The wire whose head is the next message of the stage, if that can be told yet.
///
/// It is the least by (log time, wire), and it is taken only when no other wire can still bring something before it.
pub fn next_input(queues: &[InputQueue]) -> Option<usize> {
    let mut least: Option<(LogTime, usize, bool)> = None;
    for (wire, queue) in queues.iter().enumerate() {
        let Some(time) = queue.earliest() else { continue };
        if least.is_none_or(|(least_time, _, _)| time < least_time) {
            least = Some((time, wire, !queue.is_empty()));
        }
    }
    // The least wire may be one that is empty: then something may still come on it, at this time and before the rest.
    least.and_then(|(_, wire, is_there)| is_there.then_some(wire))
}

/// The earliest log time that any later input can have; `None` if all inputs have ended.
pub fn lower_bound(queues: &[InputQueue]) -> Option<LogTime> {
    queues.iter().filter_map(InputQueue::earliest).min()
}

/// The log time to which all inputs together have come. Once they have ended, it is the same on every engine.
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
    fn the_earliest_message_comes_first_and_the_lower_wire_at_equal_times() {
        assert_eq!(next_input(&[queue(&[5]), queue(&[4])]), Some(1));
        assert_eq!(next_input(&[queue(&[4]), queue(&[4])]), Some(0));
    }

    #[test]
    fn a_silent_wire_holds_back_what_it_could_come_before() {
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
    fn an_ended_wire_holds_back_nothing() {
        let mut ended = queue(&[]);
        ended.end(LogTime(1));
        assert_eq!(next_input(&[ended, queue(&[5])]), Some(1));
        let mut ended = queue(&[]);
        ended.end(LogTime(1));
        assert_eq!(lower_bound(&[ended]), None);
    }
}
