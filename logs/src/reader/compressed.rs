//! The zstd compression of rosbag2: of whole files, and of individual messages.

use super::bytes::FileBytes;
use super::chunk::decompress_zstd;
use super::damage::ChunkFault;
use super::damage::LARGEST;
use super::definitions::Definitions;
use super::record::{MessageRecord, push_message, record_at};
use mcap::records::op;
use std::io::{self, Read, Write};
use tempfile::{NamedTempFile, TempPath};

/// The magic bytes of a zstd frame. CDR messages start with a zero.
pub(crate) const ZSTD_MAGIC: &[u8] = b"\x28\xb5\x2f\xfd";

/// Copies the messages in `records`, with individually compressed ones decompressed. A message that cannot be
/// decompressed is unchanged.
pub(crate) fn decompress_messages(records: &[u8], definitions: &Definitions) -> Result<Vec<u8>, ChunkFault> {
    let mut decompressed = Vec::new();
    let mut position = 0;
    while let Some(record) = record_at(records, position) {
        position = record.end();
        if record.opcode != op::MESSAGE {
            continue;
        }
        let message = MessageRecord::parse(record.body).ok_or(ChunkFault::Records)?;
        let MessageRecord { channel, sequence, log_time, publish_time, data } = message;
        let is_compressed = data.starts_with(ZSTD_MAGIC) && definitions.is_cdr(channel);
        let room = LARGEST.saturating_sub(decompressed.len() as u64);
        let whole = if is_compressed { decompress(data, room)? } else { None };
        push_message(&mut decompressed, channel, sequence, log_time, publish_time, whole.as_deref().unwrap_or(data));
    }
    Ok(decompressed)
}

/// Decompresses a message that is a zstd frame; `None` if it is damaged.
fn decompress(data: &[u8], room: u64) -> Result<Option<Vec<u8>>, ChunkFault> {
    // A frame contains its size, unless it was written as a stream.
    let stated = zstd::zstd_safe::get_frame_content_size(data).ok().flatten();
    let size = stated.unwrap_or(room);
    match decompress_zstd(data, size.min(room), Vec::new()) {
        _ if stated.is_some_and(|size| size > room) => Err(ChunkFault::TooMuch { size }),
        Ok(message) if message.len() as u64 > room => Err(ChunkFault::TooMuch { size: message.len() as u64 }),
        Ok(message) => Ok(Some(message)),
        Err(ChunkFault::Decompression) => Ok(None),
        Err(other) => Err(other),
    }
}

/// A decompressed file.
pub(crate) struct Decompressed {
    pub(crate) bytes: FileBytes,
    /// The path of the temporary file, which is deleted on drop; programs that have it open can still read it.
    pub(crate) name: TempPath,
    /// Whether the compressed file was complete.
    pub(crate) is_whole: bool,
}

/// Decompresses a whole file to a temporary file.
pub(crate) fn decompress_file(file: &FileBytes) -> io::Result<Decompressed> {
    let (mut decompressed, name) = NamedTempFile::new()?.into_parts();
    let mut decoder = zstd::stream::read::Decoder::new(file.part(0..file.len()))?;
    let mut buffer = vec![0; 1 << 18];
    let is_whole = loop {
        match decoder.read(&mut buffer) {
            Ok(0) => break true,
            Ok(count) => decompressed.write_all(&buffer[..count])?,
            // The data before the damage is kept.
            Err(_) => break false,
        }
    };
    Ok(Decompressed { bytes: FileBytes::of(decompressed)?, name, is_whole })
}
