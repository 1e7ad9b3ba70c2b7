//! Writing of a bag: chunks with their indexes, and at the end all connections and the times of all chunks.

use super::definition::Ros1Type;
use super::record::{HeaderBytes, LAST_TIME, push_record, time_bytes};
use crate::dynamic::{Ros1Encoder, Schema};
use crate::file::OutputFile;
use crate::qos::is_transient_local;
use crate::reader::ros1::{BAG, CHUNK, CHUNK_INFO, CONNECTION, INDEX, MAGIC, MESSAGE};
use crate::schemas::schema_text;
use crate::sink::{Compression, LogOptions, LogWriteError, Outcome};
use gridweave_runtime::message::Channel;
use mcap::records::MessageHeader;
use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::{self, Write};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// The length of the first record, which is written again when the bag is closed: its fields, and spaces.
const FIRST_RECORD: usize = 4096;
/// The maximum length of a message, bytes: a chunk with it and its index must be shorter than 4 GiB.
const LARGEST: usize = 1 << 30;

/// Writes a ROS 1 bag (format 2.0), chunked and indexed.
///
/// The file is written as `NAME.part` and renamed when it is [finished](Self::finish). Until then it has no index, and
/// neither has a bag whose run has failed: programs of ROS report it as not indexed, and `rosbag reindex` repairs it.
pub(in crate::sink) struct BagWriter {
    path: PathBuf,
    output: OutputFile,
    file: File,
    /// The length of the file.
    length: u64,
    options: LogOptions,
    connections: Vec<Connection>,
    /// The numbers of the channels.
    numbers: HashMap<Channel, u16>,
    chunk: OpenChunk,
    chunks: Vec<ChunkInfo>,
}

/// A topic with messages of one type.
struct Connection {
    /// Its record.
    record: Vec<u8>,
    encoder: Ros1Encoder,
    messages: u32,
}

/// The chunk that is being filled.
#[derive(Default)]
struct OpenChunk {
    records: Vec<u8>,
    /// By connection: the time and the place of each message.
    index: BTreeMap<u32, Vec<(u64, u32)>>,
}

/// A written chunk.
struct ChunkInfo {
    position: u64,
    first_time: u64,
    last_time: u64,
    /// The number of messages by connection.
    counts: Vec<(u32, u32)>,
}

impl BagWriter {
    /// Starts a bag at `path`. When it is complete, it replaces a file of that name. Of the compressions, `Zstd`
    /// becomes LZ4, as bags know no other that is fast.
    ///
    /// # Errors
    /// Another program writes it, it is a folder or a device, or the file system does not allow it.
    pub(in crate::sink) fn create(path: &Path, options: LogOptions) -> Result<Self, LogWriteError> {
        let mut output = OutputFile::create(path)?;
        let file = output.file().try_clone().map_err(|error| LogWriteError::from_io(path, error))?;
        output.keep(true);
        let mut bag = Self {
            path: path.to_owned(),
            output,
            file,
            length: 0,
            options,
            connections: Vec::new(),
            numbers: HashMap::new(),
            chunk: OpenChunk::default(),
            chunks: Vec::new(),
        };
        let first = [MAGIC, &bag.first_record(0)].concat();
        bag.append(&first)?;
        Ok(bag)
    }

    /// Sets whether the partial file is kept if the bag is not finished. By default it is.
    pub(in crate::sink) fn keep(&mut self, is_kept: bool) {
        self.output.keep(is_kept);
    }

    /// The number of a channel. A channel that was added before keeps its number. The inner error says why a bag cannot
    /// hold its messages.
    pub(in crate::sink) fn channel(&mut self, channel: &Channel) -> Result<Result<u16, String>, LogWriteError> {
        if let Some(&number) = self.numbers.get(channel) {
            return Ok(Ok(number));
        }
        let number = self.number(self.connections.len())?;
        let schema = match channel.schema.is_empty() {
            true => Cow::Owned(schema_text(&channel.schema_name).unwrap_or_default()),
            false => String::from_utf8_lossy(&channel.schema),
        };
        let found = match Schema::of_channel(channel) {
            Ok(found) => found,
            Err(error) => return Ok(Err(error.to_string())),
        };
        let Some(of) = Ros1Type::new(&channel.schema_name, &schema) else {
            return Ok(Err("its type is not defined".to_owned()));
        };
        let is_left_out = |name: &str, field: &str| of.left_out.contains(&(name.to_owned(), field.to_owned()));
        let Some(encoder) = Ros1Encoder::new(found, is_left_out) else {
            return Ok(Err("ROS 1 has no wstring".to_owned()));
        };
        let record = connection_record(u32::from(number), channel, &of);
        self.connections.push(Connection { record, encoder, messages: 0 });
        self.numbers.insert(channel.clone(), number);
        Ok(Ok(number))
    }

