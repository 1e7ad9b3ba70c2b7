//! The bytes of a file, read with `pread`. Files are not memory-mapped: if another program truncates a mapped file, its
//! readers are killed by SIGBUS; `pread` only returns fewer bytes.

use super::record::{HEAD, Record, wanted};
use crate::temporary::Name;
use gridweave_runtime::input_file;
use rustix::buffer::spare_capacity;
use rustix::io::{Errno, pread};
use std::fs::File;
use std::io::{self, Read};
use std::ops::Range;
use std::os::unix::fs::FileExt;
use std::path::Path;

/// The minimum size of a read while scanning records, bytes.
const WINDOW: usize = 64 << 10;

/// The size of the pieces in which data is read and added to a checksum, so that it is still in the processor's cache,
/// bytes.
const PIECE: usize = 256 << 10;

/// A file that can be read at several positions concurrently.
#[derive(Debug)]
pub(crate) struct FileBytes {
    file: File,
    /// The length of the file when it was opened.
    length: usize,
}

impl FileBytes {
    /// Opens a regular file.
    pub(crate) fn open(path: &Path) -> io::Result<Self> {
        let file = input_file::open(path)?;
        // Opening a folder succeeds, and reading from it fails.
        file.read_at(&mut [0], 0)?;
        Self::of(file)
    }

    /// Wraps an open file.
    pub(crate) fn of(file: File) -> io::Result<Self> {
        let length = usize::try_from(file.metadata()?.len()).map_err(|_| io::ErrorKind::FileTooLarge)?;
        Ok(Self { file, length })
    }

    /// A name for a file without one.
    pub(crate) fn name(&self) -> io::Result<Name> {
        Name::of(&self.file)
    }

    /// The number of names of the file.
    #[cfg(test)]
    pub(crate) fn links(&self) -> Option<u64> {
        self.file.metadata().ok().map(|file| std::os::unix::fs::MetadataExt::nlink(&file))
    }

    /// The length of the file when it was opened.
    pub(crate) fn len(&self) -> usize {
        self.length
    }

    /// Whether another program has truncated the file since.
    pub(crate) fn is_cut(&self) -> bool {
        self.file.metadata().is_ok_and(|file| file.len() < self.length as u64)
    }

    /// The bytes of a part of the file. `None` if the file is shorter, was truncated, or there is not enough memory.
    pub(crate) fn read(&self, part: Range<usize>) -> Option<Vec<u8>> {
        let mut bytes = Vec::new();
        self.read_into(part, &mut bytes).then_some(bytes)
    }

    /// The same, stored in `memory`, whose contents are replaced; with the CRC-32 of the bytes.
    pub(crate) fn read_with_checksum(&self, part: Range<usize>, memory: Vec<u8>) -> Option<(Vec<u8>, u32)> {
        if part.start > part.end || part.end > self.length {
            return None;
        }
        let mut bytes = memory;
        bytes.truncate(part.len());
        bytes.try_reserve_exact(part.len() - bytes.len()).ok()?;
        let (mut position, mut checksum) = (0, crc32fast::Hasher::new());
        while position < part.len() {
            let end = (position + PIECE).min(part.len());
            if bytes.len() < end {
                bytes.resize(end, 0);
            }
            match pread(&self.file, &mut bytes[position..end], (part.start + position) as u64) {
                Ok(0) => return None,
                Ok(count) => {
                    checksum.update(&bytes[position..position + count]);
                    position += count;
                }
                Err(Errno::INTR) => {}
                Err(_) => return None,
            }
        }
        Some((bytes, checksum.finalize()))
    }

    /// Replaces the contents of `bytes` with a part of the file; `false` where [`read`](Self::read) returns `None`.
    pub(crate) fn read_into(&self, part: Range<usize>, bytes: &mut Vec<u8>) -> bool {
        bytes.clear();
        if part.start > part.end || part.end > self.length || bytes.try_reserve_exact(part.len()).is_err() {
            return false;
        }
        while bytes.len() < part.len() {
            let position = (part.start + bytes.len()) as u64;
            match pread(&self.file, spare_capacity(bytes), position) {
                Ok(0) => return false,
                Ok(_) | Err(Errno::INTR) => {}
                Err(_) => return false,
            }
        }
        bytes.truncate(part.len());
        true
    }

    /// A reader of a part of the file.
    pub(crate) fn part(&self, part: Range<usize>) -> impl Read {
        Part { file: self, part }
    }
}

/// The rest of a part of a file.
struct Part<'a> {
    file: &'a FileBytes,
    part: Range<usize>,
}

impl Read for Part<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let most = buffer.len().min(self.part.len());
        let count = self.file.file.read_at(&mut buffer[..most], self.part.start as u64)?;
        self.part.start += count;
        Ok(count)
    }
}

