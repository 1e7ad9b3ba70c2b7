//! What is compressed with zstd in the ways of rosbag2: whole files, and messages each by itself.

use super::bytes::FileBytes;
use super::chunk::decompress_zstd;
use super::damage::ChunkFault;
use super::damage::LARGEST;
use super::definitions::Definitions;
use super::record::{MessageRecord, push_message, record_at};
use mcap::records::op;
use std::io::{self, Read, Write};
use tempfile::{NamedTempFile, TempPath};

/// What a frame of zstd begins with. Messages in CDR begin with a zero.
pub(crate) const ZSTD_MAGIC: &[u8] = b"\x28\xb5\x2f\xfd";

/// The messages among some records, those unpacked that are compressed by themselves. A message that cannot be unpacked stays
/// as it is.
pub(crate) fn unpack_messages(records: &[u8], definitions: &Definitions) -> Result<Vec<u8>, ChunkFault> {
    let mut unpacked = Vec::new();
    let mut position = 0;
    while let Some(record) = record_at(records, position) {
        position = record.end();
        if record.opcode != op::MESSAGE {
            continue;
        }
        let message = MessageRecord::parse(record.body).ok_or(ChunkFault::Records)?;
        let MessageRecord { channel, sequence, log_time, publish_time, data } = message;
        let is_packed = data.starts_with(ZSTD_MAGIC) && definitions.is_cdr(channel);
        let room = LARGEST.saturating_sub(unpacked.len() as u64);
        let whole = if is_packed { unpack(data, room)? } else { None };
        push_message(&mut unpacked, channel, sequence, log_time, publish_time, whole.as_deref().unwrap_or(data));
    }
    Ok(unpacked)
}

/// A message that is a frame of zstd; none if it is a damaged one.
fn unpack(data: &[u8], room: u64) -> Result<Option<Vec<u8>>, ChunkFault> {
    // A frame says how long its contents are, unless it was written bit by bit.
    let told = zstd::zstd_safe::get_frame_content_size(data).ok().flatten();
    let size = told.unwrap_or(room);
    match decompress_zstd(data, size.min(room), Vec::new()) {
        _ if told.is_some_and(|size| size > room) => Err(ChunkFault::TooMuch { size }),
        Ok(message) if message.len() as u64 > room => Err(ChunkFault::TooMuch { size: message.len() as u64 }),
        Ok(message) => Ok(Some(message)),
        Err(ChunkFault::Decompression) => Ok(None),
        Err(other) => Err(other),
    }
}

/// What was in a packed file.
pub(crate) struct Unpacked {
    pub(crate) bytes: FileBytes,
    /// Its name, which goes when this is dropped; whoever has opened it by then goes on reading.
    pub(crate) name: TempPath,
    /// Whether all of it is there.
    pub(crate) is_whole: bool,
}

/// Unpacks a whole file among the temporary files.
pub(crate) fn unpack_file(file: &FileBytes) -> io::Result<Unpacked> {
    let (mut unpacked, name) = NamedTempFile::new()?.into_parts();
    let mut decoder = zstd::stream::read::Decoder::new(file.part(0..file.len()))?;
    let mut buffer = vec![0; 1 << 18];
    let is_whole = loop {
        match decoder.read(&mut buffer) {
            Ok(0) => break true,
            Ok(count) => unpacked.write_all(&buffer[..count])?,
            // What comes before damage is taken.
            Err(_) => break false,
        }
    };
    Ok(Unpacked { bytes: FileBytes::of(unpacked)?, name, is_whole })
}
