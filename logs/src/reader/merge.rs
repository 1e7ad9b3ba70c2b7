//! The messages of several files in one order: by log time, then by file, then by position in the file.

use super::ahead::{Ahead, BlockId};
use super::block::LoadedBlock;
use super::damage::Damage;
use super::file::LogFile;
use gridweave_runtime::message::LogTime;
use std::cmp::Reverse;
use std::collections::binary_heap::PeekMut;
use std::collections::{BTreeSet, BinaryHeap};
use std::sync::Arc;

/// One message of a log, borrowed from the block that it came in.
#[derive(Clone, Copy, Debug)]
pub struct LogMessage<'a> {
    /// The file, as an index among the reader's files.
    pub file: usize,
    /// Its channel's number in that file.
    pub channel: u16,
    /// Its sequence number in that file.
    pub sequence: u32,
    /// When it was logged.
    pub log_time: LogTime,
    /// When it was published, nanoseconds.
    pub publish_time: u64,
    /// The encoded message.
    pub data: &'a [u8],
}

/// Reads the messages of some files by rising log time.
///
/// Chunks are decompressed ahead of their use. Besides those, only chunks that overlap in time are in memory together.
pub struct LogReader {
    files: Arc<[LogFile]>,
    ahead: Ahead,
    /// The blocks that have messages left; on top the one whose message is due.
    active: BinaryHeap<Reverse<Active>>,
    /// Whether the message on top has been given out.
    given: bool,
    last_time: u64,
    damage: Vec<(usize, Damage)>,
    /// The files that were changed while they were read. Blocks that were loaded ahead of the change do not make up for
    /// those that were not.
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
    /// Reads all messages of `files`.
    pub fn new(files: Vec<LogFile>) -> Self {
        let files: Arc<[LogFile]> = files.into();
        let sizes = files.iter().flat_map(|file| &file.layout.blocks).map(|block| block.size());
        // Sizes are the files' word only.
        let bytes_total = sizes.fold(0, u64::saturating_add);
        Self {
            ahead: Ahead::new(Arc::clone(&files)),
            files,
            active: BinaryHeap::new(),
            given: false,
            last_time: 0,
            damage: Vec::new(),
            changed: BTreeSet::new(),
            bytes_taken: 0,
            bytes_total,
        }
    }

    /// Reads no more than the messages in the first and in the last `count` blocks of each file, and in those in which a channel
    /// begins. Before any was read.
    pub(crate) fn sample(&mut self, count: usize) {
        self.ahead.sample(count);
    }

    /// The files, in the order in which they break ties.
    pub fn files(&self) -> &Arc<[LogFile]> {
        &self.files
    }

    /// The next message; `None` when there are no more.
    pub fn next_message(&mut self) -> Option<LogMessage<'_>> {
        self.pass_on();
        self.load_due();
        let Reverse(due) = self.active.peek()?;
        self.given = true;
        let file = due.id.file;
        let message = due.block.message(due.index)?;
        if message.log_time < self.last_time {
            self.damage.push((file, Damage::LateMessage));
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

    /// Leaves the message that was given out last.
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
                self.ahead.give_back(block.into_memory());
            }
        }
    }

    /// Loads every block that may hold the message that is due.
    fn load_due(&mut self) {
        while let Some(first_time) = self.ahead.next_time()
            && self.active.peek().is_none_or(|Reverse(due)| first_time <= due.time)
            && let Some((id, size, load)) = self.ahead.take()
        {
            self.bytes_taken = self.bytes_taken.saturating_add(size);
            match load {
                _ if self.changed.contains(&id.file) => {}
                Ok(mut block) => {
                    block.set_later(self.files.get(id.file).map_or(0, LogFile::later));
                    if block.lost > 0 {
                        self.damage.push((id.file, Damage::LostMessages { count: block.lost }));
                    }
                    if let Some(time) = block.time(0) {
                        self.active.push(Reverse(Active { time, id, index: 0, block }));
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

    /// The damage met since the last call, with the index of the file that it is in. What was found when the files
    /// were opened is not among it.
    pub fn take_damage(&mut self) -> Vec<(usize, Damage)> {
        std::mem::take(&mut self.damage)
    }

    /// The share of the files' contents that was taken up, 0 to 1.
    pub fn progress(&self) -> f64 {
        match self.bytes_total {
            0 => 1.0,
            total => self.bytes_taken as f64 / total as f64,
        }
    }
}
