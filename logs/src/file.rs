//! Files that are replaced only once what takes their place is written.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// A file could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {source}", path.display())]
pub struct WriteError {
    /// The file.
    pub path: PathBuf,
    /// Why.
    pub source: io::Error,
}

/// Writes files that belong together. All are written beside before the first is put in its place, in the given order, so
/// that a full disk leaves the files that were there.
///
/// # Errors
/// One of them cannot be written, or put in its place.
pub fn replace(files: &[(&Path, &[u8])]) -> Result<(), WriteError> {
    let parts = files.iter().map(|(path, bytes)| Part::write(path, bytes)).collect::<Result<Vec<_>, _>>()?;
    parts.iter().try_for_each(Part::put_in_place)
}

/// A file that was written under another name, which is gone with this unless it was put in place.
struct Part<'a> {
    path: &'a Path,
    written: PathBuf,
}

impl<'a> Part<'a> {
    fn write(path: &'a Path, bytes: &[u8]) -> Result<Self, WriteError> {
        let mut name = path.as_os_str().to_owned();
        name.push(".part");
        let part = Self { path, written: name.into() };
        fs::write(&part.written, bytes).map_err(|source| part.error(source))?;
        Ok(part)
    }

    fn put_in_place(&self) -> Result<(), WriteError> {
        fs::rename(&self.written, self.path).map_err(|source| self.error(source))
    }

    fn error(&self, source: io::Error) -> WriteError {
        WriteError { path: self.path.to_owned(), source }
    }
}

impl Drop for Part<'_> {
    fn drop(&mut self) {
        // Not there if it was put in place.
        let _ = fs::remove_file(&self.written);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_that_cannot_all_be_written_leave_those_that_were_there() {
        let folder = tempfile::tempdir().unwrap();
        let (kept, missing) = (folder.path().join("a"), folder.path().join("none/b"));
        fs::write(&kept, "before").unwrap();
        let error = replace(&[(&kept, b"after"), (&missing, b"x")]).unwrap_err();
        assert_eq!((error.path, fs::read_to_string(&kept).unwrap().as_str()), (missing, "before"));
        replace(&[(&kept, b"after")]).unwrap();
        assert_eq!(fs::read_to_string(&kept).unwrap(), "after");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
