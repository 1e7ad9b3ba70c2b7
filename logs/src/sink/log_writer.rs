//! Writing a log: an MCAP file that can be read up to the last closed chunk whatever happens to the program.

use super::{Compression, LogWriteError};
use crate::file::OutputFile;
use gridweave_runtime::message::Channel;
use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, WriteOptions, Writer};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Write};
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
/// It is written beside, as `NAME.part`, and takes its name when it is [finished](Self::finish). A chunk is written in one
/// piece when it is closed. Dropped before it is finished, the log stays beside: it can be read but does not say that it is
/// complete.
pub struct LogWriter {
    path: PathBuf,
    output: OutputFile,
    writer: Writer<BufWriter<File>>,
    chunk_size: u64,
    open_bytes: u64,
}

impl LogWriter {
    /// Starts a log at `path`, which takes the place of a file that has this name when it is complete.
    ///
    /// # Errors
    /// Another program writes it, it is a folder or a device, or the file system does not allow it.
    pub fn create(path: &Path, options: LogOptions) -> Result<Self, LogWriteError> {
        let mut output = OutputFile::create(path)?;
        let file = output.file().try_clone().map_err(|error| LogWriteError::from_io(path, error))?;
        let writer = write_options(options).create(BufWriter::new(file));
        let writer = writer.map_err(|error| LogWriteError::from_mcap(path, error))?;
        output.keep(true);
        Ok(Self { path: path.to_owned(), output, writer, chunk_size: options.chunk_size, open_bytes: 0 })
    }

    /// Whether what was written stays if the log is not finished; at first it does.
    pub(super) fn keep(&mut self, is_kept: bool) {
        self.output.keep(is_kept);
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

    /// Writes an attachment.
    pub fn attachment(&mut self, attachment: &Attachment<'_>) -> Result<(), LogWriteError> {
        self.close_chunk()?;
        self.writer.attach(attachment).map_err(|error| LogWriteError::from_mcap(&self.path, error))
    }

    /// Ends the log, says in it how the run ended, and gives where it lies. One that is complete takes the place of a file
    /// that has its name. One that is not only takes a free place, and otherwise stays beside, as `NAME.part`: what was there
    /// may be of more use.
    ///
    /// # Errors
    /// It cannot be written, or put in its place.
    pub fn finish(self, outcome: Outcome<'_>) -> Result<PathBuf, LogWriteError> {
        let path = self.path.clone();
        let output = self.end(outcome)?;
        match outcome {
            Outcome::Complete => output.put_in_place().map(|_| path),
            Outcome::Incomplete(_) => output.put_in_free_place(),
        }
        .map_err(LogWriteError::from)
    }

    /// Ends the log, which stays beside its place.
    pub(super) fn end(mut self, outcome: Outcome<'_>) -> Result<OutputFile, LogWriteError> {
        let mut metadata = BTreeMap::from([("complete".to_owned(), (outcome == Outcome::Complete).to_string())]);
        if let Outcome::Incomplete(reason) = outcome {
            metadata.insert("reason".to_owned(), reason.to_owned());
        }
        let record = Metadata { name: OUTCOME_RECORD.to_owned(), metadata };
        let written = self.writer.write_metadata(&record).and_then(|()| self.writer.finish());
        written.map_err(|error| LogWriteError::from_mcap(&self.path, error))?;
        let flushed = self.writer.into_inner().flush();
        flushed.map_err(|error| LogWriteError::from_io(&self.path, error))?;
        Ok(self.output)
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
