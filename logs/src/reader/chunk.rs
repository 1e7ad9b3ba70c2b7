//! Chunks: records that are compressed together.

use super::bytes::{FileBytes, Window};
use super::damage::{ChunkFault, LARGEST};
use super::record::{Fields, HEAD, Record, wanted};
use mcap::records::op;
use std::io::Read;
use std::ops::Range;

/// The maximum size of a truncated chunk without a known size, as left by a killed recorder, bytes. Recorders close a
/// chunk after 1 to 16 MB.
const LARGEST_UNKNOWN_SIZE: u64 = 64 << 20;

/// A chunk, as described by its header.
#[derive(Clone, Debug)]
pub(crate) struct Chunk {
    pub(crate) first_time: u64,
    pub(crate) last_time: u64,
    pub(crate) compression: String,
    /// The uncompressed size of its contents, bytes.
    pub(crate) size: u64,
    /// CRC-32 of the uncompressed contents; 0 if there is none.
    pub(crate) checksum: u32,
    /// The location of its contents in the file.
    pub(crate) data: Range<usize>,
    /// Whether the file ends within the chunk.
    pub(crate) cut: bool,
}

impl Chunk {
    /// Parses a chunk record. `None` if its lengths are inconsistent.
    pub(crate) fn parse(record: &Record<'_>) -> Option<Self> {
        let (mut chunk, length) = Self::parse_header(record.body, record.position + HEAD)?;
        chunk.data.end = chunk.data.start.checked_add(usize::try_from(length).ok()?)?;
        (chunk.data.end == record.end()).then_some(chunk)
    }

    /// Parses a chunk at `position` that is truncated by the end of the file.
    pub(crate) fn parse_cut(file: &mut Window<'_>, position: usize) -> Option<Self> {
        let (start, end) = (position.checked_add(HEAD)?, file.file_length());
        let header = end.checked_sub(start)?.min(wanted(op::CHUNK));
        let (mut chunk, _) = Self::parse_header(file.bytes(start, header)?, start)?;
        chunk.data.end = end;
        chunk.cut = true;
        Some(chunk)
    }

    /// Parses the header in a chunk's body at `start`. Returns the chunk, with its data still empty, and the length of
    /// the data.
    fn parse_header(body: &[u8], start: usize) -> Option<(Self, u64)> {
        let mut fields = Fields(body);
        let (first_time, last_time) = (fields.u64()?, fields.u64()?);
        let (size, checksum) = (fields.u64()?, fields.u32()?);
        let (compression, length) = (fields.text()?, fields.u64()?);
        let data = start + body.len() - fields.0.len();
        Some((Self { first_time, last_time, compression, size, checksum, data: data..data, cut: false }, length))
    }

    /// The maximum size of its contents, bytes.
    pub(crate) fn most_contents(&self) -> u64 {
        match self.size {
            // Recorders write this before a chunk is complete.
            0 | u64::MAX if self.cut => LARGEST_UNKNOWN_SIZE,
            size => size,
        }
    }

    /// The chunk's records, decompressed and verified. They are stored in `memory`, whose contents are replaced. The
    /// records of a truncated chunk are not verified.
    pub(crate) fn contents(&self, file: &FileBytes, memory: Vec<u8>) -> Result<Vec<u8>, ChunkFault> {
        let most = self.most_contents();
        // Limits what is read and what it decompresses to; a truncated chunk is decompressed in pieces.
        let most_read = if self.cut { most } else { most.max(self.data.len() as u64) };
        if most_read > LARGEST {
            return Err(ChunkFault::TooMuch { size: most_read });
        }
        if self.cut {
            let data = file.part(self.data.clone());
            return match self.compression.as_str() {
                "" => Ok(read_cut(Ok(data), LARGEST)),
                "zstd" => Ok(read_cut(zstd::stream::read::Decoder::new(data), most)),
                "lz4" => Ok(read_cut(lz4::Decoder::new(data), most)),
                other => Err(ChunkFault::UnknownCompression(other.to_owned())),
            };
        }
        let data = || file.read(self.data.clone()).ok_or(ChunkFault::Records);
        let (contents, checksum) = match self.compression.as_str() {
            "" => {
                let read = file.read_with_checksum(self.data.clone(), memory);
                read.map(|(contents, checksum)| (contents, Some(checksum))).ok_or(ChunkFault::Records)?
            }
            "zstd" => (decompress_zstd(&data()?, self.size, memory)?, None),
            "lz4" => (decompress_lz4(&data()?, self.size, memory)?, None),
            other => return Err(ChunkFault::UnknownCompression(other.to_owned())),
        };
        if contents.len() as u64 != self.size {
            return Err(ChunkFault::Decompression);
        }
        if self.checksum != 0 && checksum.unwrap_or_else(|| crc32fast::hash(&contents)) != self.checksum {
            return Err(ChunkFault::Checksum);
        }
        Ok(contents)
    }
}

