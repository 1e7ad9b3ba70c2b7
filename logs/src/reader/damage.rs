//! What can be wrong with a log of which some can be read all the same.

use serde::Serialize;

/// The most bytes that the contents of a chunk may have: no more than a log of ours can hold in one, and less than
/// would harm a machine. A few bytes of a file can claim, and even hold, any number.
pub(crate) const LARGEST: u64 = 1 << 30;

/// Damage to a log that was read as far as it goes.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, thiserror::Error)]
#[serde(tag = "damage", rename_all = "snake_case")]
#[non_exhaustive]
pub enum Damage {
    /// The file breaks off: its recorder was stopped before it could close it, or the copy is not complete.
    #[error(
        "the file has no end (it breaks off at byte {position}): its recorder was killed, or the copy is not whole"
    )]
    NoEnd {
        /// Where the last record that is whole ends.
        position: usize,
    },
    /// The log is whole, but says that the run which wrote it ended early.
    #[error("the run that wrote the log ended early, and the log with it: {reason}")]
    Incomplete {
        /// Why.
        reason: String,
    },
    /// Bytes between two records mean nothing.
    #[error("{length} bytes from byte {position} on are not readable")]
    Unreadable {
        /// Where they begin.
        position: usize,
        /// How many there are.
        length: usize,
    },
    /// A chunk was left out.
    #[error("a chunk was skipped: {fault}")]
    BadChunk {
        /// What is wrong with it.
        fault: ChunkFault,
    },
    /// A message names a channel that the log does not describe.
    #[error("a message was skipped: the log does not describe its channel {channel}")]
    UnknownChannel {
        /// The channel's number in the log.
        channel: u16,
    },
    /// One number stands for two channels or schemas. The first one is used.
    #[error("the log describes a channel or schema twice, and differently; the first description is used")]
    Redefined,
    /// The index at the end does not match its checksum, so it was not used.
    #[error("the index at the end of the file has a wrong checksum and was not used")]
    BadIndex,
    /// Another program has changed the file meanwhile.
    #[error("the file was changed while it was read; what comes behind the change was not read")]
    Changed,
    /// A file that is packed breaks off, or is damaged.
    #[error("the packed file is damaged or not whole; what comes before that was read")]
    CutPack,
    /// Rows of a database cannot be read.
    #[error("the messages from number {from} on{} are not readable: the database is damaged", up_to(.to))]
    LostRows {
        /// The number of the first.
        from: i64,
        /// The number of the next one that can be read; none if there is no other.
        to: Option<i64>,
    },
    /// Messages of a database or of a bag of ROS 1 cannot be read, although those around them can.
    #[error("{count} messages are not readable: they are damaged, or do not fit their definition")]
    LostMessages {
        /// How many.
        count: u64,
    },
    /// A database was not closed, and what its recorder wrote last is in another file.
    #[error(
        "the recorder did not close the database, and what is in {rest} was not read; `sqlite3 FILE 'pragma wal_checkpoint'` on a copy of both takes it up"
    )]
    NotClosed {
        /// The other file.
        rest: String,
    },
    /// An attachment was left out.
    #[error("an attachment was skipped: it is not whole, or its checksum is wrong")]
    BadAttachment,
    /// A chunk holds messages that are older than its header and its index both say.
    #[error("a message was found out of order, because the index of its chunk is wrong; it was given a later log time")]
    LateMessage,
}

fn up_to(number: &Option<i64>) -> String {
    number.map(|number| format!(" to {}", number.saturating_sub(1))).unwrap_or_default()
}

/// What is wrong with a chunk.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, thiserror::Error)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum ChunkFault {
    /// The checksum of its contents does not fit them.
    #[error("its checksum is wrong")]
    Checksum,
    /// Its contents cannot be decompressed.
    #[error("it cannot be decompressed")]
    Decompression,
    /// It is compressed in a way that this program does not know.
    #[error("its compression `{0}` is not known (none, lz4 and zstd are, and bz2 in a ROS 1 bag)")]
    UnknownCompression(String),
    /// It does not consist of whole records.
    #[error("it does not consist of whole records")]
    Records,
    /// It would expand to more than is read.
    #[error("its contents take {size} bytes, and {} are the most that is read", LARGEST)]
    TooMuch {
        /// Bytes that it claims.
        size: u64,
    },
    /// Its contents do not fit into memory.
    #[error("there is not enough memory for its contents")]
    TooLarge,
}
