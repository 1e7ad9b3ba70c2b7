//! Handling of signals that end the program, so that outputs are closed and nothing is left behind.

use crate::terminal::eprint_line;
use nix::sys::signal::{SigSet, Signal};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

/// Whether the user has interrupted the program.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

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

fn interrupt(what_follows: &str) {
    if INTERRUPTED.swap(true, Ordering::Relaxed) {
        std::process::exit(130);
    }
    eprint_line(format_args!("interrupted: {what_follows}; a second signal ends the program at once"));
}
