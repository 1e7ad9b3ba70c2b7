//! How far a run is: a bar on a terminal, plain lines elsewhere.

use gridweave_runtime::engine::Observer;
use gridweave_runtime::message::LogTime;
use gridweave_runtime::pipeline::Mode;
use std::io::{IsTerminal, Write};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// The width of the bar, characters.
const BAR: usize = 40;
/// How often the bar is drawn anew at most.
const BAR_INTERVAL: Duration = Duration::from_millis(50);
/// Without a terminal, a line is written at most this often.
const LINE_INTERVAL: Duration = Duration::from_secs(5);
/// What takes a terminal's cursor to the start of an empty line.
const CLEAR_LINE: &str = "\r\x1b[K";

/// Set by the first interrupt of the user.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// What happens on an interrupt where a run ends early.
pub(crate) const OUTPUT_IS_CLOSED: &str = "the output is being closed";

/// Lets a program end in order on SIGINT or SIGTERM; `what_follows` tells the user how it does. A second signal ends it at
/// once.
pub(crate) fn stop_on_interrupt(what_follows: &'static str) -> &'static AtomicBool {
    static HANDLER: AtomicBool = AtomicBool::new(false);
    if !HANDLER.swap(true, Ordering::Relaxed) {
        let handler = ctrlc::set_handler(move || {
            if INTERRUPTED.swap(true, Ordering::Relaxed) {
                std::process::exit(130);
            }
            eprintln!("interrupted: {what_follows}; a second signal ends the program at once");
        });
        if let Err(error) = handler {
            log::warn!("an interrupt will not close the output: {error}");
        }
    }
    &INTERRUPTED
}

/// Shows how far a run is.
pub(crate) struct Progress {
    /// Whether there is a bar, and not lines.
    bar: bool,
    /// When something was last shown.
    last_shown: Mutex<Instant>,
    start: AtomicU64,
    mode: Mode,
    stop: &'static AtomicBool,
}

impl Progress {
    /// Nothing is done yet. The run ends when the user interrupts it.
    pub(crate) fn new(mode: Mode) -> Self {
        let stop = stop_on_interrupt(match mode {
            Mode::Replay => OUTPUT_IS_CLOSED,
            Mode::Live => "what is on its way is handled to its end",
        });
        // A live run has no end that it could come nearer to.
        let bar = mode == Mode::Replay && std::io::stderr().is_terminal();
        Self { bar, last_shown: Mutex::new(Instant::now()), start: AtomicU64::new(u64::MAX), mode, stop }
    }

    /// Takes the bar away.
    pub(crate) fn finish(&self) {
        if self.bar {
            // A terminal that is gone takes no bar, and the run goes on.
            let _ = write!(std::io::stderr(), "{CLEAR_LINE}");
        }
    }
}

impl Observer for Progress {
    fn progress(&self, stage: &str, share: f64, log_time: LogTime) {
        let start = LogTime(self.start.fetch_min(log_time.0, Ordering::Relaxed).min(log_time.0));
        let at = format!("{:.0} s of the log read by `{stage}`", log_time.seconds_since(start));
        let Ok(mut last_shown) = self.last_shown.lock() else { return };
        if last_shown.elapsed() < if self.bar { BAR_INTERVAL } else { LINE_INTERVAL } {
            return;
        }
        *last_shown = Instant::now();
        if self.bar {
            let _ = write!(std::io::stderr(), "{CLEAR_LINE}{}  {at}", bar(share));
        } else {
            eprintln!("{:.0} %, {at}", share * 100.0);
        }
    }

    fn started(&self, prefix: &str) {
        if self.mode == Mode::Live {
            eprintln!("the live run {prefix} has started; an interrupt (ctrl-c) ends it");
        }
    }

    fn restarting(&self, stage: &str, failure: &str, after: Duration) {
        eprintln!("stage `{stage}` {failure}; it is started again in {:.1} s", after.as_secs_f64());
    }

    fn should_stop(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

/// A share, 0 to 1, as a bar and a number.
fn bar(share: f64) -> String {
    let full = ((share * BAR as f64) as usize).min(BAR);
    format!("{}{} {:>3.0} %", "█".repeat(full), "░".repeat(BAR - full), share * 100.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bar_is_as_full_as_the_run_is_far_and_always_as_wide() {
        for (share, full) in [(0.0, 0), (0.26, 10), (1.0, BAR), (1.5, BAR)] {
            let bar = bar(share);
            assert_eq!(bar.chars().filter(|&c| c == '█').count(), full, "{bar}");
            assert_eq!(bar.chars().filter(|&c| c == '█' || c == '░').count(), BAR, "{bar}");
        }
        assert!(bar(0.26).ends_with("  26 %"));
    }
}
