//! The end of a live run: it continues while pending messages are being handled.

use crate::engine::work_timer::working_for;
use crate::link::{StageCounter, StageCounters, StageState};
use std::time::{Duration, Instant};

/// The time without progress after which the run counts as stuck.
pub(super) const STUCK_AFTER: Duration = Duration::from_secs(30);

/// The progress of a live run that is ending.
#[derive(Debug)]
pub(super) struct Drain {
    /// The sum of received and sent messages, restarts, and ended stages at the last progress.
    counted: u64,
    progressed: Instant,
}

impl Drain {
    /// A drain for a run whose sources were stopped at `now`.
    pub(super) fn new(now: Instant) -> Self {
        Self { counted: 0, progressed: now }
    }

    /// Checks the stages. Returns whether there was no progress for too long, during which the supervisor was not
    /// suspended (`awake_for`). A stage that works on a message counts as progress: `stall_timeout` limits how long
    /// that may take.
    pub(super) fn is_stuck(&mut self, counters: &[StageCounters], awake_for: Duration, now: Instant) -> bool {
        let count = |counters: &StageCounters| {
            let has_ended = u64::from(counters.state() == StageState::Ended);
            counters.get(StageCounter::MessagesIn)
                + counters.get(StageCounter::Restarts)
                + counters.all_sent()
                + has_ended
        };
        let counted = counters.iter().map(count).sum();
        if counted != self.counted || counters.iter().any(|counters| working_for(counters).is_some()) {
            (self.counted, self.progressed) = (counted, now);
        }
        now.saturating_duration_since(self.progressed).min(awake_for) > STUCK_AFTER
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::SharedCounters;

    #[test]
    fn a_run_is_stuck_when_no_stage_works_receives_sends_or_ends() {
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
        assert!(
            !drain.is_stuck(&counters, Duration::from_secs(1), start + Duration::from_secs(900)),
            "the supervisor was suspended"
        );
    }
}
