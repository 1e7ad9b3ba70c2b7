//! Handling of signals that end the program, so that outputs are closed and nothing is left behind.

use crate::terminal::eprint_line;
use gridweave_runtime::engine::wait_for_long_call;
use gridweave_runtime::left_behind;
use nix::sys::signal::{SigSet, Signal};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

/// Whether the user has interrupted the program.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Whether the program runs a replay. Its input is still there, so what it has written is worth no wait.
static IS_REPLAY: AtomicBool = AtomicBool::new(false);

/// Message on the interrupt of a run.
pub(crate) const OUTPUT_IS_CLOSED: &str = "the output is being closed";

/// Signals that end a program at once by default, other than SIGINT, SIGTERM and SIGHUP.
const OTHERS: [Signal; 4] = [Signal::SIGQUIT, Signal::SIGUSR1, Signal::SIGUSR2, Signal::SIGALRM];

/// Makes a write to a file that exceeds its size limit (`ulimit -f`) an error instead of the end of the program. Must be
/// called before other threads are started.
pub(crate) fn fail_on_large_files() {
    if let Err(error) = SigSet::from(Signal::SIGXFSZ).thread_block() {
        tracing::warn!("a file that exceeds its size limit will end the program: {error}");
    }
}

/// Blocks the signals that would end the program at once, until [`stop_on_interrupt`] is called. Must be called before
/// other threads are started.
pub(crate) fn hold_back() {
    let signals: SigSet = OTHERS.into_iter().collect();
    if let Err(error) = signals.thread_block() {
        tracing::warn!("signals will end the program without closing the output: {error}");
    }
}

/// Makes a signal set the returned flag, so that the program can end in order; `what_follows` is printed. A second
/// signal ends the program at once.
pub(crate) fn stop_on_interrupt(what_follows: &'static str) -> &'static AtomicBool {
    static HANDLER: AtomicBool = AtomicBool::new(false);
    if !HANDLER.swap(true, Ordering::Relaxed) {
        if let Err(error) = ctrlc::set_handler(move || interrupt(what_follows)) {
            tracing::warn!("an interrupt will end the program without closing the output: {error}");
        }
        let wait = move || {
            let signals: SigSet = OTHERS.into_iter().collect();
            while signals.wait().is_ok() {
                interrupt(what_follows);
            }
        };
        if let Err(error) = thread::Builder::new().name("signals".to_owned()).spawn(wait) {
            tracing::warn!("some signals will not end the program: {error}");
        }
    }
    &INTERRUPTED
}

/// The same for a replay. If a stage goes on working for more than a second after a signal, the program ends without it;
/// what it has written to the output is removed then, and an earlier output stays.
pub(crate) fn stop_replay_on_interrupt() -> &'static AtomicBool {
    IS_REPLAY.store(true, Ordering::Relaxed);
    stop_on_interrupt(OUTPUT_IS_CLOSED)
}

/// Makes a signal end the program at once, without what it has begun to write: for commands whose input is still there.
pub(crate) fn remove_on_interrupt() {
    if let Err(error) = ctrlc::set_handler(|| left_behind::end_process(130)) {
        tracing::warn!("what is written is left as NAME.part on an interrupt: {error}");
    }
}

fn interrupt(what_follows: &str) {
    let is_replay = IS_REPLAY.load(Ordering::Relaxed);
    if INTERRUPTED.swap(true, Ordering::Relaxed) {
        if is_replay {
            left_behind::end_process(130);
        }
        std::process::exit(130);
    }
    if is_replay {
        // Without the thread, the run ends with the work of its stage.
        let _ = thread::Builder::new().name("stopping".to_owned()).spawn(end_without_long_call);
    }
    eprint_line(format_args!("interrupted: {what_follows}; a second signal ends the program at once"));
}

fn end_without_long_call() {
    wait_for_long_call();
    eprint_line("error: the run was interrupted in the work of a stage; outputs that were not closed yet are removed");
    left_behind::end_process(1);
}
