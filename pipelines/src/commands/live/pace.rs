//! The pace of `gridweave play`: each message is sent at its time.

use super::INTERRUPT_INTERVAL;
use gridweave_logs::schemas::schema_text;
use gridweave_runtime::message::{LogTime, MessageFlags, MessageHeader, Write};
use gridweave_runtime::stage::{OutputSink, StageError};
use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// Between the last message and the first of the next repetition, nanoseconds.
const REPEAT_GAP: u64 = 100_000_000;

/// The time at which each message is sent.
pub(super) struct Pace {
    rate: f64,
    start: Option<(Instant, LogTime)>,
    /// The first and the last log time of the logs.
    span: Option<(LogTime, LogTime)>,
    /// By how much the messages of this repetition are later than in the logs, nanoseconds.
    later: u64,
    /// The first channel number, so that those of several players differ.
    first_channel: u32,
    /// Number of messages sent.
    messages: u64,
    stopped: Arc<AtomicBool>,
}

impl Pace {
    pub(super) fn new(rate: f64) -> Self {
        let first_channel = (std::process::id() & 0xf_ffff) << 12;
        Self { rate, start: None, span: None, later: 0, first_channel, messages: 0, stopped: Arc::default() }
    }

    /// The number of messages sent.
    pub(super) fn messages(&self) -> u64 {
        self.messages
    }

    /// Sends no more messages once `stopped` is set.
    pub(super) fn stop_with(&mut self, stopped: Arc<AtomicBool>) {
        self.stopped = stopped;
    }

    /// Waits until it is time for a message.
    fn wait(&mut self, log_time: LogTime) -> Result<(), StageError> {
        let (first, last) = self.span.get_or_insert((log_time, log_time));
        (*first, *last) = ((*first).min(log_time), (*last).max(log_time));
        let shifted = LogTime(log_time.0.saturating_add(self.later));
        let (start, first) = *self.start.get_or_insert((Instant::now(), shifted));
        if self.rate > 0.0 {
            let after = Duration::try_from_secs_f64(shifted.seconds_since(first).max(0.0) / self.rate);
            let at = start + after.unwrap_or(Duration::MAX / 4);
            while let Some(left) = at.checked_duration_since(Instant::now()).filter(|left| !left.is_zero()) {
                self.check()?;
                thread::sleep(left.min(INTERRUPT_INTERVAL));
            }
        }
        self.check()
    }

    fn check(&self) -> Result<(), StageError> {
        match self.stopped.load(Ordering::Relaxed) {
            true => Err(StageError::new("play on", "the player was stopped, or the run has ended")),
            false => Ok(()),
        }
    }

    /// Whether the logs are being repeated.
    pub(super) fn is_repeated(&self) -> bool {
        self.later > 0
    }

    /// Starts a repetition. Returns `false` if the logs have no duration.
    pub(super) fn begin_repetition(&mut self) -> bool {
        let Some((first, last)) = self.span.filter(|(first, last)| last > first) else { return false };
        self.later += last.0 - first.0 + REPEAT_GAP;
        true
    }
}

/// An output that sends each message at its time.
pub(super) struct Paced {
    pace: Rc<RefCell<Pace>>,
    link: Box<dyn OutputSink>,
    /// Whether its messages begin with a header, whose stamp is shifted with them. Messages on a port of any type keep
    /// theirs.
    has_stamp: bool,
}

impl Paced {
    pub(super) fn new(pace: Rc<RefCell<Pace>>, link: Box<dyn OutputSink>, has_stamp: bool) -> Self {
        Self { pace, link, has_stamp }
    }

    fn prepare(&self, header: &mut MessageHeader) -> Result<u64, StageError> {
        let mut pace = self.pace.borrow_mut();
        if header.flags.contains(MessageFlags::DATA) {
            pace.wait(header.log_time)?;
        }
        header.log_time.0 = header.log_time.0.saturating_add(pace.later);
        header.publish_time = header.publish_time.saturating_add(pace.later);
        if header.channel != 0 {
            header.channel += pace.first_channel;
        }
        Ok(pace.later)
    }

    /// Counts a message that was sent. One that waits for its readers when the player is stopped is not.
    fn count(&self, is_data: bool) {
        self.pace.borrow_mut().messages += u64::from(is_data);
    }
}

impl OutputSink for Paced {
    fn send(&mut self, mut header: MessageHeader, bytes: &[u8]) -> Result<(), StageError> {
        let is_data = header.flags.contains(MessageFlags::DATA);
        match self.prepare(&mut header)? {
            later if later > 0 && self.has_stamp && is_data => {
                let mut bytes = bytes.to_vec();
                make_later(&mut bytes, later);
                self.link.send(header, &bytes)?;
            }
            _ => self.link.send(header, bytes)?,
        }
        self.count(is_data);
        Ok(())
    }

    fn send_in_place(&mut self, mut header: MessageHeader, write: &mut Write<'_>) -> Result<(), StageError> {
        let is_data = header.flags.contains(MessageFlags::DATA);
        let (later, has_stamp) = (self.prepare(&mut header)?, self.has_stamp);
        self.link.send_in_place(header, &mut |blank| {
            let mut filled = write(blank)?;
            if has_stamp {
                make_later(&mut filled, later);
            }
            Ok(filled)
        })?;
        self.count(is_data);
        Ok(())
    }
}

