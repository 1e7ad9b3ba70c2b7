//! Reads MCAP files, rosbag2 databases and ROS 1 bags in log time order.
//!
//! A file is scanned once, record by record, to find its **blocks**: its chunks, and runs of records outside of chunks,
//! or of rows. The time span of a block is taken from its header if the index after it matches, and otherwise
//! determined by scanning the block. Blocks are then loaded (decompressed and verified) a few ahead of their use, in
//! the order of their first message, and merged: by log time, then by file, then by position in the file. A message is
//! borrowed from its block; nothing is copied.
//!
//! A damaged file is read as far as possible. A chunk with a wrong checksum is skipped, a truncated file is read up to
//! its last whole record, and each [`Damage`] is reported.
//!
//! MCAP records are parsed here instead of by the `mcap` crate: its readers stop at the first damage, and its
//! `MessageStream` needs the file memory-mapped, which kills the process if another program truncates the file.
//!
//! ```no_run
//! use gridweave_logs::reader::{LogFile, LogReader};
//!
//! let mut reader = LogReader::new(vec![LogFile::open("a.mcap")?, LogFile::open("b.mcap")?]);
//! while let Some(message) = reader.next_message() {
//!     println!("{} {} bytes", message.log_time, message.data.len());
//! }
//! # Ok::<(), gridweave_logs::reader::ReadError>(())
//! ```

mod block;
mod bytes;
mod chunk;
mod compressed;
mod damage;
mod definition_records;
mod definitions;
mod error;
mod expansion;
mod file;
mod guess;
mod layout;
mod map;
mod merge;
mod paths;
mod prefetch;
mod record;
pub(crate) mod ros1;
mod sqlite;
mod storage;
mod summary;
mod supplement;

#[cfg(test)]
pub(crate) mod tests;

pub use damage::{ChunkFault, Damage};
pub use error::ReadError;
pub use file::LogFile;
pub(crate) use layout::IndexedChannel;
pub(crate) use merge::ChannelPart;
pub use merge::{LogMessage, LogReader};
pub use paths::log_files;
pub use summary::FileStatistics;
pub use supplement::SupplementKind;
pub(crate) use supplement::{OUTCOME_RECORD, describes_its_file, read_attachment, read_metadata};

use std::path::PathBuf;

/// Opens the logs at `paths`: log files, and folders of ROS 2 bags.
pub fn open(paths: &[PathBuf]) -> Result<LogReader, ReadError> {
    let files = log_files(paths)?;
    Ok(LogReader::new(files.into_iter().map(|(_, file)| LogFile::open(file)).collect::<Result<_, _>>()?))
}
