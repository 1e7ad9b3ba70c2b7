//! The merged messages of several files: by log time, then by file, then by position in the file.

use super::block::{Block, LoadedBlock};
use super::damage::{Damage, MOST_REPORTS};
use super::file::LogFile;
use super::prefetch::{BlockId, Prefetcher};
use gridweave_runtime::message::LogTime;
use std::cmp::Reverse;
use std::collections::binary_heap::PeekMut;
use std::collections::{BTreeSet, BinaryHeap};
use std::sync::Arc;

/// How much of a file without an index is read where some of its channels are looked for, bytes.
const READ_WITHOUT_INDEX: u64 = 32 << 20;

/// A part of a channel's messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ChannelPart {
    /// The first message.
    Beginning,
    /// All messages.
    Whole,
}

/// A message of a log, borrowed from its block.
#[derive(Clone, Copy, Debug)]
pub struct LogMessage<'a> {
    /// The index of its file in the reader.
    pub file: usize,
    /// The number of its channel in that file.
    pub channel: u16,
    /// Its sequence number in that file.
    pub sequence: u32,
    /// The log time.
    pub log_time: LogTime,
    /// The publish time, nanoseconds.
    pub publish_time: u64,
    /// The encoded message.
    pub data: &'a [u8],
}

/// Reads the messages of some files in log time order.
///
/// Chunks are decompressed ahead of their use. Apart from those, only chunks that overlap in time are in memory
/// together, up to a maximum size: more of them are skipped, and reported as [`Damage`].
pub struct LogReader {
    files: Arc<[LogFile]>,
    prefetcher: Prefetcher,
    /// The blocks with messages left, as a heap; the top has the next message.
    active: BinaryHeap<Reverse<Active>>,
    /// Whether the message on top was returned.
    given: bool,
    last_time: u64,
    /// The number of messages that were found out of order.
    late: usize,
    damage: Vec<(usize, Damage)>,
    /// The files that were modified while they were read. Blocks that were prefetched before that do not replace those
    /// that were not.
    changed: BTreeSet<usize>,
    bytes_taken: u64,
    bytes_total: u64,
}

/// A loaded block, and its next message.
struct Active {
    time: u64,
    id: BlockId,
    index: usize,
    block: LoadedBlock,
}

impl Active {
    fn key(&self) -> (u64, BlockId) {
        (self.time, self.id)
    }
}

impl PartialEq for Active {
    fn eq(&self, other: &Self) -> bool {
        self.key() == other.key()
    }
}

impl Eq for Active {}

impl PartialOrd for Active {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Active {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.key().cmp(&other.key())
    }
}

impl LogReader {
    /// Creates a reader of all messages in `files`.
    pub fn new(files: Vec<LogFile>) -> Self {
        Self::of(files.into())
    }

    /// Creates a reader of all messages in files that others may read, too.
    pub(crate) fn of(files: Arc<[LogFile]>) -> Self {
        let sizes = files.iter().flat_map(|file| &file.layout.blocks).map(|block| block.size());
        // The sizes are claimed by the files, so they are not trusted.
        let bytes_total = sizes.fold(0, u64::saturating_add);
        Self {
            prefetcher: Prefetcher::new(Arc::clone(&files)),
            files,
            active: BinaryHeap::new(),
            given: false,
            last_time: 0,
            late: 0,
            damage: Vec::new(),
            changed: BTreeSet::new(),
            bytes_taken: 0,
            bytes_total,
        }
    }

    /// Limits reading to the first and the last `count` blocks of each file, and those in which a channel begins. Must
    /// be called before the first message is read.
    pub(crate) fn sample(&mut self, count: usize) {
        self.prefetcher.sample(count);
    }

