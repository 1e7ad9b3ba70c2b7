//! The numbering of a link's messages, and the rule that log time never goes back in a replay.

use super::Order;
use crate::message::{LogTime, MessageFlags, MessageHeader};
use crate::stage::StageError;

/// Numbers the messages of one link and watches their log times.
#[derive(Debug, Default)]
pub(crate) struct Sequence {
    order: Order,
    next: u64,
    /// The latest log time. In a replay the readers know that nothing before it will follow.
    reached: LogTime,
}

impl Sequence {
    pub(crate) fn new(order: Order) -> Self {
        Self { order, ..Self::default() }
    }

    /// Gives a message its number. An error if it lies before that of the message before it in a replay.
    pub(crate) fn stamp(&mut self, header: &mut MessageHeader) -> Result<(), StageError> {
        if self.order == Order::Arrival {
            // Each message has a time of its own, and the next may be earlier.
        } else if header.flags.contains(MessageFlags::DATA) {
            if header.log_time < self.reached {
                let cause = format!(
                    "its log time {} lies before {}, which the stream has reached",
                    header.log_time, self.reached
                );
                return Err(StageError::new(format!("send a message on {}", header.topic), cause)
                    .with_help("a stage must send by rising log time"));
            }
        } else {
            header.log_time = header.log_time.max(self.reached);
        }
        self.reached = self.reached.max(header.log_time);
        header.sequence = self.next;
        self.next += 1;
        Ok(())
    }

    /// Notes that the readers are told of a watermark. `false` if it tells them nothing.
    pub(crate) fn raise(&mut self, watermark: LogTime) -> bool {
        let is_news = watermark > self.reached;
        self.reached = self.reached.max(watermark);
        is_news
    }

    /// The log time that the stream has reached: that of the last message or watermark.
    pub(crate) fn reached(&self) -> LogTime {
        self.reached
    }
}
