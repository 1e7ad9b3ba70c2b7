//! The shared counters of one stage.

use super::counters::{DOORBELL, MAX_SENDERS, SharedCounters, StageLayout, WIRE_WORDS};
use super::histogram::Histogram;
use super::protocol::Window;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// The state of a stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StageState {
    /// It was not started, or its process is gone.
    #[default]
    Absent = 0,
    /// It creates its links.
    Starting = 1,
    /// It runs.
    Running = 2,
    /// It has finished, and borrows no samples.
    Ended = 3,
}

impl StageState {
    /// The name of the state, as in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Absent => "absent",
            Self::Starting => "starting",
            Self::Running => "running",
            Self::Ended => "ended",
        }
    }
}

/// The index of the state, which is no [`StageCounter`].
const STATE: usize = 1;

/// A counter of a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StageCounter {
    /// The id of its process.
    Process = 2,
    /// How often it was restarted after a failure.
    Restarts = 3,
    /// When it was started, nanoseconds on the monotonic clock.
    Started = 4,
    /// Requests for the history by readers and observers of its links.
    HistoryRequests = 5,
    /// Requests of programs that send as this stage to ingest what they have sent.
    IngestRequests = 6,
    /// Messages that it has received.
    MessagesIn = 8,
    /// Nanoseconds that it has worked.
    Busy = 9,
    /// The number of its warnings.
    Warnings = 10,
    /// When it began to work on the current message, nanoseconds on the monotonic clock; 0 while it waits.
    WorkingSince = 11,
    /// The ingest requests that it has answered.
    IngestsAnswered = 12,
}

/// A counter of one wire of a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WireCounter {
    /// Messages that were taken off the link.
    Taken = 0,
    /// Messages that were dropped because there was no credit.
    Dropped = 1,
    /// Messages that were taken off the link and are pending in the stage.
    Waiting = 2,
}

/// The shared counters of one stage.
#[derive(Clone)]
pub struct StageCounters {
    counters: Arc<SharedCounters>,
    layout: StageLayout,
}

impl SharedCounters {
    /// The counters of a stage.
    pub fn stage(self: &Arc<Self>, stage: usize) -> StageCounters {
        StageCounters { counters: Arc::clone(self), layout: self.layout(stage) }
    }
}

impl StageCounters {
    /// The state of the stage.
    pub fn state(&self) -> StageState {
        let states = [StageState::Absent, StageState::Starting, StageState::Running, StageState::Ended];
        let state = self.stage_word(STATE).load(Ordering::Acquire);
        usize::try_from(state).ok().and_then(|state| states.get(state).copied()).unwrap_or_default()
    }

    /// Sets the state of the stage, and wakes all stages, as any may wait for it.
    pub fn set_state(&self, state: StageState) {
        self.stage_word(STATE).store(state as u64, Ordering::Release);
        self.counters.ring_all();
    }

    /// Whether the process of the stage is running and takes messages.
    pub(crate) fn is_alive(&self) -> bool {
        matches!(self.state(), StageState::Starting | StageState::Running)
    }

    /// The value of a counter.
    pub fn get(&self, number: StageCounter) -> u64 {
        self.stage_word(number as usize).load(Ordering::Relaxed)
    }

    /// Sets a counter.
    pub fn set(&self, number: StageCounter, value: u64) {
        self.stage_word(number as usize).store(value, Ordering::Relaxed);
    }

    /// Adds to a counter. Only for its single writer.
    pub fn add(&self, number: StageCounter, value: u64) {
        add(self.stage_word(number as usize), value);
    }

    /// The number of wires.
    pub fn wires(&self) -> usize {
        self.layout.wires
    }

    /// The number of output ports.
    pub fn ports(&self) -> usize {
        self.layout.ports
    }

    /// The value of a counter of a wire.
    pub fn get_wire(&self, wire: usize, number: WireCounter) -> u64 {
        self.wire_word(wire, number as usize).load(Ordering::Relaxed)
    }

    /// Sets a counter of a wire.
    pub fn set_wire(&self, wire: usize, number: WireCounter, value: u64) {
        self.wire_word(wire, number as usize).store(value, Ordering::Relaxed);
    }

    /// Adds to a counter of a wire. Only for its single writer.
    pub fn add_wire(&self, wire: usize, number: WireCounter, value: u64) {
        add(self.wire_word(wire, number as usize), value);
    }

    /// The number of messages sent on a port.
    pub fn sent(&self, port: usize) -> u64 {
        self.counters.word(self.layout.sent(port)).load(Ordering::Relaxed)
    }

    /// Adds to the messages sent on a port. Only for its stage.
    pub fn add_sent(&self, port: usize, messages: u64) {
        add(self.counters.word(self.layout.sent(port)), messages);
    }

    /// The number of messages sent on all ports.
    pub fn all_sent(&self) -> u64 {
        (0..self.layout.ports).map(|port| self.sent(port)).sum()
    }

    /// The number of senders that have joined a port so far.
    pub(crate) fn senders(&self, port: usize) -> u64 {
        self.counters.word(self.layout.senders(port)).load(Ordering::Acquire)
    }

    /// Counts a sender that has joined a port.
    pub(crate) fn add_sender(&self, port: usize) {
        self.counters.word(self.layout.senders(port)).fetch_add(1, Ordering::AcqRel);
    }

    /// Requests the history of the stage's links, for a reader or an observer that has joined. Returns the number of
    /// the request, counted from 1.
    pub(crate) fn request_history(&self) -> u64 {
        let before = self.stage_word(StageCounter::HistoryRequests as usize).fetch_add(1, Ordering::AcqRel);
        self.ring();
        before + 1
    }