    /// Limits reading to the blocks with messages of the channels that `part` selects, each given by the index of its
    /// file and its number in it; of a file without an index, to its beginning. Must be called before the first message
    /// is read.
    pub(crate) fn limit_to(&mut self, part: impl Fn(usize, u16) -> Option<ChannelPart>) {
        let mut blocks = BTreeSet::new();
        for (file, log) in self.files.iter().enumerate() {
            let Some(index) = log.index() else {
                let mut size = 0_u64;
                let fits = |block: &&Block| {
                    size = size.saturating_add(block.size());
                    size <= READ_WITHOUT_INDEX
                };
                let count = log.layout.blocks.iter().take_while(fits).count();
                blocks.extend((0..count).map(|block| BlockId { file, block }));
                continue;
            };
            for (number, channel) in index {
                let count = match part(file, *number) {
                    Some(ChannelPart::Beginning) => 1,
                    Some(ChannelPart::Whole) => usize::MAX,
                    None => 0,
                };
                blocks.extend(channel.blocks.iter().take(count).map(|block| BlockId { file, block: *block }));
            }
        }
        self.prefetcher.limit_to(&blocks);
    }

    /// Sets the maximum size of the chunks that overlap in time, bytes.
    #[cfg(test)]
    pub(crate) fn limit_overlap(&mut self, most: u64) {
        self.prefetcher.limit_held(most);
    }

    /// Sets the number of bytes that individually compressed messages of each file take together at most.
    #[cfg(test)]
    pub(crate) fn limit_unpacked(&mut self, most: u64) {
        self.prefetcher.limit_unpacked(most);
    }

    /// The files, in the order that breaks ties.
    pub fn files(&self) -> &Arc<[LogFile]> {
        &self.files
    }

    /// The next message; `None` at the end.
    pub fn next_message(&mut self) -> Option<LogMessage<'_>> {
        self.pass_on();
        self.load_due();
        let Reverse(due) = self.active.peek()?;
        self.given = true;
        let file = due.id.file;
        let message = due.block.message(due.index)?;
        if message.log_time < self.last_time {
            self.late += 1;
            self.damage.extend((self.late <= MOST_REPORTS).then_some((file, Damage::LateMessage)));
        }
        self.last_time = self.last_time.max(message.log_time);
        Some(LogMessage {
            file,
            channel: message.channel,
            sequence: message.sequence,
            log_time: LogTime(self.last_time),
            publish_time: message.publish_time,
            data: message.data,
        })
    }

    /// Drops the message that was returned last.
    fn pass_on(&mut self) {
        if !std::mem::take(&mut self.given) {
            return;
        }
        let Some(mut top) = self.active.peek_mut() else { return };
        let Reverse(active) = &mut *top;
        active.index += 1;
        match active.block.time(active.index) {
            Some(time) => active.time = time,
            None => {
                let Reverse(Active { block, .. }) = PeekMut::pop(top);
                self.prefetcher.release(block);
            }
        }
    }

    /// Loads each block that may contain the next message.
    fn load_due(&mut self) {
        while let Some(first_time) = self.prefetcher.next_time()
            && self.active.peek().is_none_or(|Reverse(due)| first_time <= due.time)
            && let Some((id, size, load)) = self.prefetcher.take()
        {
            self.bytes_taken = self.bytes_taken.saturating_add(size);
            match load {
                Ok(block) if self.changed.contains(&id.file) => self.prefetcher.release(block),
                Err(_) if self.changed.contains(&id.file) => {}
                Ok(mut block) => {
                    block.set_later(self.files.get(id.file).map_or(0, LogFile::later));
                    if block.lost > 0 {
                        self.damage.push((id.file, Damage::LostMessages { count: block.lost }));
                    }
                    match block.time(0) {
                        Some(time) => self.active.push(Reverse(Active { time, id, index: 0, block })),
                        None => self.prefetcher.release(block),
                    }
                }
                Err(_) if self.files.get(id.file).is_some_and(|file| file.storage.is_cut()) => {
                    self.changed.insert(id.file);
                    self.damage.push((id.file, Damage::Changed));
                }
                Err(fault) => self.damage.push((id.file, Damage::BadChunk { fault })),
            }
        }
    }

    /// The damage found since the last call, with the index of its file, except the damage found when the files were
    /// opened.
    pub fn take_damage(&mut self) -> Vec<(usize, Damage)> {
        std::mem::take(&mut self.damage)
    }

    /// The fraction of the files that was read, 0 to 1.
    pub fn progress(&self) -> f64 {
        match self.bytes_total {
            0 => 1.0,
            total => self.bytes_taken as f64 / total as f64,
        }
    }
}
