//! For how long this process has been running without having been halted.
//!
//! A process that is halted, with its container, by a debugger or by SIGSTOP, sees time pass in which nobody could do
//! anything. What others have not done in that time is no sign that they hang.

use std::time::{Duration, Instant};

/// A process that looks every few milliseconds, and has not looked for so long, was halted, or as good as.
const HALT: Duration = Duration::from_secs(1);

/// Since when this process has been awake.
#[derive(Clone, Copy, Debug)]
pub(super) struct SuspendDetector {
    since: Instant,
    looked: Instant,
}

impl SuspendDetector {
    /// SuspendDetector from `now` on.
    pub(super) fn new(now: Instant) -> Self {
        Self { since: now, looked: now }
    }

    /// Looks at the time, which must be done every few milliseconds. Gives for how long the process has been awake.
    pub(super) fn look(&mut self, now: Instant) -> Duration {
        if now.saturating_duration_since(self.looked) > HALT {
            self.since = now;
        }
        self.looked = now;
        now.saturating_duration_since(self.since)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_that_was_halted_has_been_awake_since_then_only() {
        let start = Instant::now();
        let at = |milliseconds| start + Duration::from_millis(milliseconds);
        let mut awake = SuspendDetector::new(start);
        for milliseconds in (0..5000).step_by(200) {
            assert_eq!(awake.look(at(milliseconds)), Duration::from_millis(milliseconds));
        }
        assert_eq!(awake.look(at(60_000)), Duration::ZERO);
        assert_eq!(awake.look(at(60_200)), Duration::from_millis(200));
    }
}
