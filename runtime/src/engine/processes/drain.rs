//! The end of a live run: it goes on for as long as what is on its way is handled.

use crate::engine::work_timer::working_for;
use crate::link::{StageCounters, StageCounter, StageState};
use std::time::{Duration, Instant};

/// Nothing moves in the run for this long: it will not come to its end by itself.
pub(super) const STUCK_AFTER: Duration = Duration::from_secs(30);

/// A live run that comes to its end.
#[derive(Debug)]
pub(super) struct Drain {
    /// Messages that were taken and sent, restarts, and stages that have ended, when it last moved.
    counted: u64,
    moved: Instant,
}

impl Drain {
    /// The sources are told at `now` to send no more.
    pub(super) fn new(now: Instant) -> Self {
        Self { counted: 0, moved: now }
    }

    /// Looks at the stages. Gives whether nothing has moved for too long, of which the supervisor was awake for
    /// `awake_for`. A stage that works moves, even if it has no message done: how long it may take is for the pipeline to
    /// say.
    pub(super) fn is_stuck(&mut self, counters: &[StageCounters], awake_for: Duration, now: Instant) -> bool {
        let count = |counters: &StageCounters| {
            let has_ended = u64::from(counters.state() == StageState::Ended);
            counters.get(StageCounter::MessagesIn) + counters.get(StageCounter::Restarts) + counters.all_sent() + has_ended
        };
        let counted = counters.iter().map(count).sum();
        if counted != self.counted || counters.iter().any(|counters| working_for(counters).is_some()) {
            (self.counted, self.moved) = (counted, now);
        }
        now.saturating_duration_since(self.moved).min(awake_for) > STUCK_AFTER
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::SharedCounters;

    #[test]
    fn a_run_is_stuck_when_no_stage_works_takes_sends_or_ends() {
        let counters = SharedCounters::new(&[(1, 1), (0, 0)]);
        let counters = [counters.stage(0), counters.stage(1)];
        let start = Instant::now();
        let mut drain = Drain::new(start);
        let mut seconds = 0;
        let mut after_20_s = |change: &dyn Fn()| {
            change();
            seconds += 20;
            drain.is_stuck(&counters, Duration::MAX, start + Duration::from_secs(seconds))
        };
        assert!(!after_20_s(&|| ()));
        let moves: [&dyn Fn(); 5] = [
            &|| counters[0].add(StageCounter::MessagesIn, 1),
            &|| counters[0].add_sent(0, 1),
            &|| counters[1].add(StageCounter::Restarts, 1),
            &|| counters[1].set_state(StageState::Ended),
            &|| counters[0].set(StageCounter::WorkingSince, 7),
        ];
        for change in moves {
            assert!(!after_20_s(change));
        }
        counters[0].set(StageCounter::WorkingSince, 0);
        assert!(!after_20_s(&|| ()));
        assert!(after_20_s(&|| ()));
        assert!(!drain.is_stuck(&counters, Duration::from_secs(1), start + Duration::from_secs(900)), "it was halted");
    }
}
