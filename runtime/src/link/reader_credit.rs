//! The credit that one reader has granted a sender, as the sender sees it.

use super::protocol::NOTHING_RECEIVED;
use super::receiver::ReaderEnd;
use super::stage_counters::StageCounter;

/// The sender's state for one reader.
pub(super) struct Reader {
    pub(super) end: ReaderEnd,
    /// The number of the first sample for which there is no credit, as last read.
    pub(super) limit: u64,
    /// When the reading stage was started, as last seen while it had not received a sample of this sender.
    started: u64,
    /// The number of the sample that was next at that moment.
    first: u64,
}

impl Reader {
    /// The state for a reader that has granted no credit yet.
    pub(super) fn new(end: ReaderEnd) -> Self {
        Self { end, limit: 0, started: 0, first: 0 }
    }

    /// The number of the first sample without credit, read from the shared counters, for the sender `origin` whose next
    /// sample is `number`; none while the reader is not connected to it.
    pub(super) fn limit(&mut self, origin: u64, number: u64) -> Option<u64> {
        match self.end.counters.limit_of(self.end.wire, origin)? {
            NOTHING_RECEIVED => {
                let started = self.end.counters.get(StageCounter::Started);
                if self.started != started {
                    (self.started, self.first) = (started, number);
                }
                Some(self.first.saturating_add(self.end.depth as u64))
            }
            limit => Some(limit),
        }
    }

    /// The number of the first sample that it has not taken, as far as the sender `origin` is to know.
    pub(super) fn taken(&mut self, origin: u64, number: u64) -> u64 {
        self.limit(origin, number).unwrap_or_default().saturating_sub(self.end.depth as u64)
    }
}