/// The usual limit of a compression ratio.
const USUAL_RATIO: u64 = 256;

/// `memory`, emptied, with capacity for `size` bytes, or for what `data` usually decompresses to if that is less: the
/// size comes from the file and may be absurd.
fn reserve(size: u64, data: &[u8], memory: Vec<u8>) -> Result<Vec<u8>, ChunkFault> {
    let mut buffer = memory;
    buffer.clear();
    let size = usize::try_from(size.min(USUAL_RATIO * data.len() as u64)).map_err(|_| ChunkFault::TooLarge)?;
    buffer.try_reserve_exact(size).map_err(|_| ChunkFault::TooLarge)?;
    Ok(buffer)
}

/// Decompresses one or more zstd frames, into `memory`, whose contents are replaced: at most `size` bytes and one more,
/// or as many as `memory` has room for.
pub(crate) fn decompress_zstd(data: &[u8], size: u64, memory: Vec<u8>) -> Result<Vec<u8>, ChunkFault> {
    let mut buffer = reserve(size, data, memory)?;
    if buffer.capacity() as u64 >= size {
        let mut decompressor = zstd::bulk::Decompressor::new().map_err(|_| ChunkFault::Decompression)?;
        decompressor.decompress_to_buffer(data, &mut buffer).map_err(|_| ChunkFault::Decompression)?;
    } else {
        // The buffer grows with the actual data.
        let decoder = zstd::stream::read::Decoder::with_buffer(data).map_err(|_| ChunkFault::Decompression)?;
        decoder.take(size.saturating_add(1)).read_to_end(&mut buffer).map_err(|_| ChunkFault::Decompression)?;
    }
    Ok(buffer)
}

/// Decompresses one or more lz4 frames, at most `size` bytes and one more, into `memory`, whose contents are replaced.
pub(crate) fn decompress_lz4(data: &[u8], size: u64, memory: Vec<u8>) -> Result<Vec<u8>, ChunkFault> {
    let mut buffer = reserve(size, data, memory)?;
    let mut rest = data;
    // The data may have several frames; a decoder stops after one.
    while !rest.is_empty() {
        let room = size.saturating_sub(buffer.len() as u64);
        let decoder = lz4::Decoder::new(&mut rest).map_err(|_| ChunkFault::Decompression)?;
        // One byte more than expected shows that the size in the header is wrong.
        decoder.take(room.saturating_add(1)).read_to_end(&mut buffer).map_err(|_| ChunkFault::Decompression)?;
    }
    Ok(buffer)
}

/// Decompresses one or more bzip2 streams, at most `size` bytes and one more.
pub(crate) fn decompress_bz2(data: &[u8], size: u64) -> Result<Vec<u8>, ChunkFault> {
    let mut buffer = reserve(size, data, Vec::new())?;
    let decoder = bzip2::read::MultiBzDecoder::new(data);
    decoder.take(size.saturating_add(1)).read_to_end(&mut buffer).map_err(|_| ChunkFault::Decompression)?;
    Ok(buffer)
}

/// The output of a decoder until it fails, its input ends, or it has returned `most` bytes.
fn read_cut(decoder: std::io::Result<impl Read>, most: u64) -> Vec<u8> {
    let mut buffer = Vec::new();
    if let Ok(decoder) = decoder {
        let mut decoder = decoder.take(most);
        // An error at the end is expected, since the input is truncated. The output before it is kept.
        let _ = decoder.read_to_end(&mut buffer);
    }
    buffer
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chunk_is_decompressed_up_to_its_size_and_up_to_the_limit() {
        let zeros = |size: u64| std::io::repeat(0).take(size);
        let data = zstd::stream::encode_all(zeros(LARGEST_UNKNOWN_SIZE + 1), 1).unwrap();
        let chunk = |size: u64, cut: bool| {
            let compression = "zstd".to_owned();
            Chunk { first_time: 0, last_time: 0, compression, size, checksum: 0, data: 0..data.len(), cut }
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("chunk");
        std::fs::write(&path, &data).unwrap();
        let file = FileBytes::open(&path).unwrap();
        let length = |chunk: &Chunk| chunk.contents(&file, Vec::new()).map(|contents| contents.len() as u64);
        assert_eq!(length(&chunk(1 << 20, true)), Ok(1 << 20));
        for unknown_size in [0, u64::MAX] {
            assert_eq!(length(&chunk(unknown_size, true)), Ok(LARGEST_UNKNOWN_SIZE));
        }
        assert_eq!(length(&chunk(1 << 20, false)), Err(ChunkFault::Decompression));
        for cut in [false, true] {
            assert_eq!(length(&chunk(LARGEST + 1, cut)), Err(ChunkFault::TooMuch { size: LARGEST + 1 }));
        }
        assert_eq!(length(&chunk(LARGEST_UNKNOWN_SIZE + 1, false)), Ok(LARGEST_UNKNOWN_SIZE + 1));
    }
}
