//! Chunks: many records, compressed together.

use super::bytes::{FileBytes, Window};
use super::damage::{ChunkFault, LARGEST};
use super::record::{Fields, HEAD, Record, wanted};
use mcap::records::op;
use std::io::Read;
use std::ops::Range;

/// The most bytes for a chunk that is cut and does not say its size, as one does whose recorder was killed. Recorders close a chunk
/// after 1 to 16 MB.
const LARGEST_UNTOLD: u64 = 64 << 20;

/// A chunk, as its header describes it.
#[derive(Clone, Debug)]
pub(crate) struct Chunk {
    pub(crate) first_time: u64,
    pub(crate) last_time: u64,
    pub(crate) compression: String,
    /// Bytes of its contents, uncompressed.
    pub(crate) size: u64,
    /// CRC-32 of its contents, uncompressed; 0 if it was not taken.
    pub(crate) checksum: u32,
    /// Where its contents lie in the file.
    pub(crate) data: Range<usize>,
    /// Whether the file breaks off inside of it.
    pub(crate) cut: bool,
}

impl Chunk {
    /// Reads a chunk record. `None` if its lengths contradict each other.
    pub(crate) fn parse(record: &Record<'_>) -> Option<Self> {
        let (mut chunk, length) = Self::parse_header(record.body, record.position + HEAD)?;
        chunk.data.end = chunk.data.start.checked_add(usize::try_from(length).ok()?)?;
        (chunk.data.end == record.end()).then_some(chunk)
    }

    /// Reads a chunk at `position` that the end of the file cuts.
    pub(crate) fn parse_cut(file: &mut Window<'_>, position: usize) -> Option<Self> {
        let (start, end) = (position.checked_add(HEAD)?, file.file_length());
        let header = end.checked_sub(start)?.min(wanted(op::CHUNK));
        let (mut chunk, _) = Self::parse_header(file.bytes(start, header)?, start)?;
        chunk.data.end = end;
        chunk.cut = true;
        Some(chunk)
    }

    /// The chunk that a body at `start` describes, its data still empty, and the length that the data should have.
    fn parse_header(body: &[u8], start: usize) -> Option<(Self, u64)> {
        let mut fields = Fields(body);
        let (first_time, last_time) = (fields.u64()?, fields.u64()?);
        let (size, checksum) = (fields.u64()?, fields.u32()?);
        let (compression, length) = (fields.text()?, fields.u64()?);
        let data = start + body.len() - fields.0.len();
        Some((Self { first_time, last_time, compression, size, checksum, data: data..data, cut: false }, length))
    }

    /// The chunk's records, uncompressed and checked, in `memory` in place of what that holds. Those of a chunk that is cut: as
    /// far as they go, unchecked.
    pub(crate) fn contents(&self, file: &FileBytes, memory: Vec<u8>) -> Result<Vec<u8>, ChunkFault> {
        let most = match self.size {
            // What recorders write before a chunk is whole.
            0 | u64::MAX if self.cut => LARGEST_UNTOLD,
            size => size,
        };
        // Neither what is read nor what becomes of it; one that is cut is read bit by bit.
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

/// A byte of a log rarely stands for more.
const USUAL_RATIO: u64 = 256;

/// `memory`, emptied, with room for `size` bytes, or for what `data` can be expected to become. The size is the file's word
/// only, so it may be absurd.
fn reserve(size: u64, data: &[u8], memory: Vec<u8>) -> Result<Vec<u8>, ChunkFault> {
    let mut buffer = memory;
    buffer.clear();
    let size = usize::try_from(size.min(USUAL_RATIO * data.len() as u64)).map_err(|_| ChunkFault::TooLarge)?;
    buffer.try_reserve_exact(size).map_err(|_| ChunkFault::TooLarge)?;
    Ok(buffer)
}

/// The contents of one or more frames of zstd, in `memory` in place of what that holds: at most `size` bytes and one more, or as
/// many as `memory` has room for.
pub(crate) fn decompress_zstd(data: &[u8], size: u64, memory: Vec<u8>) -> Result<Vec<u8>, ChunkFault> {
    let mut buffer = reserve(size, data, memory)?;
    if buffer.capacity() as u64 >= size {
        let mut decompressor = zstd::bulk::Decompressor::new().map_err(|_| ChunkFault::Decompression)?;
        decompressor.decompress_to_buffer(data, &mut buffer).map_err(|_| ChunkFault::Decompression)?;
    } else {
        // The buffer grows with what there really is.
        let decoder = zstd::stream::read::Decoder::with_buffer(data).map_err(|_| ChunkFault::Decompression)?;
        decoder.take(size.saturating_add(1)).read_to_end(&mut buffer).map_err(|_| ChunkFault::Decompression)?;
    }
    Ok(buffer)
}

/// The contents of one or more frames of lz4, at most `size` bytes and one more, in `memory` in place of what that holds.
pub(crate) fn decompress_lz4(data: &[u8], size: u64, memory: Vec<u8>) -> Result<Vec<u8>, ChunkFault> {
    let mut buffer = reserve(size, data, memory)?;
    let mut rest = data;
    // The data may be several frames; a decoder reads one, and stops behind it.
    while !rest.is_empty() {
        let room = size.saturating_sub(buffer.len() as u64);
        let decoder = lz4::Decoder::new(&mut rest).map_err(|_| ChunkFault::Decompression)?;
        // One byte more than there is room for shows that the header's size is wrong.
        decoder.take(room.saturating_add(1)).read_to_end(&mut buffer).map_err(|_| ChunkFault::Decompression)?;
    }
    Ok(buffer)
}

/// The contents of one or more streams of bzip2, at most `size` bytes and one more.
pub(crate) fn decompress_bz2(data: &[u8], size: u64) -> Result<Vec<u8>, ChunkFault> {
    let mut buffer = reserve(size, data, Vec::new())?;
    let decoder = bzip2::read::MultiBzDecoder::new(data);
    decoder.take(size.saturating_add(1)).read_to_end(&mut buffer).map_err(|_| ChunkFault::Decompression)?;
    Ok(buffer)
}

/// What a reader gives until it fails, its input ends, or it has given `most` bytes.
fn read_cut(decoder: std::io::Result<impl Read>, most: u64) -> Vec<u8> {
    let mut buffer = Vec::new();
    if let Ok(decoder) = decoder {
        let mut decoder = decoder.take(most);
        // The error at the end is expected: the input breaks off. What came before it is kept.
        let _ = decoder.read_to_end(&mut buffer);
    }
    buffer
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chunk_gives_no_more_than_it_says_and_no_more_than_is_read() {
        let zeros = |size: u64| std::io::repeat(0).take(size);
        let data = zstd::stream::encode_all(zeros(LARGEST_UNTOLD + 1), 1).unwrap();
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
        for untold in [0, u64::MAX] {
            assert_eq!(length(&chunk(untold, true)), Ok(LARGEST_UNTOLD));
        }
        assert_eq!(length(&chunk(1 << 20, false)), Err(ChunkFault::Decompression));
        for cut in [false, true] {
            assert_eq!(length(&chunk(LARGEST + 1, cut)), Err(ChunkFault::TooMuch { size: LARGEST + 1 }));
        }
        assert_eq!(length(&chunk(LARGEST_UNTOLD + 1, false)), Ok(LARGEST_UNTOLD + 1));
    }
}