/// A buffered window of a file, for scanning its records.
pub(crate) struct Window<'a> {
    file: &'a FileBytes,
    start: usize,
    bytes: Vec<u8>,
}

impl<'a> Window<'a> {
    /// Starts at the beginning of the file.
    pub(crate) fn new(file: &'a FileBytes) -> Self {
        Self { file, start: 0, bytes: Vec::new() }
    }

    /// The length of the file.
    pub(crate) fn file_length(&self) -> usize {
        self.file.len()
    }

    /// `length` bytes at `position`. `None` if the file ends before.
    pub(crate) fn bytes(&mut self, position: usize, length: usize) -> Option<&[u8]> {
        let end = position.checked_add(length)?;
        if position < self.start || end > self.start + self.bytes.len() {
            let most = length.max(WINDOW).min(self.file.len().checked_sub(position)?);
            self.start = position;
            if most < length || !self.file.read_into(position..position + most, &mut self.bytes) {
                self.bytes.clear();
                return None;
            }
        }
        self.bytes.get(position - self.start..end - self.start)
    }

    /// The record at `position`, with as much of its body as scanning needs. `None` if the file ends within it.
    pub(crate) fn record(&mut self, position: usize) -> Option<Record<'_>> {
        let head = self.bytes(position, HEAD)?;
        let opcode = *head.first()?;
        let length = usize::try_from(u64::from_le_bytes(head.get(1..HEAD)?.try_into().ok()?)).ok()?;
        let end = position.checked_add(HEAD)?.checked_add(length)?;
        if end > self.file.len() {
            return None;
        }
        let taken = length.min(wanted(opcode));
        let body = &self.bytes(position, HEAD + taken)?[HEAD..];
        Some(Record { opcode, position, length, body })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mcap::records::op;

    fn file(bytes: &[u8]) -> (tempfile::TempDir, FileBytes) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        std::fs::write(&path, bytes).unwrap();
        let file = FileBytes::open(&path).unwrap();
        (folder, file)
    }

    #[test]
    fn a_part_outside_of_the_file_or_after_a_truncation_is_none() {
        let (folder, file) = file(b"0123456789");
        assert_eq!(file.read(2..5).unwrap(), b"234");
        assert_eq!(file.read(0..10).unwrap().len(), 10);
        assert!(file.read(5..11).is_none() && file.read(11..11).is_none() && !file.is_cut());
        File::options().write(true).open(folder.path().join("file")).unwrap().set_len(4).unwrap();
        assert!(file.read(2..5).is_none() && file.is_cut());
        assert_eq!(file.read(2..4).unwrap(), b"23");
        assert!(Window::new(&file).bytes(0, 10).is_none());
        assert!(FileBytes::open(folder.path()).is_err());
    }

    #[test]
    fn bytes_and_their_checksum_do_not_depend_on_the_memory() {
        let bytes: Vec<u8> = (0..3 * PIECE + 17).map(|byte| ((byte * 31) >> 4) as u8).collect();
        let (folder, file) = file(&bytes);
        for part in [0..bytes.len(), 5..5, 7..PIECE, 1..PIECE + 1, PIECE..3 * PIECE, bytes.len() - 1..bytes.len()] {
            for before in [0, 10, PIECE - 7, 2 * PIECE, 5 * PIECE] {
                let (read, checksum) = file.read_with_checksum(part.clone(), vec![9; before]).unwrap();
                assert!(read == bytes[part.clone()], "{part:?} in {before}");
                assert_eq!(checksum, crc32fast::hash(&bytes[part.clone()]), "{part:?} in {before}");
            }
        }
        assert!(file.read_with_checksum(0..bytes.len() + 1, Vec::new()).is_none());
        File::options().write(true).open(folder.path().join("file")).unwrap().set_len(PIECE as u64).unwrap();
        assert!(file.read_with_checksum(0..PIECE + 1, vec![9; 2 * PIECE]).is_none());
        assert!(file.read_with_checksum(0..PIECE, Vec::new()).is_some());
    }

    #[test]
    fn records_of_any_length_are_scanned() {
        let mut bytes = Vec::new();
        let lengths = [0, 5, WINDOW - 30, 3 * WINDOW, 40, 2 * WINDOW];
        for (opcode, length) in [op::SCHEMA, op::ATTACHMENT, op::MESSAGE].into_iter().cycle().zip(lengths) {
            bytes.push(opcode);
            bytes.extend((length as u64).to_le_bytes());
            bytes.extend(vec![opcode; length]);
        }
        let (_folder, file) = file(&bytes);
        let (mut window, mut position) = (Window::new(&file), 0);
        for length in lengths {
            let record = window.record(position).unwrap();
            assert_eq!((record.length, record.body.len()), (length, length.min(wanted(record.opcode))));
            assert!(record.body.iter().all(|byte| *byte == record.opcode));
            position = record.end();
        }
        assert!(position == bytes.len() && window.record(position).is_none());
    }
}
