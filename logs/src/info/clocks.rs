//! The clocks of robots: the stamps of their messages compared with the log times.

use super::TopicInfo;
use crate::schemas::full_type_name;
use gridweave_runtime::message::{Channel, LogTime};
use gridweave_runtime::ros::{Header, RosMessage, TFMessage, decode};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A smaller offset, seconds, may be the latency of messages.
const NOTABLE: f64 = 5.0;
/// A smaller drift over the whole log, seconds, is not reported.
const NOTABLE_DRIFT: f64 = 0.5;

/// The leading header of a message.
#[derive(Deserialize)]
struct Start {
    header: Header,
}

/// The location of the header in a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum HeaderPlace {
    /// The first field.
    First,
    /// There is none, or the definition is unknown.
    Nowhere,
}

impl HeaderPlace {
    /// The location of the header in a channel's messages.
    pub(super) fn of(channel: &Channel) -> Self {
        let text = String::from_utf8_lossy(&channel.schema);
        let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default().trim());
        let first = lines.filter(|line| !line.is_empty()).find(|line| !line.contains('='));
        let is_header = first.is_some_and(|line| line.starts_with("std_msgs/Header ") || line.starts_with("Header "));
        let is_cdr = channel.message_encoding == "cdr" && full_type_name(&channel.schema_name) != TFMessage::NAME;
        if is_cdr && is_header { Self::First } else { Self::Nowhere }
    }

    /// Reads the header of a message.
    pub(super) fn read(self, message: &[u8]) -> Option<Header> {
        match self {
            Self::First => decode::<Start>(message).ok().map(|start| start.header),
            Self::Nowhere => None,
        }
    }
}

/// The offset of a clock from the log's clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ClockInfo {
    /// Seconds at the first message.
    pub first: f64,
    /// Seconds at the last message.
    pub last: f64,
    /// The number of messages with a stamp.
    pub messages: u64,
}

impl ClockInfo {
    /// Adds a stamp from a clock that was shifted `later` by nanoseconds. A zero stamp is "no time" and is ignored.
    pub(super) fn add(&mut self, header: &Header, log_time: LogTime, later: i64) {
        if header.stamp.sec == 0 && header.stamp.nanosec == 0 {
            return;
        }
        let stamp = i128::from(header.stamp.sec) * 1_000_000_000 + i128::from(header.stamp.nanosec) + i128::from(later);
        let ahead = (stamp - i128::from(log_time.0)) as f64 * 1e-9;
        if self.messages == 0 {
            self.first = ahead;
        }
        self.last = ahead;
        self.messages += 1;
    }

    /// A note for the user; `None` if the clock agrees with the log's.
    fn note(&self, robot: &str) -> Option<String> {
        let drift = self.last - self.first;
        let is_off = self.first.abs() > NOTABLE || self.last.abs() > NOTABLE;
        if !is_off && drift.abs() <= NOTABLE_DRIFT {
            return None;
        }
        let direction = if self.first < 0.0 { "behind" } else { "ahead of" };
        let drift = match drift.abs() > NOTABLE_DRIFT {
            true => format!(", and {} by the end", period(self.last)),
            false => String::new(),
        };
        let first = period(self.first.abs());
        Some(format!("the stamps of {robot} are {first} {direction} the log times of its messages{drift}"))
    }
}

