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

/// On a terminal the time that has passed is shown anew so often.
const TICK: Duration = Duration::from_secs(1);
/// Before so much time has passed nothing is said of what is to come, nor of how fast it goes.
const FIRST_GUESS: Duration = Duration::from_secs(1);

/// Shows a share, what stands beside it, and how long the rest will take if it goes on so.
pub(crate) struct Gauge {
    begin: Instant,
    bar: Option<ProgressBar>,
    last_line: Mutex<Instant>,
}

impl Gauge {
    /// At its beginning. On a terminal it is a bar, if that is wanted.
    pub(crate) fn new(with_bar: bool) -> Self {
        let bar = (with_bar && std::io::stderr().is_terminal()).then(|| {
            let style = ProgressStyle::with_template("{bar:20} {percent:>3} %, {elapsed}  {wide_msg}");
            let bar = ProgressBar::new(STEPS as u64).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            // A small log is read before there is anything to show, and the work on it takes longer.
            bar.set_message("at work");
            bar.enable_steady_tick(TICK);
            bar
        });
        Self { begin: Instant::now(), bar, last_line: Mutex::new(Instant::now()) }
    }

    /// How often something has happened in a second, so far.
    pub(crate) fn rate(&self, count: f64) -> Option<f64> {
        let elapsed = self.begin.elapsed();
        (elapsed >= FIRST_GUESS).then(|| count / elapsed.as_secs_f64())
    }

    /// Shows a share, 0 to 1.
    pub(crate) fn show(&self, share: f64, at: impl Display) {
        let left = time_left(self.begin.elapsed(), share).map_or_else(String::new, |left| format!(", {left} left"));
        if let Some(bar) = &self.bar {
            bar.set_position((share * STEPS) as u64);
            bar.set_message(format!("{at}{left}"));
            return;
        }
        let Ok(mut last_line) = self.last_line.lock() else { return };
        if last_line.elapsed() >= LINE_INTERVAL {
            *last_line = Instant::now();
            say(format_args!("{:.0} %, {at}{left}", share * 100.0));
        }
    }

    /// Takes the bar away.
    pub(crate) fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// How long the rest takes if it goes on as it did; nothing as long as too little is done to tell.
fn time_left(elapsed: Duration, share: f64) -> Option<String> {
    if elapsed < FIRST_GUESS || !(0.01..1.0).contains(&share) {
        return None;
    }
    let seconds = (elapsed.as_secs_f64() * (1.0 - share) / share).ceil() as u64;
    Some(match (seconds / 3600, seconds / 60 % 60, seconds % 60) {
        (0, 0, seconds) => format!("{seconds} s"),
        (0, minutes, seconds) => format!("{minutes} min {seconds} s"),
        (hours, minutes, _) => format!("{hours} h {minutes} min"),
    })
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
    fn progress(&self, _: &str, share: f64, log_time: LogTime) {
        let start = LogTime(self.start.fetch_min(log_time.0, Ordering::Relaxed).min(log_time.0));
        let seconds = log_time.seconds_since(start);
        let rate = self.gauge.rate(seconds).map_or_else(String::new, |rate| format!(", {rate:.1} times real time"));
        self.gauge.show(share, format_args!("{seconds:.0} s of the log{rate}"));
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_is_told_once_there_is_something_to_tell_it_by() {
        let left = |seconds: f64, share: f64| time_left(Duration::from_secs_f64(seconds), share);
        assert_eq!(left(0.5, 0.5), None);
        assert_eq!((left(5.0, 0.0), left(5.0, 1.0), left(5.0, f64::NAN)), (None, None, None));
        assert_eq!(left(10.0, 0.5).as_deref(), Some("10 s"));
        assert_eq!(left(10.0, 0.1).as_deref(), Some("1 min 30 s"));
        assert_eq!(left(100.0, 0.01).as_deref(), Some("2 h 45 min"));
    }
}
