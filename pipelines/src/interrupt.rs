//! Signals that ask the program to end: it ends in order, so that outputs are closed and nothing is left behind.

use crate::terminal::say;
use nix::sys::signal::{SigSet, Signal};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

/// Set by the first interrupt of the user.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// What happens on an interrupt where a run ends early.
pub(crate) const OUTPUT_IS_CLOSED: &str = "the output is being closed";

/// Signals that end a program on the spot unless it does something about them, beside SIGINT, SIGTERM and SIGHUP.
const OTHERS: [Signal; 4] = [Signal::SIGQUIT, Signal::SIGUSR1, Signal::SIGUSR2, Signal::SIGALRM];

/// Keeps the signals that do not ask to end, but do it, from ending a program that has something to put in order: until
/// [`stop_on_interrupt`] is called they wait. Must be called before there are other threads.
pub(crate) fn hold_back() {
    let mut signals: SigSet = OTHERS.into_iter().collect();
    // A file that has become larger than it may is an error of the write.
    signals.add(Signal::SIGXFSZ);
    if let Err(error) = signals.thread_block() {
        tracing::warn!("a signal will not close the output: {error}");
    }
}

/// Lets a program end in order on a signal; `what_follows` tells the user how it does. A second signal ends it at once.
pub(crate) fn stop_on_interrupt(what_follows: &'static str) -> &'static AtomicBool {
    static HANDLER: AtomicBool = AtomicBool::new(false);
    if !HANDLER.swap(true, Ordering::Relaxed) {
        if let Err(error) = ctrlc::set_handler(move || interrupt(what_follows)) {
            tracing::warn!("an interrupt will not close the output: {error}");
        }
        thread::spawn(move || {
            let signals: SigSet = OTHERS.into_iter().collect();
            while signals.wait().is_ok() {
                interrupt(what_follows);
            }
        });
    }
    &INTERRUPTED
}

fn interrupt(what_follows: &str) {
    if INTERRUPTED.swap(true, Ordering::Relaxed) {
        std::process::exit(130);
    }
    say(format_args!("interrupted: {what_follows}; a second signal ends the program at once"));
}
