//! The large samples that a sender has sent and that a reader has not taken.

use std::collections::VecDeque;

/// The memory of pending samples of a link above which its sender waits, bytes. The depth limits how many there are,
/// and a few compressed bytes of a log can become messages of a gigabyte.
pub(super) const MOST_PENDING_BYTES: u64 = 256 << 20;

/// The pending samples of one sender that are too large for a batch, in the order in which they were sent.
#[derive(Debug, Default)]
pub(super) struct PendingSamples {
    /// The numbers and sizes.
    samples: VecDeque<(u64, u64)>,
    bytes: u64,
}

impl PendingSamples {
    /// Adds a sample that is sent.
    pub(super) fn push(&mut self, number: u64, bytes: u64) {
        self.samples.push_back((number, bytes));
        self.bytes += bytes;
    }

    /// Removes the samples before `number`, which every reader has taken.
    pub(super) fn release(&mut self, number: u64) {
        while let Some((_, bytes)) = self.samples.pop_front_if(|(sample, _)| *sample < number) {
            self.bytes -= bytes;
        }
    }

    /// Whether they leave no memory for another one.
    pub(super) fn is_full(&self) -> bool {
        self.bytes >= MOST_PENDING_BYTES
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn released_samples_leave_memory_for_others() {
        let mut pending = PendingSamples::default();
        assert!(!pending.is_full());
        for (number, bytes) in [(3, MOST_PENDING_BYTES - 1), (5, 1), (6, 7)] {
            assert!(!pending.is_full());
            pending.push(number, bytes);
            if number == 5 {
                assert!(pending.is_full());
                pending.release(3);
                assert!(pending.is_full());
                pending.release(4);
            }
        }
        pending.release(u64::MAX);
        assert_eq!((pending.bytes, pending.samples.len()), (0, 0));
    }
}
