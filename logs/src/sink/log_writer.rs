//! Writing a log: an MCAP file that can be read up to the last closed chunk, whatever happens to the program.

use super::chunk_file::ChunkFile;
use super::{Compression, LogWriteError};
use crate::file::OutputFile;
use crate::reader::OUTCOME_RECORD;
use gridweave_runtime::message::Channel;
use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, WriteOptions, Writer};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Bytes per message in a chunk in addition to its data: opcode, length and header.
const MESSAGE_OVERHEAD: u64 = 31;

/// Options of a log.
#[derive(Clone, Copy, Debug)]
pub struct LogOptions {
    /// The compression of chunks.
    pub compression: Compression,
    /// The size before compression at which a chunk is closed, bytes.
    pub chunk_size: u64,
}

impl Default for LogOptions {
    fn default() -> Self {
        Self { compression: Compression::default(), chunk_size: 1 << 20 }
    }
}

/// The outcome of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome<'a> {
    /// The log is complete.
    Complete,
    /// The log ends early, for this reason.
    Incomplete(&'a str),
}

/// Writes a log: an MCAP file with profile `ros2`, chunked and indexed, with checksums.
///
/// The file is written as `NAME.part` and renamed when it is [finished](Self::finish). The beginning of a chunk is
/// written last, when the chunk is closed. If the writer is dropped before that, the `NAME.part` is left: it is
/// readable, and not marked as complete.
pub struct LogWriter {
    path: PathBuf,
    output: OutputFile,
    writer: Writer<ChunkFile>,
    chunk_size: u64,
    open_bytes: u64,
}

impl LogWriter {
    /// Starts a log at `path`. When it is complete, it replaces a file of that name.
    ///
    /// # Errors
    /// Another program writes it, it is a folder or a device, or the file system does not allow it.
    pub fn create(path: &Path, options: LogOptions) -> Result<Self, LogWriteError> {
        let mut output = OutputFile::create(path)?;
        let file = output.file().try_clone().map_err(|error| LogWriteError::from_io(path, error))?;
        let writer = write_options(options).create(ChunkFile::new(file));
        let writer = writer.map_err(|error| LogWriteError::from_mcap(path, error))?;
        output.keep(true);
        Ok(Self { path: path.to_owned(), output, writer, chunk_size: options.chunk_size, open_bytes: 0 })
    }

    /// Sets whether the partial file is kept if the log is not finished. By default it is.
    pub(super) fn keep(&mut self, is_kept: bool) {
        self.output.keep(is_kept);
    }

    /// The number of a channel in this log. A channel that was added before keeps its number.
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

    /// Writes a message on the channel whose number is in the header.
    pub fn write(&mut self, header: &MessageHeader, bytes: &[u8]) -> Result<(), LogWriteError> {
        let size = bytes.len() as u64 + MESSAGE_OVERHEAD;
        // A large message gets a separate chunk, so that it need not be decompressed to read the small ones beside it.
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
        self.writer.write_metadata(&record).map_err(|error| LogWriteError::from_mcap(&self.path, error))?;
        self.close_chunk()
    }

    /// Writes an attachment.
    pub fn attachment(&mut self, attachment: &Attachment<'_>) -> Result<(), LogWriteError> {
        self.close_chunk()?;
        self.writer.attach(attachment).map_err(|error| LogWriteError::from_mcap(&self.path, error))?;
        self.close_chunk()
    }

    /// Ends the log, records the outcome of the run in it, and returns its path. A complete log replaces a file of its
    /// name. An incomplete one does so only if there is no such file, and otherwise stays at `NAME.part`, since the
    /// earlier file may be of more use.
    ///
    /// # Errors
    /// The file cannot be written or renamed.
    pub fn finish(self, outcome: Outcome<'_>) -> Result<PathBuf, LogWriteError> {
        let path = self.path.clone();
        let output = self.end(outcome)?;
        match outcome {
            Outcome::Complete => output.put_in_place().map(|_| path),
            Outcome::Incomplete(_) => output.put_in_free_place(),
        }
        .map_err(LogWriteError::from)
    }

    /// Ends the log, which stays at `NAME.part`.
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

