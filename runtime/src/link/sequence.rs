//! The sequence numbers of a link's messages, and the check that log time never decreases in a replay.

use super::Order;
use crate::message::{LogTime, MessageFlags, MessageHeader};
use crate::stage::StageError;

/// The sequence numbers of one link and the log time that it has reached.
#[derive(Debug, Default)]
pub(crate) struct Sequence {
    order: Order,
    next: u64,
    /// The latest log time of a message or watermark. In a replay no earlier message may follow.
    reached: LogTime,
}

impl Sequence {
    pub(crate) fn new(order: Order) -> Self {
        Self { order, ..Self::default() }
    }

    /// Assigns a message its sequence number.
    ///
    /// # Errors
    /// In a replay, its log time is before the one that the link has reached.
    pub(crate) fn stamp(&mut self, header: &mut MessageHeader) -> Result<(), StageError> {
        if self.order == Order::Arrival {
            // Live messages carry the times of their sources, in any order.
        } else if header.flags.contains(MessageFlags::DATA) {
            if header.log_time < self.reached {
                let cause = format!(
                    "its log time {} is before {}, which the stream has reached",
                    header.log_time, self.reached
                );
                return Err(StageError::new(format!("send a message on {}", header.topic), cause)
                    .with_help("a stage must send its messages in order of log time"));
            }
        } else {
            header.log_time = header.log_time.max(self.reached);
        }
        self.reached = self.reached.max(header.log_time);
        header.sequence = self.next;
        self.next += 1;
        Ok(())
    }

    /// Raises the watermark. Returns whether it is later than the log time that the stream has reached.
    pub(crate) fn raise(&mut self, watermark: LogTime) -> bool {
        let is_later = watermark > self.reached;
        self.reached = self.reached.max(watermark);
        is_later
    }

    /// The log time that the stream has reached: that of the last message or watermark.
    pub(crate) fn reached(&self) -> LogTime {
        self.reached
    }
}
