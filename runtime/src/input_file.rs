//! Files that are read: regular ones only, and no more of them than was asked for.
//!
//! A pipe that nobody writes to would be waited for, and a device such as `/dev/zero` has no end.

use rustix::fs::OFlags;
use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

/// The most bytes of a text that is read whole: a pipeline file, a summary, a description of a map or of a bag. Real ones
/// have some thousands.
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

/// Reads a whole text of at most [`LONGEST_TEXT`] bytes.
///
/// # Errors
/// As [`read`]; or it is not UTF-8.
pub fn read_text(path: &Path) -> io::Result<String> {
    let text = String::from_utf8(read(path, LONGEST_TEXT)?);
    text.map_err(|error| {
        let byte = error.utf8_error().valid_up_to();
        io::Error::new(ErrorKind::InvalidData, format!("byte {byte} is not UTF-8 text"))
    })
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
        assert!(read_text(&file).unwrap_err().to_string().contains("byte 10 is not UTF-8"));
    }
}
