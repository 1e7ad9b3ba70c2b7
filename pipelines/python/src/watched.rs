//! Long work that the user can watch and interrupt.

use crate::errors::GridweaveError;
use gridweave_runtime::engine::Observer;
use gridweave_runtime::message::LogTime;
use pyo3::prelude::*;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;
use std::{process, thread};

/// The interval at which signals are looked for, and progress is reported.
const POLL_INTERVAL: Duration = Duration::from_millis(50);

/// The process that has loaded the module.
static LOADED_IN: OnceLock<u32> = OnceLock::new();

/// Keeps the number of this process, which loads the module.
pub(crate) fn keep_process() {
    LOADED_IN.get_or_init(process::id);
}

/// Whether this is a child of the process that has loaded the module, made by `fork` as `multiprocessing` does. It has
/// none of the other's threads: a wait for one never ends.
pub(crate) fn is_forked() -> bool {
    LOADED_IN.get().is_some_and(|loaded_in| *loaded_in != process::id())
}

/// Does work whose parallel loops use threads of this process.
fn with_own_threads<T: Send>(work: impl FnOnce() -> T + Send) -> PyResult<T> {
    if !is_forked() {
        return Ok(work());
    }
    let pool = rayon::ThreadPoolBuilder::new().build();
    let pool = pool.map_err(|error| GridweaveError::new_err(format!("cannot start threads: {error}")))?;
    Ok(pool.install(work))
}

/// What a run and its caller share.
#[derive(Default)]
struct Watch {
    is_stopped: AtomicBool,
    /// The bits of the share that is done.
    share: AtomicU64,
}

impl Observer for Watch {
    fn progress(&self, _: &str, share: f64, _: LogTime) {
        self.share.store(share.to_bits(), Ordering::Relaxed);
    }

    fn should_stop(&self) -> bool {
        self.is_stopped.load(Ordering::Relaxed)
    }
}

/// Does work in a thread of its own, without the interpreter, and calls `progress` with the share that is done, 0 to 1.
/// An exception of a signal handler, such as that of an interrupt, or of `progress` stops the work, and is raised when
/// it has ended.
pub(crate) fn watched<T: Send>(
    py: Python<'_>,
    progress: Option<Bound<'_, PyAny>>,
    work: impl FnOnce(&dyn Observer) -> T + Send,
) -> PyResult<T> {
    let watch = Watch::default();
    let (ended, mut has_ended) = channel::<()>();
    let (result, raised) = thread::scope(|scope| {
        let watch = &watch;
        let worker = scope.spawn(move || {
            // Dropped when the work has ended, in whatever way.
            let _ended = ended;
            with_own_threads(|| work(watch))
        });
        let mut raised = None;
        loop {
            // A receiver is used by one thread at a time.
            let has_ended = &mut has_ended;
            if py.detach(move || has_ended.recv_timeout(POLL_INTERVAL)) != Err(RecvTimeoutError::Timeout) {
                break;
            }
            let share = f64::from_bits(watch.share.load(Ordering::Relaxed));
            let report = || progress.as_ref().map_or(Ok(()), |progress| progress.call1((share,)).map(drop));
            if raised.is_none()
                && let Err(error) = py.check_signals().and_then(|()| report())
            {
                raised = Some(error);
                watch.is_stopped.store(true, Ordering::Relaxed);
            }
        }
        (py.detach(|| worker.join()), raised)
    });
    match (result, raised) {
        (_, Some(error)) => Err(error),
        (Ok(result), None) => result,
        (Err(panic), None) => std::panic::resume_unwind(panic),
    }
}
