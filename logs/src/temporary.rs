//! Temporary files and folders, in the folder that `TMPDIR` names.

use rustix::fs::{AtFlags, CWD, linkat};
use std::fs::{self, File};
use std::io;
use std::os::fd::AsRawFd;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Opens a temporary file without a name, so that nothing of it is left, however this process ends.
///
/// # Errors
/// It cannot be opened, such as in a folder that does not exist.
pub(crate) fn file() -> io::Result<File> {
    tempfile::tempfile().map_err(|error| in_words(&error))
}

/// Creates a folder that only this user can read, removed on drop.
///
/// # Errors
/// It cannot be created, such as in a folder that does not exist.
pub fn folder() -> io::Result<TempDir> {
    let private = fs::Permissions::from_mode(0o700);
    let made = tempfile::Builder::new().prefix("gridweave-").permissions(private).tempdir();
    made.map_err(|error| in_words(&error))
}

/// A name for a file without one, for libraries that need it. It is removed on drop; programs that have it open can
/// still read it.
pub(crate) struct Name {
    _folder: TempDir,
    path: PathBuf,
}

impl Name {
    /// Gives a name to a temporary file that was opened here. On file systems without names for such files, it is
    /// copied.
    pub(crate) fn of(file: &File) -> io::Result<Self> {
        let folder = folder()?;
        let path = folder.path().join("file");
        let open = format!("/proc/self/fd/{}", file.as_raw_fd());
        if linkat(CWD, &open, CWD, &path, AtFlags::SYMLINK_FOLLOW).is_err() {
            fs::copy(&open, &path)?;
        }
        Ok(Self { _folder: folder, path })
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }
}

/// The error with the folder, if that is the cause.
pub(crate) fn in_words(error: &io::Error) -> io::Error {
    let problem = match error.kind() {
        io::ErrorKind::NotFound => "does not exist",
        io::ErrorKind::PermissionDenied => "is not open to this user",
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => "is full",
        kind => return io::Error::new(kind, error.to_string()),
    };
    let folder = std::env::temp_dir();
    let text = format!("the folder for temporary files, {}, {problem}; TMPDIR names another one", folder.display());
    io::Error::new(error.kind(), text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Read, Write};

    #[test]
    fn a_file_without_a_name_can_be_opened_by_one_that_is_removed() {
        let mut temporary = file().unwrap();
        temporary.write_all(b"contents").unwrap();
        let name = Name::of(&temporary).unwrap();
        let path = name.path().to_owned();
        let mut again = File::open(&path).unwrap();
        drop(name);
        assert!(!path.exists() && !path.parent().unwrap().exists());
        let mut text = String::new();
        again.read_to_string(&mut text).unwrap();
        assert_eq!(text, "contents");
    }

    #[test]
    fn a_folder_is_private() {
        assert_eq!(folder().unwrap().path().metadata().unwrap().permissions().mode() & 0o777, 0o700);
    }

    #[test]
    fn a_missing_folder_is_named() {
        let text = in_words(&io::ErrorKind::NotFound.into()).to_string();
        assert!(text.contains("folder for temporary files") && text.contains("does not exist"), "{text}");
    }
}
