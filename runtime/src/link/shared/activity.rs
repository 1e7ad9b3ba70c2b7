//! Whether a stage works or waits, for those who look on.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Since when a stage has worked without a pause. The stage's thread writes it, others read it.
#[derive(Clone, Debug)]
pub struct Activity {
    start: Instant,
    /// Nanoseconds from `start`, and 1; 0 while the stage waits for others.
    since: Arc<AtomicU64>,
}

impl Default for Activity {
    fn default() -> Self {
        Self { start: Instant::now(), since: Arc::default() }
    }
}

impl Activity {
    /// The stage begins to work.
    pub fn work(&self) {
        let nanoseconds = u64::try_from(self.start.elapsed().as_nanos()).unwrap_or(u64::MAX - 1);
        self.since.store(nanoseconds + 1, Ordering::Relaxed);
    }

    /// The stage waits for others.
    pub fn wait(&self) {
        self.since.store(0, Ordering::Relaxed);
    }

    /// Whether the stage is at work.
    pub(crate) fn is_working(&self) -> bool {
        self.since.load(Ordering::Relaxed) != 0
    }

    /// For how long the stage has worked without a pause; nothing while it waits.
    pub fn working_for(&self) -> Option<Duration> {
        let since = self.since.load(Ordering::Relaxed).checked_sub(1)?;
        Some(self.start.elapsed().saturating_sub(Duration::from_nanos(since)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_work_without_a_pause_counts() {
        let activity = Activity::default();
        assert_eq!(activity.working_for(), None);
        activity.work();
        std::thread::sleep(Duration::from_millis(20));
        assert!(activity.working_for().unwrap() >= Duration::from_millis(20));
        activity.wait();
        assert_eq!(activity.working_for(), None);
        activity.work();
        assert!(activity.working_for().unwrap() < Duration::from_millis(20));
    }
}
