//! Damage to a log that is still readable in part.

use super::expansion::limit;
use serde::Serialize;

/// The maximum uncompressed size of a chunk, bytes: the most that a log of Gridweave has in one, and less than would
/// exhaust memory. A few bytes of a file can claim, and even decompress to, any size.
pub(crate) const LARGEST: u64 = 1 << 30;

/// The maximum size of the blocks that overlap in time, and so are in memory together, bytes; one block is always
/// allowed. Recorders close a chunk after 1 to 16 MB.
pub(crate) const LARGEST_OVERLAP: u64 = 1 << 30;

/// The maximum number of reports of the same damage: a few packed bytes can expand to millions of damaged records.
pub(crate) const MOST_REPORTS: usize = 1000;

/// Damage to a log that was read as far as possible.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, thiserror::Error)]
#[serde(tag = "damage", rename_all = "snake_case")]
#[non_exhaustive]
pub enum Damage {
    /// The file is truncated: its recorder was stopped before it could close it, or the copy is incomplete.
    #[error(
        "the file has no end (it is truncated at byte {position}): its recorder was killed, or the copy is incomplete"
    )]
    NoEnd {
        /// The end of the last whole record.
        position: usize,
    },
    /// The log is intact, and records that the run which wrote it ended early.
    #[error("the run that wrote the log ended early, and the log with it: {reason}")]
    Incomplete {
        /// The reason.
        reason: String,
    },
    /// Bytes between two records are not a record.
    #[error("{length} bytes at byte {position} are unreadable")]
    Unreadable {
        /// The position of the first byte.
        position: usize,
        /// The number of bytes.
        length: usize,
    },
    /// A chunk was skipped.
    #[error("a chunk was skipped: {fault}")]
    BadChunk {
        /// The fault of the chunk.
        fault: ChunkFault,
    },
    /// A message has a channel that the log does not describe.
    #[error("a message was skipped: the log does not describe its channel {channel}")]
    UnknownChannel {
        /// The channel's number in the log.
        channel: u16,
    },
    /// Two different channels or schemas have the same number. The first is used.
    #[error("the log has two different descriptions of a channel or schema; the first is used")]
    Redefined,
    /// The descriptions of channels take too much memory.
    #[error(
        "{count} channels were left out: the log describes more, and longer, message types than can be kept in memory"
    )]
    ManyDefinitions {
        /// The number of channels.
        count: usize,
    },
    /// The index at the end has a wrong checksum and was not used.
    #[error("the index at the end of the file has a wrong checksum and was not used")]
    BadIndex,
    /// Another program has modified the file.
    #[error("the file was modified while it was read; the rest after that was not read")]
    Changed,
    /// A compressed file is truncated or damaged.
    #[error("the compressed file is damaged or truncated; the part before that was read")]
    TruncatedCompressedFile,
    /// Rows of a database cannot be read.
    #[error("the messages from number {from} on{} are unreadable: the database is damaged", up_to(.to))]
    LostRows {
        /// The number of the first.
        from: i64,
        /// The number of the next readable message; `None` if there is none.
        to: Option<i64>,
    },
    /// Rows of a database take more than its file can hold.
    #[error(
        "the messages from number {from} on were not read: with those before them they take more than the file can hold"
    )]
    ExcessRows {
        /// The number of the first.
        from: i64,
    },
    /// Single messages of a database or ROS 1 bag cannot be read.
    #[error("{count} messages are unreadable: they are damaged, or do not match their definition")]
    LostMessages {
        /// The number of messages.
        count: u64,
    },
    /// A database was not closed, and the last messages are in another file.
    #[error(
        "the recorder did not close the database, and {rest} was not read; `sqlite3 FILE 'pragma wal_checkpoint'` on a copy of both merges it"
    )]
    NotClosed {
        /// The other file.
        rest: String,
    },
    /// An attachment was skipped.
    #[error("an attachment was skipped: it is truncated, or its checksum is wrong")]
    BadAttachment,
    /// A chunk contains messages that are older than its header and its index indicate.
    #[error("a message was found out of order, because the index of its chunk is wrong; it was given a later log time")]
    LateMessage,
}

fn up_to(number: &Option<i64>) -> String {
    number.map(|number| format!(" to {}", number.saturating_sub(1))).unwrap_or_default()
}

/// The fault of a chunk.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, thiserror::Error)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum ChunkFault {
    /// The checksum of its contents is wrong.
    #[error("its checksum is wrong")]
    Checksum,
    /// Its contents cannot be decompressed.
    #[error("it cannot be decompressed")]
    Decompression,
    /// Its compression is not supported.
    #[error("its compression `{0}` is not supported (supported: none, lz4 and zstd, and bz2 in a ROS 1 bag)")]
    UnknownCompression(String),
    /// It does not consist of whole records.
    #[error("it does not consist of whole records")]
    Records,
    /// It exceeds the maximum size.
    #[error("its contents take {size} bytes, more than the maximum of {}", LARGEST)]
    TooMuch {
        /// The claimed size, bytes.
        size: u64,
    },
    /// It overlaps in time with others, which together exceed the maximum size.
    #[error(
        "it overlaps in time with others, and together they take more than the maximum of {} bytes; sort the log by time",
        LARGEST_OVERLAP
    )]
    Overlap,
    /// The chunks of the file unpack to far more than the file.
    #[error("its contents with those of the chunks before it take more than {}", limit())]
    Expansion,
    /// There is not enough memory.
    #[error("there is not enough memory for its contents")]
    TooLarge,
}