    /// Requests that the stage ingests what was sent, for a program that sends as this stage. Returns the number of the
    /// request, counted from 1.
    pub(crate) fn request_ingest(&self) -> u64 {
        let before = self.stage_word(StageCounter::IngestRequests as usize).fetch_add(1, Ordering::AcqRel);
        self.ring();
        before + 1
    }

    /// Records that the stage has ingested what was sent before that many requests.
    pub(crate) fn set_ingested(&self, requests: u64) {
        self.set(StageCounter::IngestsAnswered, requests);
        self.ring();
    }

    /// Whether the stage has answered an ingest request, or is not running.
    pub(crate) fn has_ingested(&self, request: u64) -> bool {
        !self.is_alive() || self.get(StageCounter::IngestsAnswered) >= request
    }

    /// The doorbell on which the stage sleeps, and the programs that send as this stage.
    pub(crate) fn doorbell(&self) -> &AtomicU64 {
        self.stage_word(DOORBELL)
    }

    /// Wakes the stage, and the programs that send as this stage.
    pub(crate) fn ring(&self) {
        super::protocol::ring(std::iter::once(self.doorbell()));
    }

    /// The window of a wire in a slot: the credit of one sender.
    pub(crate) fn window(&self, wire: usize, slot: usize) -> Window<'_, AtomicU64> {
        let word = WIRE_WORDS + 2 * slot;
        Window { origin: self.wire_word(wire, word), limit: self.wire_word(wire, word + 1) }
    }

    /// The number of the first sample of the sender `origin` for which a wire has no credit; none while it is not
    /// connected.
    pub(crate) fn limit_of(&self, wire: usize, origin: u64) -> Option<u64> {
        (0..MAX_SENDERS).find_map(|slot| self.window(wire, slot).limit_of(origin))
    }

    /// Counts a latency: the time from sending a message to the stage having handled it, nanoseconds.
    pub fn add_latency(&self, nanoseconds: u64) {
        add(self.latency_word(Histogram::bucket(nanoseconds)), 1);
    }

    /// The latencies of all messages.
    pub fn latency(&self) -> Histogram {
        Histogram::from_counts(std::array::from_fn(|bucket| self.latency_word(bucket).load(Ordering::Relaxed)))
    }

    /// Resets the stage after its process is gone, so that nobody waits for it.
    pub fn clear(&self) {
        self.set(StageCounter::WorkingSince, 0);
        for wire in 0..self.layout.wires {
            self.set_wire(wire, WireCounter::Waiting, 0);
            (0..MAX_SENDERS).for_each(|slot| self.window(wire, slot).assign(0, 0));
        }
        self.set_state(StageState::Absent);
    }

    fn stage_word(&self, number: usize) -> &AtomicU64 {
        self.counters.word(self.layout.stage + number)
    }

    fn wire_word(&self, wire: usize, number: usize) -> &AtomicU64 {
        self.counters.word(self.layout.wire(wire) + number)
    }

    fn latency_word(&self, bucket: usize) -> &AtomicU64 {
        self.counters.word(self.layout.latencies() + bucket)
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
    fn another_process_reads_what_was_written_and_no_numbers_overlap() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("counters");
        let written = SharedCounters::create(&path, &STAGES).unwrap();
        let read = SharedCounters::open(&path, &STAGES).unwrap();
        for stage in 0..2 {
            let counters = written.stage(stage);
            counters.set_state(StageState::Running);
            counters.set(StageCounter::Process, 7 + stage as u64);
            for port in 0..counters.ports() {
                counters.add_sent(port, 10 + port as u64);
                counters.add_sender(port);
            }
            for wire in 0..counters.wires() {
                counters.add_wire(wire, WireCounter::Taken, 100 + wire as u64);
                counters.window(wire, MAX_SENDERS - 1).assign(99, 5);
            }
            counters.add_latency(1_000);
            counters.request_history();
        }
        for stage in 0..2 {
            let counters = read.stage(stage);
            assert_eq!(
                (counters.state(), counters.get(StageCounter::Process)),
                (StageState::Running, 7 + stage as u64)
            );
            assert_eq!((counters.get(StageCounter::WorkingSince), counters.get(StageCounter::HistoryRequests)), (0, 1));
            (0..counters.ports())
                .for_each(|port| assert_eq!((counters.sent(port), counters.senders(port)), (10 + port as u64, 1)));
            for wire in 0..counters.wires() {
                assert_eq!(counters.get_wire(wire, WireCounter::Taken), 100 + wire as u64);
                assert_eq!(counters.get_wire(wire, WireCounter::Waiting), 0);
                assert_eq!((counters.limit_of(wire, 99), counters.limit_of(wire, 98)), (Some(5), None));
            }
            assert_eq!(counters.latency().count(), 1);
        }
        written.stage(1).clear();
        assert_eq!((read.stage(1).state(), read.stage(1).limit_of(0, 99)), (StageState::Absent, None));
        assert_eq!(read.stage(1).get_wire(2, WireCounter::Taken), 102, "counts are not reset");
    }

    #[test]
    fn counters_of_another_size_are_rejected() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("counters");
        SharedCounters::create(&path, &STAGES[..1]).unwrap();
        assert!(SharedCounters::open(&path, &STAGES).is_err());
        assert!(SharedCounters::create(&path, &STAGES).is_err(), "the file exists");
    }
}
