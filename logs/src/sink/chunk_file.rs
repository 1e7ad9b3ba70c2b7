//! The output file of a log, in which the beginning of each chunk is written last: until then, readers do not see the
//! chunk.

use std::fs::File;
use std::io::{self, ErrorKind, Seek, SeekFrom, Write};
use std::os::unix::fs::FileExt;

/// Pieces of at least this size are not copied together with their neighbours.
const LARGE: usize = 64 << 10;

/// A file that is written in order. Data written since the last flush cannot be read before the next: its first bytes
/// are zero in the file, or absent.
///
/// The first bytes after a flush, up to the first large piece, can be rewritten by seeking.
pub(super) struct ChunkFile {
    file: File,
    /// The file position of the first bytes.
    start: u64,
    /// The first bytes since the last flush.
    first: Vec<u8>,
    /// The write position in these; `None` at the end of the file.
    place: Option<usize>,
    /// The number of bytes after the first that are in the file.
    behind: u64,
    /// The bytes after that, not yet in the file.
    last: Vec<u8>,
    /// Whether a write has failed. Nothing is written after that.
    has_failed: bool,
}

impl ChunkFile {
    /// Wraps an empty file.
    pub(super) fn new(file: File) -> Self {
        Self { file, start: 0, first: Vec::new(), place: None, behind: 0, last: Vec::new(), has_failed: false }
    }

    /// The length of the file after the next flush.
    fn end(&self) -> u64 {
        self.start + (self.first.len() + self.last.len()) as u64 + self.behind
    }

    /// Writes all but the first bytes.
    fn put_behind(&mut self, bytes: &[u8]) -> io::Result<()> {
        let place = self.start + self.first.len() as u64 + self.behind;
        self.file.write_all_at(bytes, place)?;
        self.behind += bytes.len() as u64;
        Ok(())
    }

    fn append(&mut self, bytes: &[u8]) -> io::Result<()> {
        if bytes.len() >= LARGE {
            let last = std::mem::take(&mut self.last);
            self.put_behind(&last)?;
            return self.put_behind(bytes);
        }
        match self.behind {
            0 => self.first.extend_from_slice(bytes),
            _ => self.last.extend_from_slice(bytes),
        }
        Ok(())
    }

    fn put_all(&mut self) -> io::Result<()> {
        let last = std::mem::take(&mut self.last);
        self.put_behind(&last)?;
        self.file.write_all_at(&self.first, self.start)?;
        self.start = self.end();
        self.first.clear();
        (self.place, self.behind) = (None, 0);
        Ok(())
    }

    /// Writes, unless an earlier write has failed.
    fn try_to(&mut self, write: impl FnOnce(&mut Self) -> io::Result<()>) -> io::Result<()> {
        if self.has_failed {
            return Err(io::Error::other("an earlier write failed"));
        }
        let written = write(self);
        self.has_failed = written.is_err();
        written
    }
}

impl Write for ChunkFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let Some(place) = self.place else {
            self.try_to(|file| file.append(bytes))?;
            return Ok(bytes.len());
        };
        let over = &mut self.first[place..];
        let count = bytes.len().min(over.len());
        over[..count].copy_from_slice(&bytes[..count]);
        self.place = Some(place + count);
        match count {
            0 if !bytes.is_empty() => Err(no_such_place()),
            _ => Ok(count),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.try_to(Self::put_all)
    }
}

impl Seek for ChunkFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match to {
            SeekFrom::Start(place) if place == self.end() => self.place = None,
            SeekFrom::Start(place) => {
                let in_first = place.checked_sub(self.start).filter(|place| *place <= self.first.len() as u64);
                self.place = Some(in_first.ok_or_else(no_such_place)? as usize);
            }
            SeekFrom::End(0) => self.place = None,
            SeekFrom::Current(0) => {}
            SeekFrom::End(_) | SeekFrom::Current(_) => return Err(no_such_place()),
        }
        Ok(self.place.map_or(self.end(), |place| self.start + place as u64))
    }
}

fn no_such_place() -> io::Error {
    io::Error::new(ErrorKind::InvalidInput, "only the first bytes since the last flush can be rewritten")
}

impl Drop for ChunkFile {
    fn drop(&mut self) {
        // Errors are lost here; code that needs them flushes first.
        let _ = self.flush();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn the_first_bytes_can_be_rewritten_and_are_written_last() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let mut file = ChunkFile::new(File::create_new(&path).unwrap());
        let large = vec![7; LARGE];
        file.write_all(b"head").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"");
        file.flush().unwrap();
        for round in 0..3 {
            let start = file.stream_position().unwrap();
            file.write_all(b"0000").unwrap();
            for _ in 0..round {
                file.write_all(&large).unwrap();
                file.write_all(b"small").unwrap();
            }
            let end = file.stream_position().unwrap();
            assert_eq!(end, start + 4 + round * (LARGE as u64 + 5));
            let before = fs::read(&path).unwrap();
            assert!(before[start as usize..].iter().take(4).all(|byte| *byte == 0), "only once it is flushed");
            assert_eq!(file.seek(SeekFrom::Start(start + 1)).unwrap(), start + 1);
            file.write_all(b"123").unwrap();
            assert_eq!(file.stream_position().unwrap(), start + 4);
            assert!(file.write_all(b"4").is_err(), "that would be after the first bytes");
            for place in [SeekFrom::Start(start.wrapping_sub(1)), SeekFrom::Start(end + 1), SeekFrom::End(-1)] {
                assert!(file.seek(place).is_err());
            }
            assert_eq!(file.seek(SeekFrom::End(0)).unwrap(), end);
            file.write_all(b"end").unwrap();
            file.flush().unwrap();
            let behind = [&large[..], b"small"].concat().repeat(round as usize);
            let expected = [b"0123", &behind[..], b"end"].concat();
            assert!(fs::read(&path).unwrap()[start as usize..] == expected, "{round}");
        }
    }

    #[test]
    fn unflushed_data_is_written_on_drop() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        ChunkFile::new(File::create_new(&path).unwrap()).write_all(b"all").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"all");
    }

    #[test]
    fn nothing_is_written_after_a_failed_write() {
        for bytes in [&b"lost"[..], &[7; LARGE]] {
            let mut file = ChunkFile::new(File::options().write(true).open("/dev/full").unwrap());
            let written = file.write_all(bytes).and_then(|()| file.flush());
            assert_eq!(written.unwrap_err().kind(), ErrorKind::StorageFull);
            assert!(file.write_all(b"more").unwrap_err().to_string().contains("an earlier write failed"));
            assert!(file.flush().unwrap_err().to_string().contains("an earlier write failed"));
        }
    }
}
