//! What a log is written through: the beginning of a chunk gets into the file last, and without it the chunk is none.

use std::fs::File;
use std::io::{self, ErrorKind, Seek, SeekFrom, Write};
use std::os::unix::fs::FileExt;

/// What is at least as large is not copied together with what comes before and behind it.
const LARGE: usize = 64 << 10;

/// A file that is written from its beginning on. What was written since it was flushed last cannot be read in it before it is
/// flushed again: in the place of its first bytes there are zeros, if anything.
///
/// In these first bytes, up to the first large piece, one may go back and write anew.
pub(super) struct ChunkFile {
    file: File,
    /// Where in the file the first bytes belong.
    start: u64,
    /// The first bytes since it was flushed.
    first: Vec<u8>,
    /// Where in these is written next; none if that is behind all that there is.
    place: Option<usize>,
    /// How much of what comes behind the first bytes is in the file.
    behind: u64,
    /// What comes behind that.
    last: Vec<u8>,
    /// Whether the file could not be written. Then nothing more is.
    has_failed: bool,
}

impl ChunkFile {
    /// A file that is empty.
    pub(super) fn new(file: File) -> Self {
        Self { file, start: 0, first: Vec::new(), place: None, behind: 0, last: Vec::new(), has_failed: false }
    }

    /// Where the file ends once it is flushed.
    fn end(&self) -> u64 {
        self.start + (self.first.len() + self.last.len()) as u64 + self.behind
    }

    /// Puts bytes behind all but the first.
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

    /// Writes, unless writing has failed before.
    fn try_to(&mut self, write: impl FnOnce(&mut Self) -> io::Result<()>) -> io::Result<()> {
        if self.has_failed {
            return Err(io::Error::other("what came before could not be written"));
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
    io::Error::new(ErrorKind::InvalidInput, "only the first bytes since the last flush can be written anew")
}

impl Drop for ChunkFile {
    fn drop(&mut self) {
        // Whoever wants to know whether it can be written flushes before.
        let _ = self.flush();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn the_first_bytes_can_be_written_anew_and_come_last() {
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
            assert!(before[start as usize..].iter().take(4).all(|byte| *byte == 0), "not before it is flushed");
            assert_eq!(file.seek(SeekFrom::Start(start + 1)).unwrap(), start + 1);
            file.write_all(b"123").unwrap();
            assert_eq!(file.stream_position().unwrap(), start + 4);
            assert!(file.write_all(b"4").is_err(), "that would be behind the first bytes");
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
    fn what_was_not_flushed_is_when_it_is_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        ChunkFile::new(File::create_new(&path).unwrap()).write_all(b"all").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"all");
    }

    #[test]
    fn nothing_comes_behind_what_could_not_be_written() {
        for bytes in [&b"lost"[..], &[7; LARGE]] {
            let mut file = ChunkFile::new(File::options().write(true).open("/dev/full").unwrap());
            let written = file.write_all(bytes).and_then(|()| file.flush());
            assert_eq!(written.unwrap_err().kind(), ErrorKind::StorageFull);
            assert!(file.write_all(b"more").unwrap_err().to_string().contains("what came before"));
            assert!(file.flush().unwrap_err().to_string().contains("what came before"));
        }
    }
}