    fn number(&self, place: usize) -> Result<u16, LogWriteError> {
        let many =
            |_| LogWriteError::Format { path: self.path.clone(), message: "more than 65,535 channels".to_owned() };
        u16::try_from(place).map_err(many)
    }

    /// Writes a message (CDR) on the channel whose number is in the header. The inner error says why it was left out.
    pub(in crate::sink) fn write(
        &mut self,
        header: &MessageHeader,
        bytes: &[u8],
    ) -> Result<Result<(), String>, LogWriteError> {
        let number = u32::from(header.channel_id);
        let Some(connection) = self.connections.get_mut(usize::from(header.channel_id)) else {
            return Ok(Err("its channel is not known".to_owned()));
        };
        if header.log_time > LAST_TIME {
            return Ok(Err(
                "its time is after the year 2106, where the times of ROS 1 end; an MCAP log holds it".to_owned()
            ));
        }
        let mut message = Vec::new();
        if let Err(error) = connection.encoder.append(bytes, connection.messages, &mut message) {
            return Ok(Err(error.to_string()));
        }
        if message.len() > LARGEST {
            return Ok(Err("it is larger than 1 GiB".to_owned()));
        }
        connection.messages = connection.messages.wrapping_add(1);
        let open = self.chunk.records.len();
        // A large message gets a chunk of its own.
        if open > 0 && (open + message.len()) as u64 > self.options.chunk_size {
            self.close_chunk()?;
        }
        let Some(connection) = self.connections.get(usize::from(header.channel_id)) else { return Ok(Ok(())) };
        let OpenChunk { records, index } = &mut self.chunk;
        let entries = index.entry(number).or_insert_with(|| {
            // Each chunk can be read by itself.
            records.extend_from_slice(&connection.record);
            Vec::new()
        });
        let place = u32::try_from(records.len()).unwrap_or(u32::MAX);
        entries.push((header.log_time, place));
        let fields = HeaderBytes::of(MESSAGE).with_u32("conn", number).with("time", &time_bytes(header.log_time));
        push_record(records, &fields, &message);
        match records.len() as u64 >= self.options.chunk_size {
            true => self.close_chunk().map(Ok),
            false => Ok(Ok(())),
        }
    }

    /// Writes the open chunk, and the index of each of its connections.
    fn close_chunk(&mut self) -> Result<(), LogWriteError> {
        let OpenChunk { records, index } = std::mem::take(&mut self.chunk);
        if records.is_empty() {
            return Ok(());
        }
        let (compression, data) = match self.options.compression {
            Compression::None => ("none", Cow::Borrowed(&records)),
            Compression::Lz4 | Compression::Zstd => {
                ("lz4", Cow::Owned(lz4(&records).map_err(|error| LogWriteError::from_io(&self.path, error))?))
            }
        };
        let size = u32::try_from(records.len()).unwrap_or(u32::MAX);
        let header = HeaderBytes::of(CHUNK).with("compression", compression.as_bytes()).with_u32("size", size);
        let mut bytes = Vec::with_capacity(data.len() + 4096);
        push_record(&mut bytes, &header, &data);
        let times = || index.values().flatten().map(|(time, _)| *time);
        self.chunks.push(ChunkInfo {
            position: self.length,
            first_time: times().min().unwrap_or_default(),
            last_time: times().max().unwrap_or_default(),
            counts: index.iter().map(|(number, entries)| (*number, entries.len() as u32)).collect(),
        });
        for (number, entries) in &index {
            let entry = |(time, place): &(u64, u32)| [&time_bytes(*time)[..], &place.to_le_bytes()].concat();
            let header = HeaderBytes::of(INDEX).with_u32("ver", 1).with_u32("conn", *number);
            let header = header.with_u32("count", entries.len() as u32);
            push_record(&mut bytes, &header, &entries.iter().flat_map(entry).collect::<Vec<u8>>());
        }
        self.append(&bytes)
    }

