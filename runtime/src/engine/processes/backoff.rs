//! The delay before a failed process is restarted.

use std::time::{Duration, Instant};

/// The first delay.
const FIRST: Duration = Duration::from_millis(500);
/// The maximum delay.
const LONGEST: Duration = Duration::from_secs(30);
/// The time without a failure after which the delay is reset to the first one.
const HEALTHY: Duration = Duration::from_secs(60);

/// Exponential backoff: the delay doubles with each consecutive failure.
#[derive(Clone, Copy, Debug)]
pub(super) struct Backoff {
    next: Duration,
    started: Instant,
}

impl Backoff {
    pub(super) fn new() -> Self {
        Self { next: FIRST, started: Instant::now() }
    }

    /// Records that the process was started.
    pub(super) fn start(&mut self) {
        self.started = Instant::now();
    }

    /// Records that the process has failed, and returns the delay before the restart.
    pub(super) fn fail(&mut self) -> Duration {
        self.wait_after(self.started.elapsed())
    }

    fn wait_after(&mut self, ran: Duration) -> Duration {
        if ran > HEALTHY {
            self.next = FIRST;
        }
        let wait = self.next;
        self.next = (2 * wait).min(LONGEST);
        wait
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn delays_double_up_to_the_maximum_and_are_reset_after_a_healthy_time() {
        let mut backoff = Backoff::new();
        let short = Duration::from_secs(1);
        let waits: Vec<f64> = (0..8).map(|_| backoff.wait_after(short).as_secs_f64()).collect();
        assert_eq!(waits, [0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 30.0, 30.0]);
        assert_eq!(backoff.wait_after(2 * HEALTHY), FIRST);
    }
}
