//! How long a stage works, for those who look on.

use crate::link::Sleeper;
use crate::link::{StageCounters, StageCounter, monotonic_nanoseconds};
use std::rc::Rc;
use std::time::Duration;

/// Notes on the counters since when the stage has worked on one message, and how long it has worked in all.
pub(super) struct WorkTimer {
    counters: StageCounters,
    sleeper: Rc<Sleeper>,
    /// When the work on this message began; 0 while the stage waits.
    since: u64,
    /// How long the stage had waited for room when it began.
    waited: Duration,
}

impl WorkTimer {
    pub(super) fn new(counters: StageCounters, sleeper: Rc<Sleeper>) -> Self {
        Self { counters, sleeper, since: 0, waited: Duration::ZERO }
    }

    /// The stage begins to work on a message, or goes on with the next.
    pub(super) fn begin(&mut self) {
        if self.since == 0 {
            self.set_since(monotonic_nanoseconds());
        }
    }

    /// The stage has done one message. Gives the time.
    pub(super) fn note(&mut self) -> u64 {
        let time = monotonic_nanoseconds();
        let waited = self.sleeper.waited().saturating_sub(self.waited);
        let worked = time.saturating_sub(self.since).saturating_sub(waited.as_nanos() as u64);
        self.counters.add(StageCounter::Busy, worked);
        self.waited += waited;
        self.set_since(time);
        time
    }

    /// The stage waits for others.
    pub(super) fn end(&mut self) {
        self.set_since(0);
    }

    fn set_since(&mut self, since: u64) {
        self.since = since;
        self.counters.set(StageCounter::WorkingSince, since);
    }
}

/// For how long a stage has worked on one message; nothing while it waits.
pub(super) fn working_for(counters: &StageCounters) -> Option<Duration> {
    match counters.get(StageCounter::WorkingSince) {
        0 => None,
        since => Some(Duration::from_nanos(monotonic_nanoseconds().saturating_sub(since))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::SharedCounters;
    use crate::link::Control;
    use std::sync::Arc;

    #[test]
    fn only_work_without_a_pause_counts() {
        let counters = SharedCounters::new(&[(0, 0)]).stage(0);
        let sleeper = Rc::new(Sleeper::new(counters.clone(), Arc::new(Control::default())));
        let mut work = WorkTimer::new(counters.clone(), sleeper);
        assert_eq!(working_for(&counters), None);
        let begin = monotonic_nanoseconds();
        work.begin();
        assert!(working_for(&counters).is_some());
        work.begin();
        let end = work.note();
        assert!(counters.get(StageCounter::Busy) <= end - begin);
        work.end();
        assert_eq!(working_for(&counters), None);
    }
}
