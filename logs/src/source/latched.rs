//! The time window of a log that is read, and the latched messages before it.

use crate::qos;
use crate::reader::LogMessage;
use gridweave_runtime::message::{Channel, LogTime};
use std::collections::BTreeMap;

/// The part of the log that is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Window {
    pub(crate) start: LogTime,
    pub(crate) end: LogTime,
}

impl Window {
    /// The window from `start` to `end` seconds after `origin`.
    pub(crate) fn new(origin: LogTime, start: f64, end: Option<f64>) -> Self {
        // A start of zero is the beginning of the log, including messages that a wrong index hides before the origin.
        let start = if start > 0.0 { origin.plus_seconds(start) } else { LogTime::MIN };
        Self { start, end: end.map_or(LogTime::MAX, |end| origin.plus_seconds(end)) }
    }
}

/// How many of a channel's messages before the start are still valid at the start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Latch {
    /// None.
    No,
    /// The last one.
    Last,
    /// All messages, since each may contain other frames.
    All,
}

impl Latch {
    /// The latching of a channel. Maps are always latched, whatever QoS their publisher offered.
    pub(crate) fn of(channel: &Channel, is_map: bool) -> Self {
        if channel.topic.ends_with("/tf_static") {
            Self::All
        } else if is_map || qos::is_transient_local(&channel.metadata) {
            Self::Last
        } else {
            Self::No
        }
    }
}

/// A latched message from before the start.
#[derive(Debug)]
pub(crate) struct LatchedMessage {
    pub(crate) sequence: u32,
    pub(crate) publish_time: u64,
    pub(crate) data: Vec<u8>,
    order: usize,
}

/// The latched messages from before the start, by route.
#[derive(Debug, Default)]
pub(crate) struct LatchedMessages {
    kept: BTreeMap<usize, Vec<LatchedMessage>>,
    count: usize,
}

impl LatchedMessages {
    /// Stores a message of the given route if the route is latched.
    pub(crate) fn keep(&mut self, route: usize, latch: Latch, message: &LogMessage<'_>) {
        if latch == Latch::No {
            return;
        }
        let kept = self.kept.entry(route).or_default();
        if latch == Latch::Last {
            kept.clear();
        }
        self.count += 1;
        kept.push(LatchedMessage {
            sequence: message.sequence,
            publish_time: message.publish_time,
            data: message.data.to_vec(),
            order: self.count,
        });
    }

    /// Removes the stored messages and returns them with their routes, in log order.
    pub(crate) fn take(&mut self) -> Vec<(usize, LatchedMessage)> {
        let kept = std::mem::take(&mut self.kept);
        let mut all: Vec<_> =
            kept.into_iter().flat_map(|(route, kept)| kept.into_iter().map(move |kept| (route, kept))).collect();
        all.sort_by_key(|(_, kept)| kept.order);
        all
    }
}