/// Whether the messages of a type have a header as their first field.
pub(super) fn begins_with_header(type_name: &str) -> bool {
    let is_field = |line: &&str| !line.is_empty() && !line.starts_with('#');
    let text = schema_text(type_name).unwrap_or_default();
    text.lines().map(str::trim).find(is_field).is_some_and(|field| field.starts_with("std_msgs/Header "))
}

/// Shifts the stamp of a message with a header, so that time does not go back for the stages. In CDR, the header
/// follows the four bytes of the encapsulation and begins with the stamp (seconds, nanoseconds).
fn make_later(bytes: &mut [u8], nanoseconds: u64) {
    let Some((seconds, nanos)) = bytes.get_mut(4..12).and_then(|stamp| stamp.split_first_chunk_mut::<4>()) else {
        return;
    };
    let Ok(nanos) = <&mut [u8; 4]>::try_from(nanos) else { return };
    let stamp = i64::from(i32::from_le_bytes(*seconds)) * 1_000_000_000 + i64::from(u32::from_le_bytes(*nanos));
    let later = stamp.saturating_add(i64::try_from(nanoseconds).unwrap_or(i64::MAX));
    *seconds = i32::try_from(later.div_euclid(1_000_000_000)).unwrap_or(i32::MAX).to_le_bytes();
    *nanos = u32::try_from(later.rem_euclid(1_000_000_000)).unwrap_or_default().to_le_bytes();
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::ros::{Header, PoseStamped, decode, encode};

    #[test]
    fn the_stamp_is_shifted_and_nothing_else_changes() {
        let message = |time| PoseStamped { header: Header::new(LogTime(time), "robot1/map"), ..Default::default() };
        let mut bytes = encode(&message(1_999_999_999)).unwrap();
        make_later(&mut bytes, 1_000_000_002);
        assert_eq!(decode::<PoseStamped>(&bytes).unwrap(), message(3_000_000_001));
        make_later(&mut [1, 2, 3], 1);
    }

    #[test]
    fn the_messages_of_every_channel_are_shifted_in_a_repetition() {
        use gridweave_runtime::message::MessageHeader;
        use gridweave_runtime::ros::{OccupancyGrid, RosMessage, TFMessage, TagRange};

        struct Sent(Rc<RefCell<Vec<Vec<u8>>>>);
        impl OutputSink for Sent {
            fn send(&mut self, _: MessageHeader, bytes: &[u8]) -> Result<(), StageError> {
                self.0.borrow_mut().push(bytes.to_vec());
                Ok(())
            }
        }
        for name in [PoseStamped::NAME, OccupancyGrid::NAME, TagRange::NAME] {
            assert!(begins_with_header(name), "{name}");
        }
        assert!(!begins_with_header(TFMessage::NAME) && !begins_with_header("p/msg/Unknown"));

        let reading = |time| TagRange { header: Header::new(LogTime(time), "robot1"), ..Default::default() };
        let sent = Rc::default();
        let pace = Rc::new(RefCell::new(Pace { later: 7, ..Pace::new(0.0) }));
        let mut link = Paced { pace, link: Box::new(Sent(Rc::clone(&sent))), has_stamp: true };
        // Messages of a log have announced channels, and those that the source makes do not.
        for channel in [0, 3] {
            let flags = MessageFlags::DATA;
            let header = MessageHeader { channel, flags, log_time: LogTime(5), ..Default::default() };
            link.send(header, &encode(&reading(5)).unwrap()).unwrap();
        }
        for bytes in sent.borrow().iter() {
            assert_eq!(decode::<TagRange>(bytes).unwrap(), reading(12));
        }
        assert_eq!(sent.borrow().len(), 2);
    }

    #[test]
    fn a_message_that_was_not_sent_is_not_counted() {
        struct Stops(bool);
        impl OutputSink for Stops {
            fn send(&mut self, _: MessageHeader, _: &[u8]) -> Result<(), StageError> {
                match std::mem::replace(&mut self.0, true) {
                    true => Err(StageError::new("send", "the player was stopped")),
                    false => Ok(()),
                }
            }

            fn send_in_place(&mut self, header: MessageHeader, _: &mut Write<'_>) -> Result<(), StageError> {
                self.send(header, &[])
            }
        }
        let header = MessageHeader { flags: MessageFlags::DATA, ..Default::default() };
        let pace = Rc::new(RefCell::new(Pace::new(0.0)));
        let mut link = Paced::new(Rc::clone(&pace), Box::new(Stops(false)), false);
        link.send(header, &[1]).unwrap();
        link.send(header, &[2]).unwrap_err();
        link.send_in_place(header, &mut |_| panic!("nothing is written")).unwrap_err();
        assert_eq!(pace.borrow().messages(), 1);
    }

    #[test]
    fn rate_0_does_not_wait_and_repetitions_follow_each_other() {
        let mut pace = Pace::new(0.0);
        assert!(!pace.begin_repetition());
        for time in [5_000_000_000, 1_000_000_000, 9_000_000_000] {
            pace.wait(LogTime(time)).unwrap();
        }
        assert!(pace.begin_repetition());
        assert_eq!(pace.later, 8_000_000_000 + REPEAT_GAP);
        pace.stopped.store(true, Ordering::Relaxed);
        assert!(pace.wait(LogTime(1)).is_err());
    }
}
