//! The zstd compression of rosbag2: of whole files, and of individual messages.

use super::bytes::FileBytes;
use super::chunk::decompress_zstd;
use super::damage::ChunkFault;
use super::definitions::Definitions;
use super::record::copy_messages;
use crate::temporary;
use std::io::{self, Read, Write};

/// The magic bytes of a zstd frame. CDR messages start with a zero.
pub(crate) const ZSTD_MAGIC: &[u8] = b"\x28\xb5\x2f\xfd";

/// Copies the messages in `records`, with individually compressed ones decompressed, to at most `most` bytes. A message
/// that cannot be decompressed is unchanged.
pub(crate) fn decompress_messages(records: &[u8], definitions: &Definitions, most: u64) -> Result<Vec<u8>, ChunkFault> {
    let (decompressed, _) = copy_messages(records, |channel, data, copy| {
        let is_compressed = data.starts_with(ZSTD_MAGIC) && definitions.is_cdr(channel);
        let room = most.saturating_sub(copy.len() as u64);
        let whole = if is_compressed { decompress(data, room)? } else { None };
        copy.extend_from_slice(whole.as_deref().unwrap_or(data));
        Ok(true)
    })?;
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

/// The maximum size of a decompressed file, bytes: this, or so many times the size of the compressed one.
const LARGEST_ANYWAY: u64 = 1 << 30;
const LARGEST_RATIO: u64 = 1024;

/// A decompressed file. It has no name, so nothing of it is left, however this process ends.
pub(crate) struct Decompressed {
    pub(crate) bytes: FileBytes,
    /// Whether the compressed file was complete.
    pub(crate) is_whole: bool,
}

/// Decompresses a whole file to a temporary file.
///
/// # Errors
/// The temporary file cannot be written, or would be too large.
pub(crate) fn decompress_file(file: &FileBytes) -> io::Result<Decompressed> {
    let most = LARGEST_ANYWAY.max(LARGEST_RATIO.saturating_mul(file.len() as u64));
    decompress_up_to(file, most)
}

fn decompress_up_to(file: &FileBytes, most: u64) -> io::Result<Decompressed> {
    let mut decompressed = temporary::file()?;
    let mut decoder = zstd::stream::read::Decoder::new(file.part(0..file.len()))?;
    let mut buffer = vec![0; 1 << 18];
    let mut length = 0;
    let is_whole = loop {
        match decoder.read(&mut buffer) {
            Ok(0) => break true,
            Ok(count) => {
                length += count as u64;
                if length > most {
                    let text = format!("it expands to more than {most} bytes, the maximum for its {}", file.len());
                    return Err(io::Error::new(io::ErrorKind::FileTooLarge, text));
                }
                decompressed.write_all(&buffer[..count]).map_err(|error| temporary::in_words(&error))?;
            }
            // The data before the damage is kept.
            Err(_) => break false,
        }
    };
    Ok(Decompressed { bytes: FileBytes::of(decompressed)?, is_whole })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_decompressed_up_to_its_limit_and_leaves_no_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("zeros.zstd");
        std::fs::write(&path, zstd::stream::encode_all(io::repeat(0).take(3 << 20), 1).unwrap()).unwrap();
        let file = FileBytes::open(&path).unwrap();
        let Decompressed { bytes, is_whole } = decompress_up_to(&file, 3 << 20).unwrap();
        assert_eq!((bytes.len(), is_whole, bytes.links()), (3 << 20, true, Some(0)));
        let error = decompress_up_to(&file, (3 << 20) - 1).err().unwrap().to_string();
        assert!(error.contains("more than 3145727 bytes"), "{error}");
    }
}
