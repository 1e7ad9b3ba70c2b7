//! Prefetching: blocks that must be decompressed are loaded ahead of their use, in threads, within a memory limit.
//! Other blocks are loaded on demand: the operating system reads ahead, and reusing memory is faster than a thread with
//! fresh memory.

use super::block::{Block, LoadedBlock, Memory};
use super::damage::{ChunkFault, LARGEST, LARGEST_OVERLAP};
use super::expansion::most_contents;
use super::file::LogFile;
use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;
use std::thread::JoinHandle;

/// The maximum size of the blocks that are loaded ahead, bytes; one block is always allowed.
const PREFETCH_BYTES: u64 = 32 << 20;

/// Smaller blocks take less time to load than a thread takes to start.
const WORTH_A_THREAD: u64 = 64 << 10;

/// The index of a file, and of a block in it. Ordered by position.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct BlockId {
    pub(crate) file: usize,
    pub(crate) block: usize,
}

pub(crate) type Load = Result<LoadedBlock, ChunkFault>;

/// The blocks of some files in the order of their first log times, prefetched.
pub(crate) struct Prefetcher {
    files: Arc<[LogFile]>,
    order: Vec<BlockId>,
    /// The index in `order` of the next block to start.
    next: usize,
    started: VecDeque<Started>,
    started_bytes: u64,
    /// The size of the blocks that were taken and not released, bytes.
    held_bytes: u64,
    /// The maximum of that; one block is always allowed.
    most_held: u64,
    depth: usize,
    /// Memory of released blocks: reading into it is faster than into fresh memory.
    spare: Vec<Memory>,
    /// The files that contain individually compressed messages.
    decompressed: BTreeSet<usize>,
    /// The number of bytes that such messages of each file may still take, in all blocks together: none once one had no
    /// room.
    room_to_unpack: Vec<u64>,
}

struct Started {
    id: BlockId,
    size: u64,
    load: Loading,
}

enum Loading {
    Thread(JoinHandle<Load>),
    /// Loaded on demand.
    Later,
}

impl Prefetcher {
    pub(crate) fn new(files: Arc<[LogFile]>) -> Self {
        let mut order: Vec<BlockId> = files
            .iter()
            .enumerate()
            .flat_map(|(file, log)| (0..log.layout.blocks.len()).map(move |block| BlockId { file, block }))
            .collect();
        order.sort_by_key(|id| (files[id.file].layout.blocks[id.block].first_time, *id));
        let threads = std::thread::available_parallelism().map_or(1, usize::from).min(8);
        let room_to_unpack = files.iter().map(|file| most_contents(file.size())).collect();
        Self {
            files,
            order,
            next: 0,
            started: VecDeque::new(),
            started_bytes: 0,
            held_bytes: 0,
            most_held: LARGEST_OVERLAP,
            depth: threads + 1,
            spare: Vec::new(),
            decompressed: BTreeSet::new(),
            room_to_unpack,
        }
    }

    /// Keeps only the first and the last `count` blocks of each file, and those in which a channel begins.
    pub(crate) fn sample(&mut self, count: usize) {
        let files = Arc::clone(&self.files);
        let is_taken = |id: &BlockId| {
            let Some(layout) = files.get(id.file).map(|file| &file.layout) else { return false };
            let begins = || layout.index.values().any(|channel| channel.blocks.first() == Some(&id.block));
            id.block < count || id.block + count >= layout.blocks.len() || begins()
        };
        self.order.retain(is_taken);
    }

    /// Keeps only these blocks.
    pub(crate) fn limit_to(&mut self, blocks: &BTreeSet<BlockId>) {
        self.order.retain(|id| blocks.contains(id));
    }

    /// Sets the maximum size of the blocks that are held, bytes.
    #[cfg(test)]
    pub(crate) fn limit_held(&mut self, most: u64) {
        self.most_held = most;
    }

    /// Sets the number of bytes that individually compressed messages of each file take together at most.
    #[cfg(test)]
    pub(crate) fn limit_unpacked(&mut self, most: u64) {
        self.room_to_unpack.fill(most);
    }

    /// The least log time in the block that [`take`](Self::take) returns next.
    pub(crate) fn next_time(&self) -> Option<u64> {
        let id = self.started.front().map(|started| started.id).or_else(|| self.order.get(self.next).copied())?;
        self.block(id).map(|block| block.first_time)
    }

    /// The next block, loaded, and its size.
    pub(crate) fn take(&mut self) -> Option<(BlockId, u64, Load)> {
        self.start_all();
        let Started { id, size, load } = self.started.pop_front()?;
        self.started_bytes -= size;
        // Whether a block has room does not depend on how many were prefetched, which depends on the number of
        // processors.
        let is_full = self.room_to_unpack.get(id.file) == Some(&0);
        let load = match load {
            Loading::Thread(thread) => match thread.join().unwrap_or(Err(ChunkFault::Records)) {
                // A thread panics only on a block that cannot be read.
                _ if is_full => Err(ChunkFault::Expansion),
                _ if !self.has_room(size) => Err(ChunkFault::Overlap),
                // Its messages are compressed individually, and take more than threads may load together.
                Err(ChunkFault::TooMuch { .. }) => self.load(id, size),
                load => load,
            },
            Loading::Later if is_full => Err(ChunkFault::Expansion),
            Loading::Later if !self.has_room(size) => Err(ChunkFault::Overlap),
            Loading::Later => self.load(id, size),
        };
        let load =
            load.and_then(|block| if self.has_room(block.size()) { Ok(block) } else { Err(ChunkFault::Overlap) });
        let load = load.and_then(|block| self.take_room(id.file, block));
        if let Ok(block) = &load {
            self.held_bytes += block.size();
            if block.is_decompressed {
                self.decompressed.insert(id.file);
            }
        }
        self.start_all();
        let expected = self.block(id).map_or(size, Block::size);
        Some((id, expected, load))
    }

