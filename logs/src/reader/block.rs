//! Blocks: the units in which a file is read. A block is a chunk, or a run of records outside of chunks.

use super::bytes::FileBytes;
use super::chunk::Chunk;
use super::compressed::{ZSTD_MAGIC, decompress_messages};
use super::damage::{ChunkFault, LARGEST};
use super::definitions::Definitions;
use super::record::{MessageRecord, record_at};
use super::ros1::{BagChunk, convert_messages};
use super::sqlite::Rows;
use super::storage::Storage;
use mcap::records::op;
use std::ops::Range;

/// A unit of a file, and the time span of its messages.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    /// The least log time.
    pub(crate) first_time: u64,
    /// The greatest log time.
    pub(crate) last_time: u64,
    /// The location of its records.
    pub(crate) records: Records,
}

/// The location of a block's records.
#[derive(Clone, Debug)]
pub(crate) enum Records {
    /// This part of the file, uncompressed.
    Bare(Range<usize>),
    /// A chunk.
    Chunk(Chunk),
    /// Rows of a database.
    Rows(Rows),
    /// A chunk of a ROS 1 bag.
    Ros1(BagChunk),
}

impl Block {
    /// The expected size of the loaded records, bytes.
    pub(crate) fn size(&self) -> u64 {
        match &self.records {
            Records::Bare(range) => range.len() as u64,
            // The size of a truncated chunk may not have been written yet.
            Records::Chunk(chunk) if chunk.cut => chunk.data.len() as u64,
            Records::Chunk(chunk) => chunk.size,
            Records::Rows(rows) => rows.size,
            Records::Ros1(chunk) => chunk.size,
        }
    }

    /// The memory that the loaded records take at most, bytes, unless messages are compressed individually.
    pub(crate) fn most_memory(&self) -> u64 {
        match &self.records {
            Records::Chunk(chunk) if chunk.cut => chunk.most_contents().max(chunk.data.len() as u64),
            _ => self.size(),
        }
    }

    /// Whether loading takes more than reading from the file.
    pub(crate) fn is_work(&self) -> bool {
        match &self.records {
            Records::Bare(_) => false,
            Records::Chunk(chunk) => !chunk.compression.is_empty(),
            Records::Rows(_) | Records::Ros1(_) => true,
        }
    }

    /// The block's records, uncompressed. They are stored in `memory`, whose contents are replaced.
    fn contents(&self, file: &FileBytes, memory: Vec<u8>) -> Result<Vec<u8>, ChunkFault> {
        match &self.records {
            Records::Bare(range) if range.len() as u64 > LARGEST => {
                Err(ChunkFault::TooMuch { size: range.len() as u64 })
            }
            Records::Bare(range) => {
                let mut records = memory;
                file.read_into(range.clone(), &mut records).then_some(records).ok_or(ChunkFault::Records)
            }
            Records::Chunk(chunk) => chunk.contents(file, memory),
            // Databases and ROS 1 bags have no MCAP records.
            Records::Rows(_) | Records::Ros1(_) => Err(ChunkFault::Records),
        }
    }

    /// Whether the block may end with a partial record.
    pub(crate) fn may_be_cut(&self) -> bool {
        matches!(&self.records, Records::Chunk(chunk) if chunk.cut)
    }

    /// Loads the block's messages, into the memory of a released block. `definitions` are those of its file.
    /// Individually compressed messages take at most `room` bytes.
    pub(crate) fn load(
        &self,
        storage: &Storage,
        definitions: &Definitions,
        memory: Memory,
        room: u64,
    ) -> Result<LoadedBlock, ChunkFault> {
        let (mut records, mut lost) = match (&self.records, storage) {
            (Records::Rows(rows), Storage::Sqlite(database)) => database.contents(rows)?,
            (Records::Ros1(chunk), Storage::Ros1(bag)) => chunk.messages(bag)?,
            (_, Storage::Mcap(file)) => (self.contents(file, memory.records)?, 0),
            _ => return Err(ChunkFault::Records),
        };
        let mut index = Index::of(&records, self.may_be_cut(), memory.messages)?;
        if !definitions.ros1().is_empty() {
            let (converted, unreadable) = convert_messages(&records, definitions)?;
            (records, lost) = (converted, lost + unreadable);
            index = Index::of(&records, false, index.messages)?;
        }
        if !index.may_be_compressed {
            return Ok(LoadedBlock { records, messages: index.messages, lost, later: 0, is_decompressed: false });
        }
        let records = decompress_messages(&records, definitions, room.min(LARGEST))?;
        let messages = Index::of(&records, self.may_be_cut(), index.messages)?.messages;
        Ok(LoadedBlock { records, messages, lost, later: 0, is_decompressed: true })
    }

