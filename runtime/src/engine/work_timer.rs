//! The working time of a stage, for statistics and the detection of hanging stages.

use crate::link::Sleeper;
use crate::link::{StageCounter, StageCounters, monotonic_nanoseconds};
use std::rc::Rc;
use std::time::Duration;

/// Measures the working time of a stage, and publishes it in the shared counters: the start of the work on the current
/// message, and the total.
pub(super) struct WorkTimer {
    counters: StageCounters,
    sleeper: Rc<Sleeper>,
    /// When the work on the current message began, nanoseconds on the monotonic clock; 0 while the stage waits.
    since: u64,
    /// The time that the stage had waited for credit before that.
    waited: Duration,
}

impl WorkTimer {
    pub(super) fn new(counters: StageCounters, sleeper: Rc<Sleeper>) -> Self {
        Self { counters, sleeper, since: 0, waited: Duration::ZERO }
    }

    /// Starts the timer, if it is not running.
    pub(super) fn begin(&mut self) {
        if self.since == 0 {
            self.set_since(monotonic_nanoseconds());
        }
    }

    /// Adds the working time since the last message, and restarts the timer. Returns the monotonic time, nanoseconds.
    pub(super) fn finish_message(&mut self) -> u64 {
        let time = monotonic_nanoseconds();
        let waited = self.sleeper.waited().saturating_sub(self.waited);
        let worked = time.saturating_sub(self.since).saturating_sub(waited.as_nanos() as u64);
        self.counters.add(StageCounter::Busy, worked);
        self.waited += waited;
        self.set_since(time);
        time
    }

    /// Stops the timer: the stage waits for others.
    pub(super) fn end(&mut self) {
        self.set_since(0);
    }

    fn set_since(&mut self, since: u64) {
        self.since = since;
        self.counters.set(StageCounter::WorkingSince, since);
    }
}

/// The time that a stage has worked on its current message; none while it waits.
pub(super) fn working_for(counters: &StageCounters) -> Option<Duration> {
    match counters.get(StageCounter::WorkingSince) {
        0 => None,
        since => Some(Duration::from_nanos(monotonic_nanoseconds().saturating_sub(since))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::Control;
    use crate::link::SharedCounters;
    use std::sync::Arc;

    #[test]
    fn waiting_does_not_count_as_work() {
        let counters = SharedCounters::new(&[(0, 0)]).stage(0);
        let sleeper = Rc::new(Sleeper::new(counters.clone(), Arc::new(Control::default())));
        let mut work = WorkTimer::new(counters.clone(), sleeper);
        assert_eq!(working_for(&counters), None);
        let begin = monotonic_nanoseconds();
        work.begin();
        assert!(working_for(&counters).is_some());
        work.begin();
        let end = work.finish_message();
        assert!(counters.get(StageCounter::Busy) <= end - begin);
        work.end();
        assert_eq!(working_for(&counters), None);
    }
}
