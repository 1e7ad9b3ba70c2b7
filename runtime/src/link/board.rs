//! The board of a run: what each stage has done and how far it is, in memory that all its threads and processes see.
//!
//! A board is a list of 64-bit numbers, each written by one stage and read by anyone at any time. No reader can hold up a
//! stage, and a process that is killed leaves numbers that can still be read. Four things rest on it: a sender that
//! waits for room learns how far its readers are, a stage sleeps on it and is woken there, a program that looks on learns
//! how the run goes, and a process that takes the place of a killed one counts on from where that one was.

use super::histogram::BUCKETS;
use super::protocol::{Word, ring};
use memmap2::MmapRaw;
use rustix::thread::futex;
use rustix::time::{ClockId, Timespec, clock_gettime};
use std::fs::File;
use std::io::{self, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering, fence};
use std::time::Duration;

/// How many programs may send on a link of a live run: the stage that it belongs to, and those outside of the run.
pub const MAX_SENDERS: usize = 9;

/// So many numbers share a line of a processor's cache. What several stages write begins a line of its own.
const LINE: usize = 8;
/// Numbers of a stage that are there once: a line that others look at often, and one that the stage writes often.
const STAGE_WORDS: usize = 2 * LINE;
/// Numbers of a wire that are there once.
pub(super) const WIRE_WORDS: usize = 3;
/// All numbers of a wire: with two for each sender.
const ALL_WIRE_WORDS: usize = (WIRE_WORDS + 2 * MAX_SENDERS).next_multiple_of(LINE);

/// Where among its numbers a stage has its bell.
pub(super) const BELL: usize = 0;

/// Nanoseconds on the monotonic clock, which is the same for all processes of a machine.
pub fn monotonic_nanoseconds() -> u64 {
    let time = clock_gettime(ClockId::Monotonic);
    let seconds = u64::try_from(time.tv_sec).unwrap_or_default();
    seconds * 1_000_000_000 + u64::try_from(time.tv_nsec).unwrap_or_default()
}

/// Where the numbers of a stage begin: its own, those of its wires, senders by port, messages by port, and latencies.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) stage: usize,
    pub(super) wires: usize,
    pub(super) ports: usize,
}

impl Place {
    pub(super) fn wire(&self, wire: usize) -> usize {
        assert!(wire < self.wires, "a wire that the stage does not have");
        self.stage + STAGE_WORDS + wire * ALL_WIRE_WORDS
    }

    pub(super) fn senders(&self, port: usize) -> usize {
        assert!(port < self.ports, "a port that the stage does not have");
        self.stage + STAGE_WORDS + self.wires * ALL_WIRE_WORDS + port
    }

    pub(super) fn sent(&self, port: usize) -> usize {
        self.senders(port) + self.ports.next_multiple_of(LINE)
    }

    pub(super) fn latencies(&self) -> usize {
        self.stage + STAGE_WORDS + self.wires * ALL_WIRE_WORDS + 2 * self.ports.next_multiple_of(LINE)
    }
}

fn places(stages: &[(usize, usize)]) -> (Vec<Place>, usize) {
    let mut stage = 0;
    let mut places = Vec::with_capacity(stages.len());
    for &(wires, ports) in stages {
        let place = Place { stage, wires, ports };
        stage = (place.latencies() + BUCKETS).next_multiple_of(LINE);
        places.push(place);
    }
    (places, stage)
}

/// Numbers that share a line.
#[derive(Default)]
#[repr(align(64))]
struct Line([AtomicU64; LINE]);

enum Memory {
    /// Of a run whose stages are threads of one process.
    Heap(Vec<Line>),
    /// Of a run of processes.
    Mapped(MmapRaw),
}

/// The board of a run.
pub struct Board {
    memory: Memory,
    places: Vec<Place>,
}

impl Board {
    /// A board for threads of this process, of stages of which each has so many (wires, output ports).
    pub fn new(stages: &[(usize, usize)]) -> Arc<Self> {
        let (places, words) = places(stages);
        let lines = (0..words.div_ceil(LINE)).map(|_| Line::default()).collect();
        Arc::new(Self { memory: Memory::Heap(lines), places })
    }

