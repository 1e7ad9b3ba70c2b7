//! What the stages of this process are doing, so that a run that is to stop need not wait for a long call.
//!
//! A stage is asked to stop between two calls. A call may take minutes, such as the refinement of many robots, and its
//! result is of no use to a run that has been stopped.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

/// The time that a stage has for the rest of its call.
const GRACE: Duration = Duration::from_millis(1200);
/// The interval at which the calls are looked at afterwards.
const INTERVAL: Duration = Duration::from_millis(50);

/// The number of calls of stages that are in progress.
static WORKING: AtomicUsize = AtomicUsize::new(0);
/// The number of stages that are closing their outputs, as the run has failed.
static CLOSING: AtomicUsize = AtomicUsize::new(0);

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
        Self(count)
    }
}

impl Drop for Call {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Waits, from the moment at which the run was asked to stop, until nothing but a long call keeps this process from
/// its end. Returns after a little more than a second, unless outputs are being closed, and never if no stage works.
pub fn wait_for_long_call() {
    thread::sleep(GRACE);
    while WORKING.load(Ordering::Relaxed) == 0 || CLOSING.load(Ordering::Relaxed) > 0 {
        thread::sleep(INTERVAL);
    }
}