    /// Scans the block for what its header does not contain, or not reliably.
    pub(crate) fn survey(&self, file: &FileBytes) -> Result<Survey, ChunkFault> {
        let contents = self.contents(file, Vec::new())?;
        let mut survey = Survey { times: None, definitions: Definitions::default() };
        let mut position = 0;
        while let Some(record) = record_at(&contents, position) {
            position = record.end();
            match record.opcode {
                op::MESSAGE => {
                    let time = MessageRecord::parse(record.body).ok_or(ChunkFault::Records)?.log_time;
                    let (first, last) = survey.times.unwrap_or((time, time));
                    survey.times = Some((first.min(time), last.max(time)));
                }
                _ => survey.definitions.read(&record),
            }
        }
        match position == contents.len() || self.may_be_cut() {
            true => Ok(survey),
            false => Err(ChunkFault::Records),
        }
    }
}

/// The result of scanning a block.
pub(crate) struct Survey {
    /// The least and the greatest log time; `None` if there are no messages.
    pub(crate) times: Option<(u64, u64)>,
    /// The channels described in the block.
    pub(crate) definitions: Definitions,
}

/// The memory of a released block, for reuse.
#[derive(Default)]
pub(crate) struct Memory {
    records: Vec<u8>,
    messages: Vec<MessagePlace>,
}

impl Memory {
    #[cfg(test)]
    pub(crate) fn with_room_for(size: u64) -> Self {
        Self { records: Vec::with_capacity(size as usize), messages: Vec::new() }
    }

    /// The size of the memory, bytes.
    pub(crate) fn size(&self) -> u64 {
        (self.records.capacity() + self.messages.capacity() * size_of::<MessagePlace>()) as u64
    }
}

/// A block in memory.
pub(crate) struct LoadedBlock {
    records: Vec<u8>,
    /// Ordered by log time, then by position.
    messages: Vec<MessagePlace>,
    /// The number of unreadable messages in the block.
    pub(crate) lost: u64,
    /// The shift of its log times, nanoseconds.
    later: i64,
    /// Whether any of its messages may have been compressed individually.
    pub(crate) is_decompressed: bool,
}

/// The location of a message in its block.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct MessagePlace {
    log_time: u64,
    position: usize,
}

/// The messages in a sequence of records.
struct Index {
    /// The locations of the messages, in reading order.
    messages: Vec<MessagePlace>,
    /// Whether any message starts like an individually compressed one.
    may_be_compressed: bool,
}

impl Index {
    /// Indexes the messages of `records`. The index is stored in `memory`, whose contents are replaced.
    fn of(records: &[u8], may_be_cut: bool, memory: Vec<MessagePlace>) -> Result<Self, ChunkFault> {
        let mut index = Self { messages: memory, may_be_compressed: false };
        index.messages.clear();
        index.messages.reserve(records.len() / 256);
        let mut position = 0;
        while let Some(record) = record_at(records, position) {
            if record.opcode == op::MESSAGE {
                let message = MessageRecord::parse(record.body).ok_or(ChunkFault::Records)?;
                index.messages.push(MessagePlace { log_time: message.log_time, position });
                index.may_be_compressed |= message.data.starts_with(ZSTD_MAGIC);
            }
            position = record.end();
        }
        if position != records.len() && !may_be_cut {
            return Err(ChunkFault::Records);
        }
        if !index.messages.is_sorted() {
            index.messages.sort_unstable();
        }
        Ok(index)
    }
}

impl LoadedBlock {
    /// The size of its contents, bytes.
    pub(crate) fn size(&self) -> u64 {
        (self.records.len() + self.messages.len() * size_of::<MessagePlace>()) as u64
    }

    /// Releases its memory.
    pub(crate) fn into_memory(self) -> Memory {
        Memory { records: self.records, messages: self.messages }
    }

    /// Shifts the times of its messages by nanoseconds, which may be negative.
    pub(crate) fn set_later(&mut self, later: i64) {
        self.later = later;
    }

    /// The log time of the message with the given index.
    pub(crate) fn time(&self, index: usize) -> Option<u64> {
        self.messages.get(index).map(|place| place.log_time.saturating_add_signed(self.later))
    }

    /// The message with the given index.
    pub(crate) fn message(&self, index: usize) -> Option<MessageRecord<'_>> {
        let message = MessageRecord::parse(record_at(&self.records, self.messages.get(index)?.position)?.body)?;
        Some(MessageRecord {
            log_time: message.log_time.saturating_add_signed(self.later),
            publish_time: message.publish_time.saturating_add_signed(self.later),
            ..message
        })
    }
}
