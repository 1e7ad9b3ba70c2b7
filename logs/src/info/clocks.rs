//! How the clocks of robots go: the stamps in their messages against the times that they were logged at.

use super::TopicInfo;
use crate::schemas::full_type_name;
use gridweave_runtime::message::{Channel, LogTime};
use gridweave_runtime::ros::{Header, RosMessage, TFMessage, decode};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A clock that differs by less, seconds, may be that of the log: messages are on their way for a while.
const NOTABLE: f64 = 5.0;
/// A clock that drifts by less, seconds over the whole log, goes right.
const NOTABLE_DRIFT: f64 = 0.5;

/// The beginning of a message with a header.
#[derive(Deserialize)]
struct Start {
    header: Header,
}

/// The header of a message, read as its type begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum HeaderPlace {
    /// It is the first field.
    First,
    /// It has none, or nobody knows.
    Nowhere,
}

impl HeaderPlace {
    /// Of the messages of a channel.
    pub(super) fn of(channel: &Channel) -> Self {
        let text = String::from_utf8_lossy(&channel.schema);
        let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default().trim());
        let first = lines.filter(|line| !line.is_empty()).find(|line| !line.contains('='));
        let is_header = first.is_some_and(|line| line.starts_with("std_msgs/Header ") || line.starts_with("Header "));
        let is_cdr = channel.message_encoding == "cdr" && full_type_name(&channel.schema_name) != TFMessage::NAME;
        if is_cdr && is_header { Self::First } else { Self::Nowhere }
    }

    /// The header of a message.
    pub(super) fn read(self, message: &[u8]) -> Option<Header> {
        match self {
            Self::First => decode::<Start>(message).ok().map(|start| start.header),
            Self::Nowhere => None,
        }
    }
}

/// How far a clock is ahead of that of the log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ClockInfo {
    /// Seconds at the first message.
    pub first: f64,
    /// Seconds at the last message.
    pub last: f64,
    /// How many messages have a stamp.
    pub messages: u64,
}

impl ClockInfo {
    /// Takes up a stamp, of a clock that was set `later` by so many nanoseconds. One of zero stands for no time.
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

    /// What the user should know of it; nothing if it goes as the log's does.
    fn remark(&self, robot: &str) -> Option<String> {
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
        Some(format!("the stamps of {robot} are {first} {direction} the times that its messages were logged at{drift}"))
    }
}

/// What is to be told of the clocks of robots, from their topics.
pub(super) fn remarks<'a>(topics: impl Iterator<Item = (&'a str, &'a TopicInfo)>) -> Vec<String> {
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
    let mut remarks: Vec<String> = clocks.iter().filter_map(|(robot, clock)| clock.remark(robot)).collect();
    let mut in_order: Vec<(&str, (f64, f64))> = spans.into_iter().collect();
    in_order.sort_by(|one, other| one.1.0.total_cmp(&other.1.0));
    for pair in in_order.windows(2) {
        let [(one, (_, end)), (other, (start, _))] = pair else { continue };
        if start > end {
            remarks.push(format!(
                "nothing of {other} was logged before {} after the end of {one}: if they drove at the same time, their clocks have \
                 nothing in common, and `--align-start` lays the starts of their logs together",
                period(start - end)
            ));
        }
    }
    remarks
}

/// A number of seconds for people.
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
    fn clocks_that_differ_or_drift_are_told_and_others_are_not() {
        let told = |one: &TopicInfo, other: &TopicInfo| remarks([("a", one), ("b", other)].into_iter()).join("; ");
        let right = topic(100.0, 200.0, Some((0.1, -0.1)));
        assert_eq!(told(&right, &right), "");
        let text = told(&right, &topic(100.0, 200.0, Some((-7200.0, -7200.0))));
        assert_eq!(text, "the stamps of b are 2.0 hours behind the times that its messages were logged at");
        let text = told(&right, &topic(100.0, 200.0, Some((0.0, 2.0))));
        assert!(text.contains("0.00 s ahead of") && text.contains("and 2.00 s by the end"), "{text}");
        let text = told(&right, &topic(3e8, 3e8 + 100.0, None));
        assert!(text.contains("nothing of b was logged before 9.5 years after the end of a"), "{text}");
        assert!(text.contains("--align-start"));
    }

    #[test]
    fn a_stamp_is_held_against_the_time_of_the_log_to_the_nanosecond() {
        let mut clock = ClockInfo::default();
        clock.add(&Header::new(LogTime(0), "a"), LogTime(5), 0);
        assert_eq!(clock.messages, 0, "no time");
        let at = 1_700_000_000_000_000_000;
        clock.add(&Header::new(LogTime(at + 1_500_000_000), "a"), LogTime(at), 0);
        clock.add(&Header::new(LogTime(at), "a"), LogTime(at + 350_000_000), 100_000_000);
        assert!((clock.first - 1.5).abs() < 1e-6 && (clock.last + 0.25).abs() < 1e-6, "{clock:?}");
    }
}
