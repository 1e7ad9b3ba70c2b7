//! Blocks: the pieces in which a file is read. A block is a chunk, or a run of records that lie in the file by
//! themselves.

use super::bytes::FileBytes;
use super::chunk::Chunk;
use super::damage::{ChunkFault, LARGEST};
use super::definitions::Definitions;
use super::packed::{ZSTD_MAGIC, unpack_messages};
use super::record::{MessageRecord, record_at};
use super::ros1::BagChunk;
use super::sqlite::Rows;
use super::storage::Storage;
use mcap::records::op;
use std::ops::Range;

/// A piece of a file, and the time that its messages span.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    /// The least log time in it.
    pub(crate) first_time: u64,
    /// The greatest log time in it.
    pub(crate) last_time: u64,
    /// Where its records are.
    pub(crate) records: Records,
}

/// Where the records of a block are.
#[derive(Clone, Debug)]
pub(crate) enum Records {
    /// In this part of the file, as they are.
    Bare(Range<usize>),
    /// In a chunk.
    Chunk(Chunk),
    /// In rows of a database.
    Rows(Rows),
    /// In a chunk of a bag of ROS 1.
    Ros1(BagChunk),
}

impl Block {
    /// How much memory its records take when they are loaded.
    pub(crate) fn size(&self) -> u64 {
        match &self.records {
            Records::Bare(range) => range.len() as u64,
            // The size of a chunk that is cut may not have been written yet.
            Records::Chunk(chunk) if chunk.cut => chunk.data.len() as u64,
            Records::Chunk(chunk) => chunk.size,
            Records::Rows(rows) => rows.size,
            Records::Ros1(chunk) => chunk.size,
        }
    }

    /// Whether it takes more to load it than to read it.
    pub(crate) fn is_work(&self) -> bool {
        match &self.records {
            Records::Bare(_) => false,
            Records::Chunk(chunk) => !chunk.compression.is_empty(),
            Records::Rows(_) | Records::Ros1(_) => true,
        }
    }

    /// The block's records, uncompressed, in `memory` in place of what that holds.
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
            // Databases and bags have no records of MCAP.
            Records::Rows(_) | Records::Ros1(_) => Err(ChunkFault::Records),
        }
    }

    /// Whether it may end with a part of a record.
    pub(crate) fn may_be_cut(&self) -> bool {
        matches!(&self.records, Records::Chunk(chunk) if chunk.cut)
    }

    /// Makes the block's messages ready to be given out, in memory that another has left. `definitions` are those of its file.
    pub(crate) fn load(
        &self,
        storage: &Storage,
        definitions: &Definitions,
        memory: Memory,
    ) -> Result<LoadedBlock, ChunkFault> {
        let (records, lost) = match (&self.records, storage) {
            (Records::Rows(rows), Storage::Sqlite(database)) => database.contents(rows)?,
            (Records::Ros1(chunk), Storage::Ros1(bag)) => chunk.messages(bag)?,
            (_, Storage::Mcap(file)) => (self.contents(file, memory.records)?, 0),
            _ => return Err(ChunkFault::Records),
        };
        let index = Index::of(&records, self.may_be_cut(), memory.messages)?;
        if !index.may_be_packed {
            return Ok(LoadedBlock { records, messages: index.messages, lost, later: 0, is_unpacked: false });
        }
        let records = unpack_messages(&records, definitions)?;
        let messages = Index::of(&records, self.may_be_cut(), index.messages)?.messages;
        Ok(LoadedBlock { records, messages, lost, later: 0, is_unpacked: true })
    }

    /// Reads the block through for what its header does not say, or does not say reliably.
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

/// What reading a block through has shown.
pub(crate) struct Survey {
    /// The least and the greatest log time; `None` if there is no message.
    pub(crate) times: Option<(u64, u64)>,
    /// The channels that it describes.
    pub(crate) definitions: Definitions,
}

/// What a block that has been given out leaves to one that comes.
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

    /// How many bytes it takes.
    pub(crate) fn size(&self) -> u64 {
        (self.records.capacity() + self.messages.capacity() * size_of::<MessagePlace>()) as u64
    }
}

/// A block whose messages can be given out.
pub(crate) struct LoadedBlock {
    records: Vec<u8>,
    /// By log time, and at equal times by position.
    messages: Vec<MessagePlace>,
    /// How many messages of the block could not be read.
    pub(crate) lost: u64,
    /// By how much its clock is set later, nanoseconds.
    later: i64,
    /// Whether it had messages that may have been compressed each by itself.
    pub(crate) is_unpacked: bool,
}

/// Where a message lies in its block.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct MessagePlace {
    log_time: u64,
    position: usize,
}

/// The messages among some records.
struct Index {
    /// The places of the messages, in the order they are given out.
    messages: Vec<MessagePlace>,
    /// Whether one of them begins as a message does that is compressed by itself.
    may_be_packed: bool,
}

impl Index {
    /// In `memory` in place of what that holds.
    fn of(records: &[u8], may_be_cut: bool, memory: Vec<MessagePlace>) -> Result<Self, ChunkFault> {
        let mut index = Self { messages: memory, may_be_packed: false };
        index.messages.clear();
        index.messages.reserve(records.len() / 256);
        let mut position = 0;
        while let Some(record) = record_at(records, position) {
            if record.opcode == op::MESSAGE {
                let message = MessageRecord::parse(record.body).ok_or(ChunkFault::Records)?;
                index.messages.push(MessagePlace { log_time: message.log_time, position });
                index.may_be_packed |= message.data.starts_with(ZSTD_MAGIC);
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
    /// Its memory, when all its messages have been given out.
    pub(crate) fn into_memory(self) -> Memory {
        Memory { records: self.records, messages: self.messages }
    }

    /// Sets the times of its messages later, or earlier where `later` is negative.
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
