//! How a stage sleeps, and how it learns that it should not go on.

use super::LinkError;
use super::board::{Board, monotonic_nanoseconds};
use super::protocol;
use super::stage_board::{StageBoard, StageNumber};
use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// After this long asleep a stage looks at its links again. Nothing depends on it; it bounds the harm that a process does
/// which is killed after it has rung a bell and before it has woken who sleeps there.
const LONGEST_SLEEP: Duration = Duration::from_secs(1);

/// What the stages of one process are told from outside.
#[derive(Debug, Default)]
pub struct Control {
    stopped: AtomicBool,
    draining: AtomicBool,
}

impl Control {
    /// The run is being stopped.
    pub fn stop(&self, board: &Board) {
        self.stopped.store(true, Ordering::Release);
        board.ring_all();
    }

    /// A live run is to come to its end: sources send no more.
    pub fn drain(&self, board: &Board) {
        self.draining.store(true, Ordering::Release);
        board.ring_all();
    }

    /// Whether a live run is to come to its end.
    pub(crate) fn is_draining(&self) -> bool {
        self.draining.load(Ordering::Acquire)
    }
}

/// What a stage sleeps on, or a program that sends as that stage.
pub struct Sleeper {
    board: StageBoard,
    control: Arc<Control>,
    /// How long it has slept in the midst of its work, for want of room.
    waited: Cell<Duration>,
}

impl Sleeper {
    /// Sleeps at the bell of a stage.
    pub fn new(board: StageBoard, control: Arc<Control>) -> Self {
        Self { board, control, waited: Cell::default() }
    }

    /// What the stage shows of itself.
    pub(crate) fn board(&self) -> &StageBoard {
        &self.board
    }

    /// What the stage is told from outside.
    pub(crate) fn control(&self) -> &Control {
        &self.control
    }

    /// How long it has slept in the midst of its work, for want of room.
    pub(crate) fn waited(&self) -> Duration {
        self.waited.get()
    }

    /// An error if the run is being stopped.
    pub(crate) fn check(&self) -> Result<(), LinkError> {
        match self.control.stopped.load(Ordering::Acquire) {
            true => Err(LinkError::Stopped),
            false => Ok(()),
        }
    }

    /// Sleeps until `is_ready`. Whoever changes what that depends on must ring the bell afterwards.
    pub(crate) fn wait(&self, is_ready: impl FnMut() -> Result<bool, LinkError>) -> Result<(), LinkError> {
        self.wait_until(None, is_ready).map(|_| ())
    }

    /// Sleeps until `is_ready`, or until the time has come. Gives whether it is ready.
    pub(crate) fn wait_until(
        &self,
        end: Option<Instant>,
        mut is_ready: impl FnMut() -> Result<bool, LinkError>,
    ) -> Result<bool, LinkError> {
        self.check()?;
        if is_ready()? {
            return Ok(true);
        }
        let working_since = self.board.get(StageNumber::WorkingSince);
        let begin = Instant::now();
        if working_since != 0 {
            self.board.set(StageNumber::WorkingSince, 0);
        }
        let result = self.sleep_until(end, &mut is_ready);
        if working_since != 0 {
            self.board.set(StageNumber::WorkingSince, monotonic_nanoseconds());
            self.waited.set(self.waited.get() + begin.elapsed());
        }
        result
    }

    fn sleep_until(
        &self,
        end: Option<Instant>,
        is_ready: &mut dyn FnMut() -> Result<bool, LinkError>,
    ) -> Result<bool, LinkError> {
        let mut ready = false;
        loop {
            let longest = end.map_or(LONGEST_SLEEP, |end| end.saturating_duration_since(Instant::now()));
            protocol::sleep(self.board.bell(), longest.min(LONGEST_SLEEP), || {
                self.check()?;
                ready = is_ready()?;
                Ok::<_, LinkError>(ready)
            })?;
            if ready || longest.is_zero() {
                return Ok(ready);
            }
        }
    }
}
