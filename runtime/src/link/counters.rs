//! The shared counters of a run: the state and progress of each stage, in memory that all threads and processes of the
//! run share.
//!
//! They are a list of 64-bit numbers, each written by one stage and readable by anyone at any time. No reader can block
//! a stage, and the numbers of a killed process remain readable. They have four uses: a sender that waits for credit
//! sees how far its readers are, a stage sleeps on its doorbell and is woken through it, an observer sees the progress
//! of the run, and a restarted process continues the counts of the killed one.

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

/// The maximum number of senders of a link of a live run: its stage, and programs outside of the run.
pub const MAX_SENDERS: usize = 9;

/// The numbers in a cache line. Numbers that different stages write never share one.
const LINE: usize = 8;
/// The fixed numbers of a stage: a line that others read often, and a line that the stage writes often.
const STAGE_WORDS: usize = 2 * LINE;
/// The fixed numbers of a wire.
pub(super) const WIRE_WORDS: usize = 3;
/// All numbers of a wire: the fixed ones, and two for each sender.
const ALL_WIRE_WORDS: usize = (WIRE_WORDS + 2 * MAX_SENDERS).next_multiple_of(LINE);

/// The index of a stage's doorbell among its numbers.
pub(super) const DOORBELL: usize = 0;

/// The monotonic clock, which all processes of a machine share, nanoseconds.
pub fn monotonic_nanoseconds() -> u64 {
    let time = clock_gettime(ClockId::Monotonic);
    let seconds = u64::try_from(time.tv_sec).unwrap_or_default();
    seconds * 1_000_000_000 + u64::try_from(time.tv_nsec).unwrap_or_default()
}

/// Offsets of the numbers of a stage: its fixed ones, those of its wires, senders by port, messages by port, and
/// latencies.
#[derive(Clone, Copy, Debug)]
pub(super) struct StageLayout {
    pub(super) stage: usize,
    pub(super) wires: usize,
    pub(super) ports: usize,
}

impl StageLayout {
    pub(super) fn wire(&self, wire: usize) -> usize {
        assert!(wire < self.wires, "the stage has no such wire");
        self.stage + STAGE_WORDS + wire * ALL_WIRE_WORDS
    }

    pub(super) fn senders(&self, port: usize) -> usize {
        assert!(port < self.ports, "the stage has no such port");
        self.stage + STAGE_WORDS + self.wires * ALL_WIRE_WORDS + port
    }

    pub(super) fn sent(&self, port: usize) -> usize {
        self.senders(port) + self.ports.next_multiple_of(LINE)
    }

    pub(super) fn latencies(&self) -> usize {
        self.stage + STAGE_WORDS + self.wires * ALL_WIRE_WORDS + 2 * self.ports.next_multiple_of(LINE)
    }
}

fn layouts(stages: &[(usize, usize)]) -> (Vec<StageLayout>, usize) {
    let mut stage = 0;
    let mut layouts = Vec::with_capacity(stages.len());
    for &(wires, ports) in stages {
        let layout = StageLayout { stage, wires, ports };
        stage = (layout.latencies() + BUCKETS).next_multiple_of(LINE);
        layouts.push(layout);
    }
    (layouts, stage)
}

/// A cache line of numbers.
#[derive(Default)]
#[repr(align(64))]
struct Line([AtomicU64; LINE]);

enum Memory {
    /// For a run whose stages are threads of one process.
    Heap(Vec<Line>),
    /// For a run of several processes.
    Mapped(MmapRaw),
}

/// The shared counters of a run.
pub struct SharedCounters {
    memory: Memory,
    layouts: Vec<StageLayout>,
}

impl SharedCounters {
    /// Counters for threads of this process; each stage has the given numbers of (wires, output ports).
    pub fn new(stages: &[(usize, usize)]) -> Arc<Self> {
        let (layouts, words) = layouts(stages);
        let lines = (0..words.div_ceil(LINE)).map(|_| Line::default()).collect();
        Arc::new(Self { memory: Memory::Heap(lines), layouts })
    }

    /// Creates the counters as a file.
    ///
    /// # Errors
    /// The file exists, or there is no space for it.
    pub fn create(path: &Path, stages: &[(usize, usize)]) -> io::Result<Arc<Self>> {
        let mut file = File::options().read(true).write(true).create_new(true).mode(0o600).open(path)?;
        let (layouts, words) = layouts(stages);
        // Writing the zeros allocates the memory: without space this fails here, instead of with a signal (SIGBUS)
        // later.
        file.write_all(&vec![0; words * size_of::<u64>()])?;
        Ok(Arc::new(Self { memory: Memory::Mapped(MmapRaw::map_raw(&file)?), layouts }))
    }

    /// Opens the counters that another process has created for the same stages.
    ///
    /// # Errors
    /// The file does not exist, or it is too small for these stages.
    pub fn open(path: &Path, stages: &[(usize, usize)]) -> io::Result<Arc<Self>> {
        let file = File::options().read(true).write(true).open(path)?;
        let (layouts, words) = layouts(stages);
        let memory = MmapRaw::map_raw(&file)?;
        match memory.len() >= words * size_of::<u64>() {
            true => Ok(Arc::new(Self { memory: Memory::Mapped(memory), layouts })),
            false => Err(io::Error::new(io::ErrorKind::InvalidData, "it is smaller than the run's pipeline needs")),
        }
    }

    /// The layout of the numbers of a stage.
    pub(super) fn layout(&self, stage: usize) -> StageLayout {
        self.layouts[stage]
    }

    /// Wakes all stages, so that they check their conditions again.
    pub fn ring_all(&self) {
        ring(self.layouts.iter().map(|layout| self.word(layout.stage + DOORBELL)));
    }

    #[allow(unsafe_code)]
    pub(super) fn word(&self, word: usize) -> &AtomicU64 {
        match &self.memory {
            Memory::Heap(lines) => &lines[word / LINE].0[word % LINE],
            Memory::Mapped(memory) => {
                assert!(word < memory.len() / size_of::<u64>(), "the index is outside of the counters");
                // SAFETY: the index lies within the mapping, as was checked, and is aligned, as a mapping begins at a
                // page. The memory lives as long as `self`. Every process accesses it through atomics only, for which
                // any bits are valid.
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
        // An error means that the word has changed, that a signal arrived, or that the timeout expired. The caller
        // checks its condition again in any case.
        let _ = futex::wait(half(self), futex::Flags::empty(), value as u32, Some(&longest));
    }

    fn wake_all(&self) {
        // It fails only for an address that cannot be read.
        let _ = futex::wake(half(self), futex::Flags::empty(), i32::MAX as u32);
    }
}

/// The low half of a word, which every ring changes; the address of the futex.
#[allow(unsafe_code)]
fn half(word: &AtomicU64) -> &AtomicU32 {
    let low = if cfg!(target_endian = "little") { 0 } else { 1 };
    // SAFETY: both halves lie within the word and are aligned. This process never accesses them separately: it passes
    // the address to the kernel, which reads it atomically.
    unsafe { &*std::ptr::from_ref(word).cast::<AtomicU32>().add(low) }
}
