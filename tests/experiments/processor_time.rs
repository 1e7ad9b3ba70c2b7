//! The time that a thread has computed, which other work on the machine does not lengthen as it does the time on a
//! clock.

use rustix::time::{ClockId, clock_gettime};
use std::time::Duration;

/// How long the calling thread has computed since it began.
#[derive(Clone, Copy, Debug)]
pub(super) struct ProcessorTime(Duration);

impl ProcessorTime {
    /// So far.
    pub(super) fn now() -> Self {
        let time = clock_gettime(ClockId::ThreadCPUTime);
        // A thread has not computed for less than no time, nor does a second have more nanoseconds than fit.
        let seconds = u64::try_from(time.tv_sec).unwrap_or_default();
        let nanoseconds = u32::try_from(time.tv_nsec).unwrap_or_default();
        Self(Duration::new(seconds, nanoseconds))
    }

    /// What was computed since an earlier moment of the same thread.
    pub(super) fn since(self, earlier: Self) -> Duration {
        self.0.saturating_sub(earlier.0)
    }
}

#[cfg(test)]
mod tests {
    use super::ProcessorTime;
    use std::time::Duration;

    #[test]
    fn it_grows_with_work_and_never_shrinks() {
        let start = ProcessorTime::now();
        let mut now = start;
        while now.since(start) < Duration::from_millis(2) {
            let before = now;
            now = ProcessorTime::now();
            assert!(before.since(now) == Duration::ZERO);
        }
    }
}
