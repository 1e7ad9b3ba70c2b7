//! Reads MCAP files, databases of rosbag2 and bags of ROS 1 in the order of log time.
//!
//! A file is walked over once, from record to record, which finds its **blocks**: its chunks, and runs of records without a
//! chunk, or of rows. A block's time span is taken from its header where the index behind it says
//! the same, and is looked up in the block itself otherwise. Blocks are then loaded (decompressed and checked) a few
//! ahead of their use, in the order of their first message, and merged: by log time, then by file, then by position in
//! the file. A message is borrowed from its block; nothing is copied.
//!
//! A damaged file is read as far as it can be. A chunk with a wrong checksum is left out, a file without an end is
//! read up to its last whole record, and each [`Damage`] is told.
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

mod ahead;
mod block;
mod bytes;
mod chunk;
mod damage;
mod definitions;
mod error;
mod file;
mod guess;
mod layout;
mod map;
mod merge;
mod packed;
mod paths;
mod record;
mod ros1;
mod sqlite;
mod storage;
mod summary;
mod supplement;

#[cfg(test)]
mod tests;

pub use damage::{ChunkFault, Damage};
pub use error::ReadError;
pub use file::LogFile;
pub use merge::{LogMessage, LogReader};
pub use paths::log_files;
pub use summary::Statistics;
pub use supplement::SupplementKind;
pub(crate) use supplement::{OUTCOME_RECORD, describes_its_file, read_attachment, read_metadata};

use std::path::PathBuf;

/// Opens the logs at `paths`: MCAP files, and folders of ROS 2 bags.
pub fn open(paths: &[PathBuf]) -> Result<LogReader, ReadError> {
    let files = log_files(paths)?;
    Ok(LogReader::new(files.into_iter().map(|(_, file)| LogFile::open(file)).collect::<Result<_, _>>()?))
}
