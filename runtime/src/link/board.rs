//! The board of a run: what each stage has done and how far it is, in memory that all processes of the run see.
//!
//! A board is a list of 64-bit numbers, each written by one stage and read by anyone at any time. No reader can hold up a
//! stage, and a process that is killed leaves numbers that can still be read. Three things rest on it: a sender that
//! waits for room learns how far its readers are, a program that looks on learns how the run goes, and a process that
//! takes the place of a killed one counts on from where that one was.

use super::histogram::{BUCKETS, Histogram};
use memmap2::MmapRaw;
use rustix::time::{ClockId, clock_gettime};
use std::fs::File;
use std::io::{self, Write};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// How many programs may send on a live link: the stage that it belongs to, and those outside of the run.
pub const MAX_SENDERS: usize = 9;

/// The number that a reader expects of a sender that it is connected to and of which nothing has come.
pub const NOTHING_HEARD: u64 = u64::MAX;

/// Numbers of a stage that are there once.
const STAGE_WORDS: usize = 8;
/// Numbers of a wire that are there once.
const WIRE_WORDS: usize = 4;
/// All numbers of a wire: with two for each sender.
const ALL_WIRE_WORDS: usize = WIRE_WORDS + 2 * MAX_SENDERS;

/// Nanoseconds on the monotonic clock, which is the same for all processes of a machine.
pub fn monotonic_nanoseconds() -> u64 {
    let time = clock_gettime(ClockId::Monotonic);
    let seconds = u64::try_from(time.tv_sec).unwrap_or_default();
    seconds * 1_000_000_000 + u64::try_from(time.tv_nsec).unwrap_or_default()
}

/// How a stage stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StageState {
    /// Nobody has started it, or its process is gone.
    #[default]
    Absent,
    /// It makes its links.
    Starting,
    /// It runs.
    Running,
    /// It is done.
    Ended,
}

/// A number of a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StageNumber {
    /// Of its process.
    Process = 1,
    /// Messages that it was given.
    MessagesIn = 2,
    /// Nanoseconds that it has worked.
    Busy = 3,
    /// How often it was started again after a failure.
    Restarts = 4,
    /// How often it has warned of something.
    Warnings = 5,
    /// When it began to run, on the monotonic clock.
    Started = 6,
    /// Since when it has worked on one message, on the monotonic clock; 0 while it waits.
    WorkingSince = 7,
}

/// The number in the first place.
const STATE: usize = 0;

/// A number of one wire of a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WireNumber {
    /// Messages that were taken off the link.
    Taken = 0,
    /// Messages that were dropped because there was no room.
    Dropped = 1,
    /// Messages that were taken off the link and wait in the stage.
    Waiting = 2,
    /// 1 while the owner of the link waits for room, and is to be woken.
    OwnerWaits = 3,
}

/// Where the numbers of a stage begin.
#[derive(Clone, Copy, Debug)]
struct Place {
    start: usize,
    wires: usize,
    ports: usize,
}

/// The board of a run.
pub struct Board {
    memory: MmapRaw,
    places: Vec<Place>,
}

impl Board {
    /// Makes the file of a board for stages of which each has so many (wires, output ports).
    pub fn create(path: &Path, stages: &[(usize, usize)]) -> io::Result<Arc<Self>> {
        let mut file = File::options().read(true).write(true).create_new(true).open(path)?;
        let (places, words) = places(stages);
        // Written, and not only made as long: where there is no room, that is an error here, and later a signal.
        file.write_all(&vec![0; words * size_of::<u64>()])?;
        Ok(Arc::new(Self { memory: MmapRaw::map_raw(&file)?, places }))
    }

    /// Opens the board that another process has made for the same stages.
    pub fn open(path: &Path, stages: &[(usize, usize)]) -> io::Result<Arc<Self>> {
        let file = File::options().read(true).write(true).open(path)?;
        let (places, words) = places(stages);
        let memory = MmapRaw::map_raw(&file)?;
        match memory.len() >= words * size_of::<u64>() {
            true => Ok(Arc::new(Self { memory, places })),
            false => Err(io::Error::new(io::ErrorKind::InvalidData, "it is smaller than the run's pipeline needs")),
        }
    }