/// Notes for the user about the clocks of robots, from their topics.
pub(super) fn notes<'a>(topics: impl Iterator<Item = (&'a str, &'a TopicInfo)>) -> Vec<String> {
    let mut clocks: BTreeMap<&str, ClockInfo> = BTreeMap::new();
    let mut spans: BTreeMap<&str, (f64, f64)> = BTreeMap::new();
    for (robot, topic) in topics.filter(|(robot, topic)| !robot.is_empty() && topic.messages > 0) {
        if let Some(clock) = topic.clock.filter(|clock| clock.messages > 0) {
            let of_robot = clocks.entry(robot).or_insert(clock);
            if clock.messages > of_robot.messages {
                *of_robot = clock;
            }
        }
        let span = spans.entry(robot).or_insert((topic.first, topic.last));
        *span = (span.0.min(topic.first), span.1.max(topic.last));
    }
    let mut notes: Vec<String> = clocks.iter().filter_map(|(robot, clock)| clock.note(robot)).collect();
    // Whose messages are all of one moment, as a map from a file is, did not drive, and shows no clock.
    let mut in_order: Vec<(&str, (f64, f64))> = spans.into_iter().filter(|(_, (start, end))| start < end).collect();
    in_order.sort_by(|one, other| one.1.0.total_cmp(&other.1.0));
    for pair in in_order.windows(2) {
        let [(one, (_, end)), (other, (start, _))] = pair else { continue };
        if start > end {
            notes.push(format!(
                "the log of {other} starts {} after the end of {one}: if the robots drove at the same time, their clocks are \
                 unrelated; `--align-start` aligns the starts of their logs",
                period(start - end)
            ));
        }
    }
    notes
}

/// A duration for people.
fn period(seconds: f64) -> String {
    match seconds.abs() {
        60.0..3600.0 => format!("{:.1} minutes", seconds / 60.0),
        3600.0..86_400.0 => format!("{:.1} hours", seconds / 3600.0),
        86_400.0..31_557_600.0 => format!("{:.1} days", seconds / 86_400.0),
        31_557_600.0.. => format!("{:.1} years", seconds / 31_557_600.0),
        _ => format!("{seconds:.2} s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn topic(first: f64, last: f64, clock: Option<(f64, f64)>) -> TopicInfo {
        let clock = clock.map(|(first, last)| ClockInfo { first, last, messages: 3 });
        TopicInfo { messages: 3, first, last, clock, ..Default::default() }
    }

    #[test]
    fn clocks_with_an_offset_or_drift_are_reported_and_others_are_not() {
        let report = |one: &TopicInfo, other: &TopicInfo| notes([("a", one), ("b", other)].into_iter()).join("; ");
        let right = topic(100.0, 200.0, Some((0.1, -0.1)));
        assert_eq!(report(&right, &right), "");
        let text = report(&right, &topic(100.0, 200.0, Some((-7200.0, -7200.0))));
        assert_eq!(text, "the stamps of b are 2.0 hours behind the log times of its messages");
        let text = report(&right, &topic(100.0, 200.0, Some((0.0, 2.0))));
        assert!(text.contains("0.00 s ahead of") && text.contains("and 2.00 s by the end"), "{text}");
        let text = report(&right, &topic(3e8, 3e8 + 100.0, None));
        assert!(text.contains("the log of b starts 9.5 years after the end of a"), "{text}");
        assert!(text.contains("--align-start"));
    }

    #[test]
    fn maps_from_files_have_no_clocks_that_could_be_unrelated() {
        let (map, other, drive) = (topic(1.0, 1.0, None), topic(2.0, 2.0, None), topic(3e8, 3e8 + 100.0, None));
        assert_eq!(notes([("a", &map), ("b", &other), ("c", &drive)].into_iter()), Vec::<String>::new());
    }

    #[test]
    fn a_stamp_is_compared_with_the_log_time_to_the_nanosecond() {
        let mut clock = ClockInfo::default();
        clock.add(&Header::new(LogTime(0), "a"), LogTime(5), 0);
        assert_eq!(clock.messages, 0, "no time");
        let at = 1_700_000_000_000_000_000;
        clock.add(&Header::new(LogTime(at + 1_500_000_000), "a"), LogTime(at), 0);
        clock.add(&Header::new(LogTime(at), "a"), LogTime(at + 350_000_000), 100_000_000);
        assert!((clock.first - 1.5).abs() < 1e-6 && (clock.last + 0.25).abs() < 1e-6, "{clock:?}");
    }
}