    /// The block, if its messages are not compressed individually, or there is room for them.
    fn take_room(&mut self, file: usize, block: LoadedBlock) -> Load {
        let Some(room) = self.room_to_unpack.get_mut(file).filter(|_| block.is_decompressed) else { return Ok(block) };
        *room = room.saturating_sub(block.size());
        if *room > 0 { Ok(block) } else { Err(ChunkFault::Expansion) }
    }

    /// Whether so many bytes may be held beside those that are; one block always may.
    fn has_room(&self, size: u64) -> bool {
        self.held_bytes == 0 || self.held_bytes.saturating_add(size) <= self.most_held
    }

    /// Loads a block on demand.
    fn load(&mut self, id: BlockId, size: u64) -> Load {
        let room = match self.held_bytes {
            0 => LARGEST,
            held => self.most_held.saturating_sub(held),
        };
        let memory = self.memory_for(size);
        let file = &self.files[id.file];
        let block = file.layout.blocks.get(id.block).ok_or(ChunkFault::Records)?;
        match block.load(&file.storage, &file.layout.definitions, memory, room) {
            Err(ChunkFault::TooMuch { size }) if self.held_bytes > 0 && size <= LARGEST => Err(ChunkFault::Overlap),
            load => load,
        }
    }

    /// Takes back a block, whose memory is reused.
    pub(crate) fn release(&mut self, block: LoadedBlock) {
        self.held_bytes -= block.size();
        self.keep(block.into_memory());
    }

    fn keep(&mut self, memory: Memory) {
        self.spare.push(memory);
        let mut size: u64 = self.spare.iter().map(Memory::size).sum();
        while self.spare.len() > self.depth || size > PREFETCH_BYTES {
            size -= self.spare.remove(0).size();
        }
    }

    /// Reused memory for a block of `size` bytes. A small block gets none of a large one, since the limit would not
    /// count the rest.
    fn memory_for(&mut self, size: u64) -> Memory {
        let fits = |memory: &Memory| (size..=size.saturating_mul(2)).contains(&memory.size());
        self.spare.iter().rposition(fits).map(|at| self.spare.remove(at)).unwrap_or_default()
    }

    fn block(&self, id: BlockId) -> Option<&Block> {
        self.files.get(id.file)?.layout.blocks.get(id.block)
    }

    /// Starts loading blocks up to the limits.
    fn start_all(&mut self) {
        while self.started.len() < self.depth
            && let Some(&id) = self.order.get(self.next)
            && let Some(size) = self.block(id).map(Block::most_memory)
            && (self.started.is_empty() || self.started_bytes.saturating_add(size) <= PREFETCH_BYTES)
        {
            self.next += 1;
            self.started_bytes += size;
            let load = self.start(id, size);
            self.started.push_back(Started { id, size, load });
        }
    }

    fn start(&mut self, id: BlockId, size: u64) -> Loading {
        let is_work = self.decompressed.contains(&id.file) || self.block(id).is_some_and(Block::is_work);
        let has_room = self.has_room(self.started_bytes);
        if size < WORTH_A_THREAD || !is_work || !has_room {
            return Loading::Later;
        }
        let (files, memory) = (Arc::clone(&self.files), self.memory_for(size));
        let load = move || {
            let file = &files[id.file];
            file.layout.blocks[id.block].load(&file.storage, &file.layout.definitions, memory, PREFETCH_BYTES)
        };
        // If no thread can be started, the block is loaded on demand.
        std::thread::Builder::new().name("log block".into()).spawn(load).map_or(Loading::Later, Loading::Thread)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_reused_for_blocks_of_similar_size_up_to_a_limit() {
        let mut prefetcher = Prefetcher::new(Vec::new().into());
        let memory = |size: u64| Memory::with_room_for(size);
        prefetcher.keep(memory(1 << 20));
        assert_eq!(prefetcher.memory_for((1 << 20) + 1).size(), 0);
        assert_eq!(prefetcher.memory_for((1 << 19) - 1).size(), 0);
        assert_eq!(prefetcher.memory_for(1 << 19).size(), 1 << 20);
        assert_eq!(prefetcher.memory_for(1 << 19).size(), 0);
        for size in [1, PREFETCH_BYTES + 1, 3, 4 << 20, 4 << 20, PREFETCH_BYTES - 5, 8 << 20].repeat(3) {
            prefetcher.keep(memory(size));
            assert!(prefetcher.spare.len() <= prefetcher.depth);
            assert!(prefetcher.spare.iter().map(Memory::size).sum::<u64>() <= PREFETCH_BYTES);
        }
    }
}
