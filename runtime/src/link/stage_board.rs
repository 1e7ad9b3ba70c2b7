//! The part of a board that belongs to one stage.

use super::board::{BELL, Board, MAX_SENDERS, Place, WIRE_WORDS};
use super::histogram::Histogram;
use super::protocol::Window;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// How a stage stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StageState {
    /// Nobody has started it, or its process is gone.
    #[default]
    Absent = 0,
    /// It makes its links.
    Starting = 1,
    /// It runs.
    Running = 2,
    /// It is done, and holds nothing of what it was sent.
    Ended = 3,
}

impl StageState {
    /// In a word.
    pub fn word(self) -> &'static str {
        match self {
            Self::Absent => "absent",
            Self::Starting => "starting",
            Self::Running => "running",
            Self::Ended => "ended",
        }
    }
}

/// The place of the state, which is no [`StageNumber`].
const STATE: usize = 1;

/// A number of a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StageNumber {
    /// Of its process.
    Process = 2,
    /// How often it was started again after a failure.
    Restarts = 3,
    /// When it began to run, on the monotonic clock.
    Started = 4,
    /// How many readers of its links have come, and programs that look on.
    Greetings = 5,
    /// How often programs that send as this stage have asked it to take in what they sent.
    Asked = 6,
    /// Messages that it was given.
    MessagesIn = 8,
    /// Nanoseconds that it has worked.
    Busy = 9,
    /// How often it has warned of something.
    Warnings = 10,
    /// Since when it has worked on one message, on the monotonic clock; 0 while it waits.
    WorkingSince = 11,
    /// How many of the askings it has answered.
    Answered = 12,
}

/// A number of one wire of a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WireNumber {
    /// Messages that were taken off the link.
    Taken = 0,
    /// Messages that were dropped because there was no room.
    Dropped = 1,
    /// Messages that were taken off the link and wait in the stage.
    Waiting = 2,
}

/// The part of a board that belongs to one stage.
#[derive(Clone)]
pub struct StageBoard {
    board: Arc<Board>,
    place: Place,
}

impl Board {
    /// The part of a stage.
    pub fn stage(self: &Arc<Self>, stage: usize) -> StageBoard {
        StageBoard { board: Arc::clone(self), place: self.place(stage) }
    }
}

impl StageBoard {
    /// How the stage stands.
    pub fn state(&self) -> StageState {
        let states = [StageState::Absent, StageState::Starting, StageState::Running, StageState::Ended];
        let state = self.stage_word(STATE).load(Ordering::Acquire);
        usize::try_from(state).ok().and_then(|state| states.get(state).copied()).unwrap_or_default()
    }

    /// Notes how the stage stands, and wakes all who may wait for that.
    pub fn set_state(&self, state: StageState) {
        self.stage_word(STATE).store(state as u64, Ordering::Release);
        self.board.ring_all();
    }

    /// Whether the process of the stage runs and takes messages.
    pub(crate) fn is_there(&self) -> bool {
        matches!(self.state(), StageState::Starting | StageState::Running)
    }

    /// A number of the stage.
    pub fn get(&self, number: StageNumber) -> u64 {
        self.stage_word(number as usize).load(Ordering::Relaxed)
    }

    /// Writes a number of the stage.
    pub fn set(&self, number: StageNumber, value: u64) {
        self.stage_word(number as usize).store(value, Ordering::Relaxed);
    }

    /// Adds to a number of the stage. Only for the one who writes it.
    pub fn add(&self, number: StageNumber, value: u64) {
        add(self.stage_word(number as usize), value);
    }

    /// How many wires it has.
    pub fn wires(&self) -> usize {
        self.place.wires
    }

    /// How many output ports it has.
    pub fn ports(&self) -> usize {
        self.place.ports
    }

    /// A number of a wire.
    pub fn get_wire(&self, wire: usize, number: WireNumber) -> u64 {
        self.wire_word(wire, number as usize).load(Ordering::Relaxed)
    }

    /// Writes a number of a wire.
    pub fn set_wire(&self, wire: usize, number: WireNumber, value: u64) {
        self.wire_word(wire, number as usize).store(value, Ordering::Relaxed);
    }

    /// Adds to a number of a wire. Only for the one who writes it.
    pub fn add_wire(&self, wire: usize, number: WireNumber, value: u64) {
        add(self.wire_word(wire, number as usize), value);
    }

    /// Messages that were sent on a port.
    pub fn sent(&self, port: usize) -> u64 {
        self.board.word(self.place.sent(port)).load(Ordering::Relaxed)
    }

    /// Notes messages that were sent on a port. Only for its stage.
    pub fn add_sent(&self, port: usize, messages: u64) {
        add(self.board.word(self.place.sent(port)), messages);
    }

    /// Messages that were sent on all ports.
    pub fn all_sent(&self) -> u64 {
        (0..self.place.ports).map(|port| self.sent(port)).sum()
    }

    /// How many senders have come to a port.
    pub(crate) fn senders(&self, port: usize) -> u64 {
        self.board.word(self.place.senders(port)).load(Ordering::Acquire)
    }

    /// A sender has come to a port.
    pub(crate) fn add_sender(&self, port: usize) {
        self.board.word(self.place.senders(port)).fetch_add(1, Ordering::AcqRel);
    }

    /// A reader of the stage's links has come, or a program that looks on: it is to be sent what it has missed. Gives the
    /// number of the greeting, from 1 on.
    pub(crate) fn greet(&self) -> u64 {
        let before = self.stage_word(StageNumber::Greetings as usize).fetch_add(1, Ordering::AcqRel);
        self.ring();
        before + 1
    }

