//! Writing a log: an MCAP file that can be read up to the last closed chunk whatever happens to the program.

use super::error::folder_of;
use super::{Compression, LogWriteError};
use gridweave_runtime::message::Channel;
use mcap::records::{MessageHeader, Metadata};
use mcap::{WriteOptions, Writer};
use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, BufWriter, ErrorKind};
use std::path::{Path, PathBuf};

/// The bytes that a message takes in a chunk beside its own: opcode, length and header.
const MESSAGE_OVERHEAD: u64 = 31;

/// The name of the metadata record that says how the run ended.
pub(crate) const OUTCOME_RECORD: &str = "gridweave";

/// How a log is written.
#[derive(Clone, Copy, Debug)]
pub struct LogOptions {
    /// How chunks are compressed.
    pub compression: Compression,
    /// A chunk is closed when it holds this many bytes before compression.
    pub chunk_size: u64,
}

impl Default for LogOptions {
    fn default() -> Self {
        Self { compression: Compression::default(), chunk_size: 1 << 20 }
    }
}

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome<'a> {
    /// The log holds all that it should.
    Complete,
    /// The log ends early, for this reason.
    Incomplete(&'a str),
}

/// Writes a log: an MCAP file with profile `ros2`, chunked and indexed, with checksums.
///
/// A chunk is written in one piece when it is closed. Dropped before [`finish`](Self::finish), the log can be read but
/// does not say that it is complete.
pub struct LogWriter {
    path: PathBuf,
    writer: Writer<BufWriter<File>>,
    chunk_size: u64,
    open_bytes: u64,
}

impl LogWriter {
    /// Whether a log could be written at `path`, as far as that can be told without touching anything.
    pub fn check_path(path: &Path) -> Result<(), LogWriteError> {
        if !folder_of(path).is_dir() {
            return Err(LogWriteError::NoFolder(folder_of(path).to_owned()));
        }
        match fs::metadata(path) {
            Ok(metadata) if metadata.is_dir() => Err(LogWriteError::IsFolder(path.to_owned())),
            Ok(metadata) if metadata.is_file() => {
                let file = OpenOptions::new().write(true).open(path);
                let file = file.map_err(|error| LogWriteError::from_io(path, error))?;
                match file.try_lock_shared() {
                    Err(TryLockError::WouldBlock) => Err(LogWriteError::InUse(path.to_owned())),
                    // Not every file system knows locks.
                    _ => Ok(()),
                }
            }
            Err(error) if error.kind() != ErrorKind::NotFound => Err(LogWriteError::from_io(path, error)),
            _ => Ok(()),
        }
    }

    /// Starts a log at `path`, in place of a file that has this name.
    pub fn create(path: &Path, options: LogOptions) -> Result<Self, LogWriteError> {
        Self::check_path(path)?;
        let file = create_anew(path).map_err(|error| LogWriteError::from_io(path, error))?;
        let writer = write_options(options).create(BufWriter::new(file));
        let writer = writer.map_err(|error| LogWriteError::from_mcap(path, error))?;
        Ok(Self { path: path.to_owned(), writer, chunk_size: options.chunk_size, open_bytes: 0 })
    }

    /// The number of a channel in this log. A channel that is there already keeps its number.
    pub fn channel(&mut self, channel: &Channel) -> Result<u16, LogWriteError> {
        let Channel { topic, message_encoding, schema_name, schema_encoding, schema, metadata } = channel;
        let added = match schema_name.is_empty() {
            true => Ok(0),
            false => self.writer.add_schema(schema_name, schema_encoding, schema),
        };
        added
            .and_then(|schema| self.writer.add_channel(schema, topic, message_encoding, metadata))
            .map_err(|error| LogWriteError::from_mcap(&self.path, error))
    }

    /// Writes a message on the channel that the header names by its number.
    pub fn write(&mut self, header: &MessageHeader, bytes: &[u8]) -> Result<(), LogWriteError> {
        let size = bytes.len() as u64 + MESSAGE_OVERHEAD;
        // A large message gets a chunk of its own, so that nobody has to unpack it to read the small ones beside it.
        if self.open_bytes > 0 && self.open_bytes + size > self.chunk_size {
            self.close_chunk()?;
        }
        self.writer
            .write_to_known_channel(header, bytes)
            .map_err(|error| LogWriteError::from_mcap(&self.path, error))?;
        self.open_bytes += size;
        if self.open_bytes >= self.chunk_size {
            self.close_chunk()?;
        }
        Ok(())
    }

    /// Writes a metadata record.
    pub fn metadata(&mut self, name: &str, metadata: BTreeMap<String, String>) -> Result<(), LogWriteError> {
        self.close_chunk()?;
        let record = Metadata { name: name.to_owned(), metadata };
        self.writer.write_metadata(&record).map_err(|error| LogWriteError::from_mcap(&self.path, error))
    }

    /// Ends the log and says in it how the run ended.
    pub fn finish(mut self, outcome: Outcome<'_>) -> Result<(), LogWriteError> {
        let mut metadata = BTreeMap::from([("complete".to_owned(), (outcome == Outcome::Complete).to_string())]);
        if let Outcome::Incomplete(reason) = outcome {
            metadata.insert("reason".to_owned(), reason.to_owned());
        }
        let record = Metadata { name: OUTCOME_RECORD.to_owned(), metadata };
        let written = self.writer.write_metadata(&record).and_then(|()| self.writer.finish());
        written.map(drop).map_err(|error| LogWriteError::from_mcap(&self.path, error))
    }

    /// Writes all that has been handed over to the disk, so that it can be read whatever happens.
    pub fn flush(&mut self) -> Result<(), LogWriteError> {
        match self.open_bytes {
            0 => Ok(()),
            _ => self.close_chunk(),
        }
    }

    fn close_chunk(&mut self) -> Result<(), LogWriteError> {
        self.open_bytes = 0;
        self.writer.flush().map_err(|error| LogWriteError::from_mcap(&self.path, error))
    }
}

/// An empty file. A file that has the name is taken away, not emptied: a program that has it mapped, be it a viewer or
/// the source of this very run, keeps what it reads. It is locked, so that no other program takes it away while it is
/// written.
fn create_anew(path: &Path) -> io::Result<File> {
    if fs::symlink_metadata(path).is_ok_and(|metadata| metadata.is_file()) {
        fs::remove_file(path)?;
    }
    let file = File::create(path)?;
    if file.metadata()?.is_file() {
        // Not every file system knows locks.
        let _ = file.lock();
    }
    Ok(file)
}

fn write_options(options: LogOptions) -> WriteOptions {
    let compression = match options.compression {
        Compression::Zstd => Some(mcap::Compression::Zstd),
        Compression::Lz4 => Some(mcap::Compression::Lz4),
        Compression::None => None,
    };
    let level = if options.compression == Compression::Zstd { 1 } else { 0 };
    WriteOptions::new()
        .profile("ros2")
        .library(concat!("gridweave ", env!("CARGO_PKG_VERSION")))
        .compression(compression)
        .compression_level(level)
        // The compressor's own threads would make its output depend on their number.
        .compression_threads(0)
        // Chunks are closed here, so that the file is flushed with every one of them.
        .chunk_size(None)
        // Chunks are put together in memory: a program that dies leaves none that is half written.
        .disable_seeking(true)
}
