//! Progress of a run: a bar on a terminal, plain lines elsewhere.

use crate::interrupt::{stop_on_interrupt, stop_replay_on_interrupt};
use crate::terminal::eprint_line;
use gridweave_runtime::engine::Observer;
use gridweave_runtime::message::LogTime;
use gridweave_runtime::pipeline::Mode;
use gridweave_runtime::terminal_text::escape;
use indicatif::{ProgressBar, ProgressStyle};
use std::fmt::Display;
use std::io::IsTerminal;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Number of steps of the bar.
const STEPS: f64 = 1000.0;
/// Minimum interval between lines without a terminal.
const LINE_INTERVAL: Duration = Duration::from_secs(5);

/// Interval at which the elapsed time is updated on a terminal.
const TICK: Duration = Duration::from_secs(1);
/// The rate and the remaining time are shown after this time.
const MIN_ELAPSED: Duration = Duration::from_secs(1);

/// Display of the share that is done, a text, and the remaining time.
pub(crate) struct Gauge {
    begin: Instant,
    bar: Option<ProgressBar>,
    last_line: Mutex<Instant>,
}

impl Gauge {
    /// Starts the display. With `with_bar` it is a bar on a terminal.
    pub(crate) fn new(with_bar: bool) -> Self {
        let bar = (with_bar && std::io::stderr().is_terminal()).then(|| {
            let style = ProgressStyle::with_template("{bar:20} {percent:>3} %, {elapsed}  {wide_msg}");
            let bar = ProgressBar::new(STEPS as u64).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            // The work on a small log goes on after it has been read, without further progress.
            bar.set_message("working");
            bar.enable_steady_tick(TICK);
            bar
        });
        Self { begin: Instant::now(), bar, last_line: Mutex::new(Instant::now()) }
    }

    /// The rate of a count, per second.
    pub(crate) fn rate(&self, count: f64) -> Option<f64> {
        let elapsed = self.begin.elapsed();
        (elapsed >= MIN_ELAPSED).then(|| count / elapsed.as_secs_f64())
    }

    /// Shows a share, 0 to 1, and a text.
    pub(crate) fn show(&self, share: f64, at: impl Display) {
        let left = time_left(self.begin.elapsed(), share).map_or_else(String::new, |left| format!(", {left} left"));
        if let Some(bar) = &self.bar {
            bar.set_position((share * STEPS) as u64);
            bar.set_message(escape(&format!("{at}{left}")).into_owned());
            return;
        }
        let Ok(mut last_line) = self.last_line.lock() else { return };
        if last_line.elapsed() >= LINE_INTERVAL {
            *last_line = Instant::now();
            eprint_line(format_args!("{:.0} %, {at}{left}", share * 100.0));
        }
    }

    /// Removes the bar.
    pub(crate) fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Estimates the remaining time; `None` while too little is done.
fn time_left(elapsed: Duration, share: f64) -> Option<String> {
    if elapsed < MIN_ELAPSED || !(0.01..1.0).contains(&share) {
        return None;
    }
    let seconds = (elapsed.as_secs_f64() * (1.0 - share) / share).ceil() as u64;
    Some(match (seconds / 3600, seconds / 60 % 60, seconds % 60) {
        (0, 0, seconds) => format!("{seconds} s"),
        (0, minutes, seconds) => format!("{minutes} min {seconds} s"),
        (hours, minutes, _) => format!("{hours} h {minutes} min"),
    })
}

/// Observer that shows the progress of a run.
pub(crate) struct Progress {
    gauge: Gauge,
    start: AtomicU64,
    mode: Mode,
    stop: &'static AtomicBool,
}

impl Progress {
    /// Starts the display. An interrupt of the user ends the run.
    pub(crate) fn new(mode: Mode) -> Self {
        let stop = match mode {
            Mode::Replay => stop_replay_on_interrupt(),
            Mode::Live => stop_on_interrupt("messages in the queues are handled first"),
        };
        // The end of a live run is not known.
        Self { gauge: Gauge::new(mode == Mode::Replay), start: AtomicU64::new(u64::MAX), mode, stop }
    }

    /// Removes the bar.
    pub(crate) fn finish(&self) {
        self.gauge.finish();
    }
}

impl Observer for Progress {
    fn progress(&self, _: &str, share: f64, log_time: LogTime) {
        let start = LogTime(self.start.fetch_min(log_time.0, Ordering::Relaxed).min(log_time.0));
        let seconds = log_time.seconds_since(start);
        let rate = self.gauge.rate(seconds).map_or_else(String::new, |rate| format!(", {rate:.1} times real time"));
        self.gauge.show(share, format_args!("{seconds:.0} s of the log{rate}"));
    }

    fn started(&self, prefix: &str) {
        if self.mode == Mode::Live {
            eprint_line(format_args!("the live run {prefix} has started; an interrupt (ctrl-c) ends it"));
        }
    }

    fn restarting(&self, stage: &str, failure: &str, after: Duration) {
        eprint_line(format_args!("stage `{stage}` {failure}; restarting in {:.1} s", after.as_secs_f64()));
    }

    fn should_stop(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_remaining_time_is_estimated_after_some_progress() {
        let left = |seconds: f64, share: f64| time_left(Duration::from_secs_f64(seconds), share);
        assert_eq!(left(0.5, 0.5), None);
        assert_eq!((left(5.0, 0.0), left(5.0, 1.0), left(5.0, f64::NAN)), (None, None, None));
        assert_eq!(left(10.0, 0.5).as_deref(), Some("10 s"));
        assert_eq!(left(10.0, 0.1).as_deref(), Some("1 min 30 s"));
        assert_eq!(left(100.0, 0.01).as_deref(), Some("2 h 45 min"));
    }
}