    /// The part of a stage.
    pub fn stage(self: &Arc<Self>, stage: usize) -> StageBoard {
        StageBoard { board: Arc::clone(self), place: self.places[stage] }
    }

    #[allow(unsafe_code)]
    fn word(&self, word: usize) -> &AtomicU64 {
        assert!(word < self.memory.len() / size_of::<u64>(), "a place outside of the board");
        // SAFETY: the place lies within the mapping, as was checked, and is aligned, as a mapping begins at a page. The
        // memory lives as long as `self`. Every process accesses it through atomics only, for which any bits are valid.
        unsafe { &*self.memory.as_mut_ptr().cast::<AtomicU64>().add(word) }
    }
}

fn places(stages: &[(usize, usize)]) -> (Vec<Place>, usize) {
    let mut start = 0;
    let mut places = Vec::with_capacity(stages.len());
    for &(wires, ports) in stages {
        places.push(Place { start, wires, ports });
        start += STAGE_WORDS + wires * ALL_WIRE_WORDS + ports + BUCKETS;
    }
    (places, start)
}

/// The part of a board that belongs to one stage.
#[derive(Clone)]
pub struct StageBoard {
    board: Arc<Board>,
    place: Place,
}

impl StageBoard {
    /// How the stage stands.
    pub fn state(&self) -> StageState {
        match self.stage_word(STATE).load(Ordering::Acquire) {
            1 => StageState::Starting,
            2 => StageState::Running,
            3 => StageState::Ended,
            _ => StageState::Absent,
        }
    }

    /// Notes how the stage stands.
    pub fn set_state(&self, state: StageState) {
        let number = match state {
            StageState::Absent => 0,
            StageState::Starting => 1,
            StageState::Running => 2,
            StageState::Ended => 3,
        };
        self.stage_word(STATE).store(number, Ordering::Release);
    }

    /// A number of the stage.
    pub fn get(&self, number: StageNumber) -> u64 {
        self.stage_word(number as usize).load(Ordering::Relaxed)
    }

    /// Writes a number of the stage.
    pub fn set(&self, number: StageNumber, value: u64) {
        self.stage_word(number as usize).store(value, Ordering::Relaxed);
    }