    /// Ends the bag, and returns its path. A complete one gets an index, and replaces a file of its name. An incomplete
    /// one has none, and replaces no file: if there is one, it stays at `NAME.part`.
    ///
    /// # Errors
    /// The file cannot be written or renamed.
    pub(in crate::sink) fn finish(mut self, outcome: Outcome<'_>) -> Result<PathBuf, LogWriteError> {
        if matches!(outcome, Outcome::Incomplete(_)) {
            self.close_chunk()?;
            return Ok(self.output.put_in_free_place()?);
        }
        let path = self.path.clone();
        self.end()?.put_in_place()?;
        Ok(path)
    }

    /// Ends the complete bag with an index. It stays at `NAME.part`.
    pub(in crate::sink) fn end(mut self) -> Result<OutputFile, LogWriteError> {
        self.close_chunk()?;
        let place = self.length;
        let mut bytes: Vec<u8> = self.connections.iter().flat_map(|connection| &connection.record).copied().collect();
        for chunk in &self.chunks {
            let header = HeaderBytes::of(CHUNK_INFO)
                .with_u32("ver", 1)
                .with("chunk_pos", &chunk.position.to_le_bytes())
                .with("start_time", &time_bytes(chunk.first_time))
                .with("end_time", &time_bytes(chunk.last_time))
                .with_u32("count", chunk.counts.len() as u32);
            let count = |(number, count): &(u32, u32)| [number.to_le_bytes(), count.to_le_bytes()].concat();
            push_record(&mut bytes, &header, &chunk.counts.iter().flat_map(count).collect::<Vec<u8>>());
        }
        self.append(&bytes)?;
        let first = self.first_record(place);
        let written = self.file.write_all_at(&first, MAGIC.len() as u64);
        written.map_err(|error| LogWriteError::from_io(&self.path, error))?;
        Ok(self.output)
    }

    /// The first record, with the place of the index; 0 for none.
    fn first_record(&self, index: u64) -> Vec<u8> {
        let header = HeaderBytes::of(BAG)
            .with("index_pos", &index.to_le_bytes())
            .with_u32("conn_count", self.connections.len() as u32)
            .with_u32("chunk_count", self.chunks.len() as u32);
        let mut bytes = Vec::with_capacity(FIRST_RECORD);
        let spaces = vec![b' '; FIRST_RECORD - header.bytes().len() - 8];
        push_record(&mut bytes, &header, &spaces);
        bytes
    }

    fn append(&mut self, bytes: &[u8]) -> Result<(), LogWriteError> {
        let written = self.file.write_all_at(bytes, self.length);
        written.map_err(|error| LogWriteError::from_io(&self.path, error))?;
        self.length += bytes.len() as u64;
        Ok(())
    }
}

/// The record of a connection: its topic, and its type with the definition and the MD5 sum.
fn connection_record(number: u32, channel: &Channel, of: &Ros1Type) -> Vec<u8> {
    let topic = channel.topic.as_bytes();
    let latching: &[u8] = if is_transient_local(&channel.metadata) { b"1" } else { b"0" };
    let described = HeaderBytes::default()
        .with("topic", topic)
        .with("type", of.name.as_bytes())
        .with("md5sum", of.md5.as_bytes())
        .with("message_definition", of.definition.as_bytes())
        .with("callerid", b"/gridweave")
        .with("latching", latching);
    let mut record = Vec::new();
    push_record(
        &mut record,
        &HeaderBytes::of(CONNECTION).with_u32("conn", number).with("topic", topic),
        described.bytes(),
    );
    record
}

/// Compresses a chunk in the only form of LZ4 frames that `roslz4` reads: independent blocks, a checksum of the
/// contents, and no other.
fn lz4(bytes: &[u8]) -> io::Result<Vec<u8>> {
    let mut encoder = lz4::EncoderBuilder::new()
        .block_size(lz4::BlockSize::Max1MB)
        .block_mode(lz4::BlockMode::Independent)
        .block_checksum(lz4::liblz4::BlockChecksum::NoBlockChecksum)
        .checksum(lz4::ContentChecksum::ChecksumEnabled)
        .build(Vec::new())?;
    encoder.write_all(bytes)?;
    let (compressed, result) = encoder.finish();
    result.map(|()| compressed)
}
