//! How far a run is: a bar on a terminal, plain lines elsewhere.

use crate::interrupt::{OUTPUT_IS_CLOSED, stop_on_interrupt};
use crate::terminal::say;
use gridweave_runtime::engine::Observer;
use gridweave_runtime::message::LogTime;
use gridweave_runtime::pipeline::Mode;
use indicatif::{ProgressBar, ProgressStyle};
use std::fmt::Display;
use std::io::IsTerminal;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// The bar has so many steps.
const STEPS: f64 = 1000.0;
/// Without a terminal, a line is written at most this often.
const LINE_INTERVAL: Duration = Duration::from_secs(5);

/// Shows a share and what stands beside it.
pub(crate) struct Gauge {
    bar: Option<ProgressBar>,
    last_line: Mutex<Instant>,
}

impl Gauge {
    /// At its beginning. On a terminal it is a bar, if that is wanted.
    pub(crate) fn new(with_bar: bool) -> Self {
        let bar = (with_bar && std::io::stderr().is_terminal()).then(|| {
            let style = ProgressStyle::with_template("{bar:40} {percent:>3} %  {msg}");
            ProgressBar::new(STEPS as u64).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
        });
        Self { bar, last_line: Mutex::new(Instant::now()) }
    }

    /// Shows a share, 0 to 1.
    pub(crate) fn show(&self, share: f64, at: impl Display) {
        if let Some(bar) = &self.bar {
            bar.set_position((share * STEPS) as u64);
            bar.set_message(at.to_string());
            return;
        }
        let Ok(mut last_line) = self.last_line.lock() else { return };
        if last_line.elapsed() >= LINE_INTERVAL {
            *last_line = Instant::now();
            say(format_args!("{:.0} %, {at}", share * 100.0));
        }
    }

    /// Takes the bar away.
    pub(crate) fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Shows how far a run is.
pub(crate) struct Progress {
    gauge: Gauge,
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
        Self { gauge: Gauge::new(mode == Mode::Replay), start: AtomicU64::new(u64::MAX), mode, stop }
    }

    /// Takes the bar away.
    pub(crate) fn finish(&self) {
        self.gauge.finish();
    }
}

impl Observer for Progress {
    fn progress(&self, stage: &str, share: f64, log_time: LogTime) {
        let start = LogTime(self.start.fetch_min(log_time.0, Ordering::Relaxed).min(log_time.0));
        let seconds = log_time.seconds_since(start);
        self.gauge.show(share, format_args!("{seconds:.0} s of the log read by `{stage}`"));
    }

    fn started(&self, prefix: &str) {
        if self.mode == Mode::Live {
            say(format_args!("the live run {prefix} has started; an interrupt (ctrl-c) ends it"));
        }
    }

    fn restarting(&self, stage: &str, failure: &str, after: Duration) {
        say(format_args!("stage `{stage}` {failure}; it is started again in {:.1} s", after.as_secs_f64()));
    }

    fn should_stop(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}
