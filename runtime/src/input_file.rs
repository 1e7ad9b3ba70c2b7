//! Files that are read: regular ones only, and no more of them than was asked for.
//!
//! A pipe that nobody writes to would be waited for, and a device such as `/dev/zero` has no end.

use rustix::fs::OFlags;
use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

/// The most bytes of a text that is read whole: a pipeline file, a summary, a description of a map or of a bag. Real
/// ones have some thousands.
pub const LONGEST_TEXT: u64 = 16 << 20;

/// Opens a file for reading.
///
/// # Errors
/// It cannot be opened, or is a device, a pipe or a socket. A folder is opened, and fails when it is read.
pub fn open(path: &Path) -> io::Result<File> {
    // A pipe is not waited for, and a file is never waited for.
    let file = File::options().read(true).custom_flags(OFlags::NONBLOCK.bits().cast_signed()).open(path)?;
    let kind = file.metadata()?.file_type();
    match kind.is_file() || kind.is_dir() {
        true => Ok(file),
        false => Err(io::Error::new(ErrorKind::InvalidInput, "it is no regular file; copy what it gives to one")),
    }
}

/// Reads a whole file of at most `most` bytes.
///
/// # Errors
/// As [`open`]; or it is longer.
pub fn read(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.take(most.saturating_add(1)).read_to_end(&mut bytes)?;
    match bytes.len() as u64 > most {
        true => Err(io::Error::new(
            ErrorKind::FileTooLarge,
            format!("it is longer than {most} bytes, the most that is read"),
        )),
        false => Ok(bytes),
    }
}

/// Reads a whole text of at most `most` bytes, seldom others than [`LONGEST_TEXT`]: UTF-8, or UTF-16 with a byte order mark, as some editors write
/// it.
///
/// # Errors
/// As [`read`]; or it is not such text.
pub fn read_text(path: &Path, most: u64) -> io::Result<String> {
    let bytes = read(path, most)?;
    let wrong = |text: String| io::Error::new(ErrorKind::InvalidData, text);
    let utf_16 = match bytes.as_slice() {
        [0xff, 0xfe, text @ ..] => Some(of_utf_16(text, u16::from_le_bytes)),
        [0xfe, 0xff, text @ ..] => Some(of_utf_16(text, u16::from_be_bytes)),
        _ => None,
    };
    match utf_16 {
        Some(text) => text.ok_or_else(|| wrong("it begins like UTF-16 text, and is none; save it as UTF-8".to_owned())),
        None => String::from_utf8(bytes)
            .map_err(|error| wrong(format!("byte {} is not UTF-8 text", error.utf8_error().valid_up_to()))),
    }
}

/// The text of UTF-16 bytes; `None` if they are none.
fn of_utf_16(bytes: &[u8], unit: impl Fn([u8; 2]) -> u16) -> Option<String> {
    let (pairs, rest) = bytes.as_chunks();
    let units: Vec<u16> = pairs.iter().map(|pair| unit(*pair)).collect();
    String::from_utf16(&units).ok().filter(|_| rest.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::fs::{CWD, FileType, Mode, mknodat};

    #[test]
    fn pipes_devices_and_what_is_too_long_are_errors_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        mknodat(CWD, &pipe, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0).unwrap();
        for path in [&pipe, Path::new("/dev/zero")] {
            assert!(read(path, 10).unwrap_err().to_string().contains("no regular file"));
        }
        assert!(read(folder.path(), 10).is_err());
        let file = folder.path().join("file");
        std::fs::write(&file, b"0123456789\xff").unwrap();
        assert_eq!(read(&file, 11).unwrap().len(), 11);
        assert!(read(&file, 10).unwrap_err().to_string().contains("longer than 10 bytes"));
        assert!(read_text(&file, LONGEST_TEXT).unwrap_err().to_string().contains("byte 10 is not UTF-8"));
    }

    #[test]
    fn utf_16_with_a_byte_order_mark_is_text() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        let read = |bytes: &[u8]| {
            std::fs::write(&file, bytes).unwrap();
            read_text(&file, LONGEST_TEXT).map_err(|error| error.to_string())
        };
        let bytes = |to_bytes: fn(u16) -> [u8; 2]| -> Vec<u8> {
            "\u{feff}Gr\u{f6}\u{df}e \u{1f5fa}".encode_utf16().flat_map(to_bytes).collect()
        };
        for bytes in [bytes(u16::to_le_bytes), bytes(u16::to_be_bytes)] {
            assert_eq!(read(&bytes).unwrap(), "Gr\u{f6}\u{df}e \u{1f5fa}");
            assert!(read(&bytes[..bytes.len() - 1]).unwrap_err().contains("save it as UTF-8"));
            assert!(read(&bytes[..bytes.len() - 2]).unwrap_err().contains("save it as UTF-8"));
        }
    }
}
