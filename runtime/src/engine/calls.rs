//! What the stages of this process are doing, so that a run that is to stop need not wait for a long call.
//!
//! A stage is asked to stop between two calls. A call may take minutes, such as the refinement of many robots, and its
//! result is of no use to a run that has been stopped.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// The time that a call has to end.
const GRACE: Duration = Duration::from_millis(1200);
/// The interval at which the calls are looked at.
const INTERVAL: Duration = Duration::from_millis(50);

/// The number of calls of stages that are in progress.
static WORKING: AtomicUsize = AtomicUsize::new(0);
/// The number of stages that are closing their outputs, as the run has failed.
static CLOSING: AtomicUsize = AtomicUsize::new(0);

/// The number of beginnings and ends of calls.
static EVENTS: AtomicUsize = AtomicUsize::new(0);

/// A call that is in progress.
pub(super) struct Call(&'static AtomicUsize);

impl Call {
    /// A call in which a stage works.
    pub(super) fn working() -> Self {
        Self::of(&WORKING)
    }

    /// A call in which a stage closes its outputs.
    pub(super) fn closing() -> Self {
        Self::of(&CLOSING)
    }

    fn of(count: &'static AtomicUsize) -> Self {
        count.fetch_add(1, Ordering::Relaxed);
        EVENTS.fetch_add(1, Ordering::Relaxed);
        Self(count)
    }
}

impl Drop for Call {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
        EVENTS.fetch_add(1, Ordering::Relaxed);
    }
}

/// Waits, from the moment at which the run was asked to stop, until nothing but a long call keeps this process from
/// its end: until a stage works, none closes its outputs, and no call has begun or ended for more than a second. Never
/// returns if the run ends in order.
pub fn wait_for_long_call() {
    let (mut events, mut since) = (EVENTS.load(Ordering::Relaxed), Instant::now());
    loop {
        thread::sleep(INTERVAL);
        let now = EVENTS.load(Ordering::Relaxed);
        if now != events {
            (events, since) = (now, Instant::now());
        }
        let is_working = WORKING.load(Ordering::Relaxed) > 0 && CLOSING.load(Ordering::Relaxed) == 0;
        if is_working && since.elapsed() > GRACE {
            return;
        }
    }
}
