//! Detection of the suspension of this process.
//!
//! While a process is suspended, with its container, by a debugger or by SIGSTOP, time passes in which the other
//! processes may have been suspended too. Their silence in that time does not mean that they hang.

use std::time::{Duration, Instant};

/// A process that checks every few milliseconds, and has not checked for this long, counts as suspended.
const SUSPENDED_AFTER: Duration = Duration::from_secs(1);

/// Measures for how long this process has been running without suspension.
#[derive(Clone, Copy, Debug)]
pub(super) struct SuspendDetector {
    since: Instant,
    checked: Instant,
}

impl SuspendDetector {
    /// SuspendDetector from `now` on.
    pub(super) fn new(now: Instant) -> Self {
        Self { since: now, checked: now }
    }

    /// Returns for how long the process has been running without suspension. Must be called every few milliseconds.
    pub(super) fn check(&mut self, now: Instant) -> Duration {
        if now.saturating_duration_since(self.checked) > SUSPENDED_AFTER {
            self.since = now;
        }
        self.checked = now;
        now.saturating_duration_since(self.since)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_suspension_restarts_the_time() {
        let start = Instant::now();
        let at = |milliseconds| start + Duration::from_millis(milliseconds);
        let mut suspend_detector = SuspendDetector::new(start);
        for milliseconds in (0..5000).step_by(200) {
            assert_eq!(suspend_detector.check(at(milliseconds)), Duration::from_millis(milliseconds));
        }
        assert_eq!(suspend_detector.check(at(60_000)), Duration::ZERO);
        assert_eq!(suspend_detector.check(at(60_200)), Duration::from_millis(200));
    }
}