    /// Writes everything to the file, so that it can be read whatever happens.
    pub fn flush(&mut self) -> Result<(), LogWriteError> {
        match self.open_bytes {
            0 => Ok(()),
            _ => self.close_chunk(),
        }
    }

    /// Closes the open chunk, if any. Everything is in the file then, and a new chunk may begin.
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
        // The compressor's threads would make its output depend on their number.
        .compression_threads(0)
        // Chunks are closed here, so that the file is flushed with each: a program that dies leaves no half-written
        // chunk.
        .chunk_size(None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reader::{Damage, LogFile, LogReader};
    use std::borrow::Cow;

    /// Small and large messages.
    fn message(number: u32) -> Vec<u8> {
        let size = [10, 70_000, 300, 2_000_000, 40_000][number as usize % 5];
        (0..size).map(|byte: u32| ((byte * (number + 1)) >> 4) as u8).collect()
    }

    fn write(log: &mut LogWriter, count: u32) {
        let channel = Channel { topic: "/a".into(), message_encoding: "cdr".into(), ..Default::default() };
        let channel_id = log.channel(&channel).unwrap();
        for sequence in 0..count {
            let time = u64::from(sequence);
            let header = MessageHeader { channel_id, sequence, log_time: time, publish_time: time };
            log.write(&header, &message(sequence)).unwrap();
        }
    }

    fn read(path: &Path) -> (Vec<Vec<u8>>, Vec<Damage>) {
        let file = LogFile::open(path).unwrap();
        let mut damage = file.damage().to_vec();
        let mut reader = LogReader::new(vec![file]);
        let mut messages = Vec::new();
        while let Some(message) = reader.next_message() {
            messages.push(message.data.to_vec());
        }
        damage.extend(reader.take_damage().into_iter().map(|(_, damage)| damage));
        (messages, damage)
    }

    const COMPRESSIONS: [Compression; 3] = [Compression::None, Compression::Lz4, Compression::Zstd];

    #[test]
    fn messages_records_and_attachments_of_any_size_round_trip() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        for compression in COMPRESSIONS {
            let mut log = LogWriter::create(&path, LogOptions { compression, ..Default::default() }).unwrap();
            log.metadata("long", BTreeMap::from([("text".to_owned(), "x".repeat(200_000))])).unwrap();
            write(&mut log, 12);
            let data = Cow::Owned(vec![7; 300_000]);
            let (name, media_type) = ("a".to_owned(), "b".to_owned());
            log.attachment(&Attachment { log_time: 1, create_time: 2, name, media_type, data }).unwrap();
            write(&mut log, 3);
            log.finish(Outcome::Complete).unwrap();
            let (messages, damage) = read(&path);
            assert_eq!((messages.len(), damage), (15, vec![]));
            let expected = (0..6).map(|number| message(number / 2)).chain((3..12).map(message));
            assert!(messages.into_iter().eq(expected), "{compression:?}");
            let bytes = std::fs::read(&path).unwrap();
            assert!(mcap::MessageStream::new(&bytes).unwrap().all(|message| message.is_ok()));
            let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
            let attachment = mcap::read::attachment(&bytes, &summary.attachment_indexes[0]).unwrap();
            assert_eq!(attachment.data.len(), 300_000);
            assert_eq!(summary.stats.unwrap().message_count, 15);
        }
    }

    #[test]
    fn a_writer_that_dies_leaves_all_closed_chunks_and_nothing_of_the_open_one() {
        let folder = tempfile::tempdir().unwrap();
        for (compression, number) in COMPRESSIONS.into_iter().zip(0..) {
            let path = folder.path().join(format!("{number}.mcap"));
            let mut log = LogWriter::create(&path, LogOptions { compression, chunk_size: 1 << 29 }).unwrap();
            write(&mut log, 7);
            log.flush().unwrap();
            write(&mut log, 9);
            // As if the process was killed: nothing more is written.
            std::mem::forget(log);
            let (messages, damage) = read(&path.with_extension("mcap.part"));
            assert!(messages.into_iter().eq((0..7).map(message)), "{compression:?}");
            assert!(matches!(damage[..], [Damage::NoEnd { .. }]), "{damage:?}");
        }
    }
}