    /// Makes the file of a board.
    ///
    /// # Errors
    /// There is such a file, or no room for it.
    pub fn create(path: &Path, stages: &[(usize, usize)]) -> io::Result<Arc<Self>> {
        let mut file = File::options().read(true).write(true).create_new(true).mode(0o600).open(path)?;
        let (places, words) = places(stages);
        // Written, and not only made as long: where there is no room, that is an error here, and later a signal.
        file.write_all(&vec![0; words * size_of::<u64>()])?;
        Ok(Arc::new(Self { memory: Memory::Mapped(MmapRaw::map_raw(&file)?), places }))
    }

    /// Opens the board that another process has made for the same stages.
    ///
    /// # Errors
    /// It is not there, or not that of these stages.
    pub fn open(path: &Path, stages: &[(usize, usize)]) -> io::Result<Arc<Self>> {
        let file = File::options().read(true).write(true).open(path)?;
        let (places, words) = places(stages);
        let memory = MmapRaw::map_raw(&file)?;
        match memory.len() >= words * size_of::<u64>() {
            true => Ok(Arc::new(Self { memory: Memory::Mapped(memory), places })),
            false => Err(io::Error::new(io::ErrorKind::InvalidData, "it is smaller than the run's pipeline needs")),
        }
    }

    /// Where the numbers of a stage are.
    pub(super) fn place(&self, stage: usize) -> Place {
        self.places[stage]
    }

    /// Wakes all stages, so that they look at what has changed.
    pub fn ring_all(&self) {
        ring(self.places.iter().map(|place| self.word(place.stage + BELL)));
    }

    #[allow(unsafe_code)]
    pub(super) fn word(&self, word: usize) -> &AtomicU64 {
        match &self.memory {
            Memory::Heap(lines) => &lines[word / LINE].0[word % LINE],
            Memory::Mapped(memory) => {
                assert!(word < memory.len() / size_of::<u64>(), "a place outside of the board");
                // SAFETY: the place lies within the mapping, as was checked, and is aligned, as a mapping begins at a page.
                // The memory lives as long as `self`. Every process accesses it through atomics only, for which any
                // bits are valid.
                unsafe { &*memory.as_mut_ptr().cast::<AtomicU64>().add(word) }
            }
        }
    }
}

impl Word for AtomicU64 {
    fn load(&self, ordering: Ordering) -> u64 {
        self.load(ordering)
    }

    fn store(&self, value: u64, ordering: Ordering) {
        self.store(value, ordering);
    }

    fn fetch_or(&self, bits: u64, ordering: Ordering) -> u64 {
        self.fetch_or(bits, ordering)
    }

    fn compare_exchange(&self, current: u64, new: u64, success: Ordering, failure: Ordering) -> Result<u64, u64> {
        self.compare_exchange(current, new, success, failure)
    }

    fn fence(ordering: Ordering) {
        fence(ordering);
    }

    fn sleep(&self, value: u64, longest: Duration) {
        let longest = Timespec {
            tv_sec: i64::try_from(longest.as_secs()).unwrap_or(i64::MAX),
            tv_nsec: longest.subsec_nanos().into(),
        };
        // An error says that the word has changed, that a signal came, or that the time is over: who sleeps looks again.
        let _ = futex::wait(half(self), futex::Flags::empty(), value as u32, Some(&longest));
    }

    fn wake_all(&self) {
        // The only error is an address that cannot be read.
        let _ = futex::wake(half(self), futex::Flags::empty(), i32::MAX as u32);
    }
}

/// The half of a word in which a ring changes something, by which the system knows who sleeps where.
#[allow(unsafe_code)]
fn half(word: &AtomicU64) -> &AtomicU32 {
    let low = if cfg!(target_endian = "little") { 0 } else { 1 };
    // SAFETY: both halves lie within the word and are aligned. This process never accesses them by themselves: it hands the
    // address to the system, which reads it atomically.
    unsafe { &*std::ptr::from_ref(word).cast::<AtomicU32>().add(low) }
}
