//! Loads blocks ahead of their use, in threads of their own, within a bound of memory.

use super::block::{Block, LoadedBlock};
use super::damage::ChunkFault;
use super::file::LogFile;
use std::collections::VecDeque;
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
        Self { files, order, next: 0, begun: VecDeque::new(), begun_bytes: 0, depth: threads + 1 }
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
                let file = &self.files[id.file];
                self.block(id)?.load(&file.storage, &file.layout.definitions)
            }
        };
        self.begin();
        Some((id, size, load))
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
            self.begun.push_back(Begun { id, size, load: self.start(id, size) });
        }
    }

    fn start(&self, id: BlockId, size: u64) -> Loading {
        if size < WORTH_A_THREAD {
            return Loading::Later;
        }
        let files = Arc::clone(&self.files);
        let load = move || {
            let file = &files[id.file];
            file.layout.blocks[id.block].load(&file.storage, &file.layout.definitions)
        };
        // Without a thread to be had the block is loaded when its turn comes.
        std::thread::Builder::new().name("log block".into()).spawn(load).map_or(Loading::Later, Loading::Thread)
    }
}