    /// A program that sends as this stage asks it to take in what was sent. Gives the number of the asking, from 1 on.
    pub(crate) fn ask(&self) -> u64 {
        let before = self.stage_word(StageNumber::Asked as usize).fetch_add(1, Ordering::AcqRel);
        self.ring();
        before + 1
    }

    /// The stage has taken in what was sent before so many askings.
    pub(crate) fn answer(&self, asked: u64) {
        self.set(StageNumber::Answered, asked);
        self.ring();
    }

    /// Whether the stage has answered the asking, or is not there to answer.
    pub(crate) fn has_answered(&self, asked: u64) -> bool {
        !self.is_there() || self.get(StageNumber::Answered) >= asked
    }

    /// Where the stage sleeps, and the programs that send as this stage.
    pub(crate) fn bell(&self) -> &AtomicU64 {
        self.stage_word(BELL)
    }

    /// Wakes the stage, and the programs that send as this stage.
    pub(crate) fn ring(&self) {
        super::protocol::ring(std::iter::once(self.bell()));
    }

    /// The room that a wire gives to the sender in a slot.
    pub(crate) fn window(&self, wire: usize, slot: usize) -> Window<'_, AtomicU64> {
        let word = WIRE_WORDS + 2 * slot;
        Window { origin: self.wire_word(wire, word), limit: self.wire_word(wire, word + 1) }
    }

    /// Which samples of the sender `origin` a wire has room for: those before this. None while it is not connected to it.
    pub(crate) fn limit_of(&self, wire: usize, origin: u64) -> Option<u64> {
        (0..MAX_SENDERS).find_map(|slot| self.window(wire, slot).limit_of(origin))
    }

    /// Counts how long a message took from when it was sent to when the stage had handled it, nanoseconds.
    pub fn add_latency(&self, nanoseconds: u64) {
        add(self.latency_word(Histogram::bucket(nanoseconds)), 1);
    }

    /// How long messages took.
    pub fn latency(&self) -> Histogram {
        Histogram::from_counts(std::array::from_fn(|bucket| self.latency_word(bucket).load(Ordering::Relaxed)))
    }

    /// The process of the stage is gone: nobody is to wait for it.
    pub fn clear(&self) {
        self.set(StageNumber::WorkingSince, 0);
        for wire in 0..self.place.wires {
            self.set_wire(wire, WireNumber::Waiting, 0);
            (0..MAX_SENDERS).for_each(|slot| self.window(wire, slot).give(0, 0));
        }
        self.set_state(StageState::Absent);
    }

    fn stage_word(&self, number: usize) -> &AtomicU64 {
        self.board.word(self.place.stage + number)
    }

    fn wire_word(&self, wire: usize, number: usize) -> &AtomicU64 {
        self.board.word(self.place.wire(wire) + number)
    }

    fn latency_word(&self, bucket: usize) -> &AtomicU64 {
        self.board.word(self.place.latencies() + bucket)
    }
}

/// Adds to a word that one thread writes.
fn add(word: &AtomicU64, value: u64) {
    word.store(word.load(Ordering::Relaxed).wrapping_add(value), Ordering::Relaxed);
}

#[cfg(test)]
mod tests {
    use super::*;

    const STAGES: [(usize, usize); 2] = [(0, 2), (3, 1)];

    #[test]
    fn what_one_process_writes_another_reads_and_no_number_lies_on_another() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("board");
        let written = Board::create(&path, &STAGES).unwrap();
        let read = Board::open(&path, &STAGES).unwrap();
        for stage in 0..2 {
            let board = written.stage(stage);
            board.set_state(StageState::Running);
            board.set(StageNumber::Process, 7 + stage as u64);
            for port in 0..board.ports() {
                board.add_sent(port, 10 + port as u64);
                board.add_sender(port);
            }
            for wire in 0..board.wires() {
                board.add_wire(wire, WireNumber::Taken, 100 + wire as u64);
                board.window(wire, MAX_SENDERS - 1).give(99, 5);
            }
            board.add_latency(1_000);
            board.greet();
        }
        for stage in 0..2 {
            let board = read.stage(stage);
            assert_eq!((board.state(), board.get(StageNumber::Process)), (StageState::Running, 7 + stage as u64));
            assert_eq!((board.get(StageNumber::WorkingSince), board.get(StageNumber::Greetings)), (0, 1));
            (0..board.ports())
                .for_each(|port| assert_eq!((board.sent(port), board.senders(port)), (10 + port as u64, 1)));
            for wire in 0..board.wires() {
                assert_eq!(board.get_wire(wire, WireNumber::Taken), 100 + wire as u64);
                assert_eq!(board.get_wire(wire, WireNumber::Waiting), 0);
                assert_eq!((board.limit_of(wire, 99), board.limit_of(wire, 98)), (Some(5), None));
            }
            assert_eq!(board.latency().count(), 1);
        }
        written.stage(1).clear();
        assert_eq!((read.stage(1).state(), read.stage(1).limit_of(0, 99)), (StageState::Absent, None));
        assert_eq!(read.stage(1).get_wire(2, WireNumber::Taken), 102, "what was counted stays");
    }

    #[test]
    fn a_board_of_another_run_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("board");
        Board::create(&path, &STAGES[..1]).unwrap();
        assert!(Board::open(&path, &STAGES).is_err());
        assert!(Board::create(&path, &STAGES).is_err(), "it is there already");
    }
}
