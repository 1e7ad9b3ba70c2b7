//! Loads blocks ahead of their use, in threads of their own, within a bound of memory. Those that are only read are loaded when
//! they are asked for: the system reads ahead by itself, and memory that was used before is faster than a thread with memory of
//! its own.

use super::block::{Block, LoadedBlock, Memory};
use super::damage::ChunkFault;
use super::file::LogFile;
use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;
use std::thread::JoinHandle;

/// At most so many bytes are decompressed ahead of their use, but at least one block.
const AHEAD_BYTES: u64 = 32 << 20;

/// A block that is smaller is loaded in less time than a thread takes to start.
const WORTH_A_THREAD: u64 = 64 << 10;

/// The place of a block: the file's index, and the block's in its file. Sorts as the blocks lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct BlockId {
    pub(crate) file: usize,
    pub(crate) block: usize,
}

pub(crate) type Load = Result<LoadedBlock, ChunkFault>;

/// All blocks of some files by the time they begin, loaded one after the other.
pub(crate) struct Ahead {
    files: Arc<[LogFile]>,
    order: Vec<BlockId>,
    /// The next block of `order` to be begun.
    next: usize,
    begun: VecDeque<Begun>,
    begun_bytes: u64,
    depth: usize,
    /// Memory of blocks that have been given out: to touch fresh memory takes longer than to read into it.
    spare: Vec<Memory>,
    /// The files in which messages were compressed each by itself.
    unpacked: BTreeSet<usize>,
}

struct Begun {
    id: BlockId,
    size: u64,
    load: Loading,
}

enum Loading {
    Thread(JoinHandle<Load>),
    /// It is loaded when it is asked for.
    Later,
}

impl Ahead {
    pub(crate) fn new(files: Arc<[LogFile]>) -> Self {
        let mut order: Vec<BlockId> = files
            .iter()
            .enumerate()
            .flat_map(|(file, log)| (0..log.layout.blocks.len()).map(move |block| BlockId { file, block }))
            .collect();
        order.sort_by_key(|id| (files[id.file].layout.blocks[id.block].first_time, *id));
        let threads = std::thread::available_parallelism().map_or(1, usize::from).min(8);
        Self {
            files,
            order,
            next: 0,
            begun: VecDeque::new(),
            begun_bytes: 0,
            depth: threads + 1,
            spare: Vec::new(),
            unpacked: BTreeSet::new(),
        }
    }

    /// Leaves all blocks out but the first and the last `count` of each file, and those in which a channel begins.
    pub(crate) fn sample(&mut self, count: usize) {
        let files = Arc::clone(&self.files);
        let is_taken = |id: &BlockId| {
            let Some(layout) = files.get(id.file).map(|file| &file.layout) else { return false };
            let begins = || layout.index.values().any(|channel| channel.block == id.block);
            id.block < count || id.block + count >= layout.blocks.len() || begins()
        };
        self.order.retain(is_taken);
    }

    /// The least log time in the block that [`take`](Self::take) gives next.
    pub(crate) fn next_time(&self) -> Option<u64> {
        let id = self.begun.front().map(|begun| begun.id).or_else(|| self.order.get(self.next).copied())?;
        self.block(id).map(|block| block.first_time)
    }

    /// The next block, loaded, and its size.
    pub(crate) fn take(&mut self) -> Option<(BlockId, u64, Load)> {
        self.begin();
        let Begun { id, size, load } = self.begun.pop_front()?;
        self.begun_bytes -= size;
        let load = match load {
            // A thread that has failed has found something in the block that no reader can handle.
            Loading::Thread(thread) => thread.join().unwrap_or(Err(ChunkFault::Records)),
            Loading::Later => {
                let memory = self.memory_for(size);
                let file = &self.files[id.file];
                self.block(id)?.load(&file.storage, &file.layout.definitions, memory)
            }
        };
        if load.as_ref().is_ok_and(|block| block.is_unpacked) {
            self.unpacked.insert(id.file);
        }
        self.begin();
        Some((id, size, load))
    }

    /// Takes the memory of a block that has been given out.
    pub(crate) fn give_back(&mut self, memory: Memory) {
        self.spare.push(memory);
        let mut size: u64 = self.spare.iter().map(Memory::size).sum();
        while self.spare.len() > self.depth || size > AHEAD_BYTES {
            size -= self.spare.remove(0).size();
        }
    }

    /// Memory for a block of some size. A small block takes none of a large one, which would be missing from the bound.
    fn memory_for(&mut self, size: u64) -> Memory {
        let fits = |memory: &Memory| (size..=size.saturating_mul(2)).contains(&memory.size());
        self.spare.iter().rposition(fits).map(|at| self.spare.remove(at)).unwrap_or_default()
    }

    fn block(&self, id: BlockId) -> Option<&Block> {
        self.files.get(id.file)?.layout.blocks.get(id.block)
    }

    /// Begins to load as many blocks as may be loaded ahead.
    fn begin(&mut self) {
        while self.begun.len() < self.depth
            && let Some(&id) = self.order.get(self.next)
            && let Some(size) = self.block(id).map(Block::size)
            && (self.begun.is_empty() || self.begun_bytes.saturating_add(size) <= AHEAD_BYTES)
        {
            self.next += 1;
            self.begun_bytes += size;
            let load = self.start(id, size);
            self.begun.push_back(Begun { id, size, load });
        }
    }

    fn start(&mut self, id: BlockId, size: u64) -> Loading {
        let is_work = self.unpacked.contains(&id.file) || self.block(id).is_some_and(Block::is_work);
        if size < WORTH_A_THREAD || !is_work {
            return Loading::Later;
        }
        let (files, memory) = (Arc::clone(&self.files), self.memory_for(size));
        let load = move || {
            let file = &files[id.file];
            file.layout.blocks[id.block].load(&file.storage, &file.layout.definitions, memory)
        };
        // Without a thread to be had the block is loaded when its turn comes.
        std::thread::Builder::new().name("log block".into()).spawn(load).map_or(Loading::Later, Loading::Thread)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_goes_to_blocks_of_about_its_size_and_little_of_it_is_kept() {
        let mut ahead = Ahead::new(Vec::new().into());
        let memory = |size: u64| Memory::with_room_for(size);
        ahead.give_back(memory(1 << 20));
        assert_eq!(ahead.memory_for((1 << 20) + 1).size(), 0);
        assert_eq!(ahead.memory_for((1 << 19) - 1).size(), 0);
        assert_eq!(ahead.memory_for(1 << 19).size(), 1 << 20);
        assert_eq!(ahead.memory_for(1 << 19).size(), 0);
        for size in [1, AHEAD_BYTES + 1, 3, 4 << 20, 4 << 20, AHEAD_BYTES - 5, 8 << 20].repeat(3) {
            ahead.give_back(memory(size));
            assert!(ahead.spare.len() <= ahead.depth);
            assert!(ahead.spare.iter().map(Memory::size).sum::<u64>() <= AHEAD_BYTES);
        }
    }
}