    /// Adds to a number of the stage.
    pub fn add(&self, number: StageNumber, value: u64) {
        self.stage_word(number as usize).fetch_add(value, Ordering::Relaxed);
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

    /// Adds to a number of a wire.
    pub fn add_wire(&self, wire: usize, number: WireNumber, value: u64) {
        self.wire_word(wire, number as usize).fetch_add(value, Ordering::Relaxed);
    }

    /// Messages that were sent on a port.
    pub fn sent(&self, port: usize) -> u64 {
        self.port_word(port).load(Ordering::Relaxed)
    }

    /// Notes messages that were sent on a port.
    pub fn add_sent(&self, port: usize, messages: u64) {
        self.port_word(port).fetch_add(messages, Ordering::Relaxed);
    }

    /// Writes how many messages were sent on a port.
    pub fn set_sent(&self, port: usize, messages: u64) {
        self.port_word(port).store(messages, Ordering::Relaxed);
    }

    /// Messages that were sent on all ports.
    pub fn all_sent(&self) -> u64 {
        (0..self.place.ports).map(|port| self.sent(port)).sum()
    }

    /// Which number of the sender `origin` the reader of a wire expects next; none while it is not connected to it.
    pub fn next_of(&self, wire: usize, origin: u64) -> Option<u64> {
        (0..MAX_SENDERS).find_map(|slot| {
            let matches = self.wire_word(wire, WIRE_WORDS + 2 * slot).load(Ordering::Acquire) == origin;
            matches.then(|| self.wire_word(wire, WIRE_WORDS + 2 * slot + 1).load(Ordering::Acquire))
        })
    }

    /// Notes which number of the sender in a slot is expected next.
    pub fn set_next(&self, wire: usize, slot: usize, next: u64) {
        self.wire_word(wire, WIRE_WORDS + 2 * slot + 1).store(next, Ordering::Release);
    }

    /// Gives a slot to a sender, or to nobody (0), which then expects the number `next`.
    pub fn set_origin(&self, wire: usize, slot: usize, origin: u64, next: u64) {
        // The old sender must not find the number of the new one.
        self.wire_word(wire, WIRE_WORDS + 2 * slot).store(0, Ordering::Release);
        self.set_next(wire, slot, next);
        self.wire_word(wire, WIRE_WORDS + 2 * slot).store(origin, Ordering::Release);
    }

    /// Counts how long a message took from when it was sent to when the stage had handled it, nanoseconds.
    pub fn add_latency(&self, nanoseconds: u64) {
        self.bucket_word(Histogram::bucket(nanoseconds)).fetch_add(1, Ordering::Relaxed);
    }

    /// How long messages took.
    pub fn latency(&self) -> Histogram {
        Histogram::from_counts(std::array::from_fn(|bucket| self.bucket_word(bucket).load(Ordering::Relaxed)))
    }

    /// The process of the stage is gone: nobody is to wait for it.
    pub fn clear(&self) {
        self.set_state(StageState::Absent);
        self.set(StageNumber::WorkingSince, 0);
        for wire in 0..self.place.wires {
            self.set_wire(wire, WireNumber::Waiting, 0);
            self.set_wire(wire, WireNumber::OwnerWaits, 0);
            (0..MAX_SENDERS).for_each(|slot| self.set_origin(wire, slot, 0, 0));
        }
    }

    fn stage_word(&self, number: usize) -> &AtomicU64 {
        self.board.word(self.place.start + number)
    }

    fn wire_word(&self, wire: usize, number: usize) -> &AtomicU64 {
        assert!(wire < self.place.wires, "a wire that the stage does not have");
        self.board.word(self.place.start + STAGE_WORDS + wire * ALL_WIRE_WORDS + number)
    }

    fn port_word(&self, port: usize) -> &AtomicU64 {
        assert!(port < self.place.ports, "a port that the stage does not have");
        self.board.word(self.place.start + STAGE_WORDS + self.place.wires * ALL_WIRE_WORDS + port)
    }

    fn bucket_word(&self, bucket: usize) -> &AtomicU64 {
        let before = STAGE_WORDS + self.place.wires * ALL_WIRE_WORDS + self.place.ports;
        self.board.word(self.place.start + before + bucket)
    }
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
            (0..board.ports()).for_each(|port| board.add_sent(port, 10 + port as u64));
            for wire in 0..board.wires() {
                board.add_wire(wire, WireNumber::Taken, 100 + wire as u64);
                board.set_origin(wire, MAX_SENDERS - 1, 99, 5);
            }
            board.add_latency(1_000);
        }
        for stage in 0..2 {
            let board = read.stage(stage);
            assert_eq!((board.state(), board.get(StageNumber::Process)), (StageState::Running, 7 + stage as u64));
            assert_eq!(board.get(StageNumber::WorkingSince), 0);
            (0..board.ports()).for_each(|port| assert_eq!(board.sent(port), 10 + port as u64));
            for wire in 0..board.wires() {
                assert_eq!(board.get_wire(wire, WireNumber::Taken), 100 + wire as u64);
                assert_eq!(board.get_wire(wire, WireNumber::Waiting), 0);
                assert_eq!((board.next_of(wire, 99), board.next_of(wire, 98)), (Some(5), None));
            }
            assert_eq!(board.latency().count(), 1);
        }
        written.stage(1).clear();
        assert_eq!((read.stage(1).state(), read.stage(1).next_of(0, 99)), (StageState::Absent, None));
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
