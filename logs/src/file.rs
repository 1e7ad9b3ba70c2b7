//! Output files that are replaced only when their new content is completely written.
//!
//! A file NAME is written as `NAME.part`, which its writer keeps locked. The operating system releases the lock when
//! the writer dies. So a locked part belongs to a running writer, and no other program touches it; an unlocked part was
//! left by a killed writer.

mod left;
mod same_file;

use left::warn_of_removal;
pub use left::{leave, place, remove_left};
pub(crate) use left::{replace_or_leave, unlock_left};
pub(crate) use same_file::folder_of;
pub use same_file::{is_same_file, is_same_name, resolve};

use crate::os_error;
use gridweave_runtime::left_behind::{self, RegisteredRemoval};
use rustix::fs::{Access, OFlags, access};
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

/// The error when a file cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// A running program is writing it.
    #[error("{} is being written by {writer}; wait for it to end, or choose another file", path.display())]
    InUse {
        /// The file.
        path: PathBuf,
        /// The process, if known.
        writer: String,
    },
    /// It is a device, a pipe or a socket.
    #[error("{} is not a regular file and is not replaced; choose another file", path.display())]
    NotRegular {
        /// The path.
        path: PathBuf,
    },
    /// The file system fails.
    #[error("cannot write {}: {}", path.display(), os_error::of_writing(error))]
    Io {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        error: io::Error,
    },
}

/// Checks that a file can be written at `path`. Changes nothing, except that the part of a killed writer is removed,
/// with a warning.
///
/// # Errors
/// It cannot be written.
pub fn check_writable(path: &Path) -> Result<(), WriteError> {
    if let Some(mut left) = OutputFile::of_killed(path)? {
        warn_of_removal(&left.file, &left.part);
        left.keep(false);
    }
    let folder = resolve(path).and_then(|place| Ok(access(folder_of(&place), Access::WRITE_OK | Access::EXEC_OK)?));
    folder.map_err(|error| WriteError::Io { path: path.to_owned(), error })
}

/// Writes files that belong together. All parts are written before the first file is replaced, in the given order, so
/// that a full disk leaves the earlier files.
///
/// # Errors
/// A file cannot be written or renamed.
pub fn replace(files: &[(&Path, &[u8])]) -> Result<(), WriteError> {
    replace_or_leave(files, false)
}

/// An output file that is written as a part. While this exists, no other program writes the file.
///
/// On drop the part is deleted, unless it was renamed or is to be kept.
#[derive(Debug)]
pub struct OutputFile {
    /// The path as given by the user.
    path: PathBuf,
    /// The canonical path.
    place: PathBuf,
    part: PathBuf,
    file: File,
    /// Whether the part is kept on drop.
    is_kept: bool,
    /// The removal of a part that this process has made, should it end at once.
    _registration: Option<RegisteredRemoval>,
}

impl OutputFile {
    /// Creates the part. One left by a killed writer is removed.
    ///
    /// # Errors
    /// It cannot be written, or another program writes it.
    pub fn create(path: &Path) -> Result<Self, WriteError> {
        let of_path = |error| WriteError::Io { path: path.to_owned(), error };
        let (place, part) = places(path)?;
        loop {
            // The part is created instead of truncated: programs that read the old one can still read it.
            let (file, is_made) = match options().create_new(true).open(&part) {
                Err(error) if error.kind() == ErrorKind::AlreadyExists => match options().open(&part) {
                    Err(error) if error.kind() == ErrorKind::NotFound => continue,
                    file => (file.map_err(of_path)?, false),
                },
                file => (file.map_err(of_path)?, true),
            };
            lock(&file, path, &part, is_made)?;
            match is_at(&file, &part) {
                // Another writer has renamed or removed it before it was locked here.
                false => {}
                true if is_made => {
                    let _registration = removal_of(&file, &part);
                    return Ok(Self { path: path.to_owned(), place, part, file, is_kept: false, _registration });
                }
                true => {
                    warn_of_removal(&file, &part);
                    fs::remove_file(&part).map_err(of_path)?;
                }
            }
        }
    }

    /// Opens the part that a killed writer has left for `path`; `None` if there is none. It is kept.
    pub(crate) fn of_killed(path: &Path) -> Result<Option<Self>, WriteError> {
        let (place, part) = places(path)?;
        let file = match options().open(&part) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            file => file.map_err(|error| WriteError::Io { path: path.to_owned(), error })?,
        };
        lock(&file, path, &part, false)?;
        let path = path.to_owned();
        Ok(is_at(&file, &part).then_some(Self { path, place, part, file, is_kept: true, _registration: None }))
    }

    /// The open part.
    pub fn file(&self) -> &File {
        &self.file
    }

    /// The path of the part.
    pub fn part(&self) -> &Path {
        &self.part
    }

    /// Sets the open part, after it was rewritten as another file.
    pub(crate) fn set_file(&mut self, file: File) {
        self.file = file;
    }

    /// Sets whether the part is kept on drop if it was not renamed.
    pub(crate) fn keep(&mut self, is_kept: bool) {
        self.is_kept = is_kept;
    }

    /// Renames the part to the file, replacing an existing file. Returns the file, still locked.
    ///
    /// # Errors
    /// Another program has removed or replaced the part, or it cannot be renamed.
    pub fn put_in_place(mut self) -> Result<File, WriteError> {
        let put = || {
            if !is_at(&self.file, &self.part) {
                let text = format!(
                    "another program has removed or replaced {} meanwhile, and what was written to it; run it again",
                    self.part.display()
                );
                return Err(io::Error::other(text));
            }
            if self.place.exists() {
                // After a power failure one of the two files exists.
                self.file.sync_data()?;
            }
            fs::rename(&self.part, &self.place)?;
            self.file.try_clone()
        };
        let file = put().map_err(|error| self.error(error))?;
        self.is_kept = true;
        Ok(file)
    }

    /// Renames the part to the file if there is no such file, and keeps the part otherwise. Returns its path.
    ///
    /// # Errors
    /// It cannot be renamed.
    pub fn put_in_free_place(mut self) -> Result<PathBuf, WriteError> {
        self.is_kept = true;
        if fs::symlink_metadata(&self.place).is_ok() {
            return Ok(self.part.clone());
        }
        let path = self.path.clone();
        self.put_in_place().map(|_| path)
    }

    pub(crate) fn error(&self, error: io::Error) -> WriteError {
        WriteError::Io { path: self.path.clone(), error }
    }
}

impl Drop for OutputFile {
    fn drop(&mut self) {
        if !self.is_kept {
            let _ = fs::remove_file(&self.part);
        }
    }
}

/// Registers that a part is removed, unless it has another place or is another file by then.
fn removal_of(file: &File, part: &Path) -> Option<RegisteredRemoval> {
    let (made, part) = (file.metadata().ok()?, part.to_owned());
    let made = (made.dev(), made.ino());
    Some(left_behind::register(move || {
        if fs::symlink_metadata(&part).is_ok_and(|now| (now.dev(), now.ino()) == made) {
            let _ = fs::remove_file(&part);
        }
    }))
}

/// Links are not followed, and pipes do not block.
fn options() -> OpenOptions {
    let mut options = File::options();
    options.read(true).write(true).custom_flags((OFlags::NOFOLLOW | OFlags::NONBLOCK).bits().cast_signed());
    options
}

/// The canonical path of a file, and the path of its part.
fn places(path: &Path) -> Result<(PathBuf, PathBuf), WriteError> {
    let of_path = |error| WriteError::Io { path: path.to_owned(), error };
    // Standard output that is a pipe leads to no name.
    if fs::metadata(path).is_ok_and(|metadata| !metadata.is_file() && !metadata.is_dir()) {
        return Err(WriteError::NotRegular { path: path.to_owned() });
    }
    let place = resolve(path).map_err(of_path)?;
    match fs::symlink_metadata(&place) {
        Ok(metadata) if metadata.is_dir() => return Err(of_path(ErrorKind::IsADirectory.into())),
        Ok(metadata) if !metadata.is_file() => return Err(WriteError::NotRegular { path: path.to_owned() }),
        // A read-only file must not be replaced either, nor one that a running program has locked: the part of another
        // output.
        Ok(_) => {
            let file = options().open(&place).map_err(of_path)?;
            if matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock))
                // A log that was left by a killed writer is rewritten while this program has it locked itself.
                && process_with_lock(&file).is_some_and(|process| process != std::process::id())
            {
                return Err(WriteError::InUse { path: path.to_owned(), writer: writer_of(&file) });
            }
        }
        Err(error) if error.kind() != ErrorKind::NotFound => return Err(of_path(error)),
        Err(_) => {}
    }
    let part = part_of(&place);
    Ok((place, part))
}

/// The file as which `path` is written until it is whole: `NAME.part`.
pub fn part_of(path: &Path) -> PathBuf {
    let mut part = path.as_os_str().to_owned();
    part.push(".part");
    part.into()
}

/// Locks a part.
fn lock(file: &File, path: &Path, part: &Path, is_made: bool) -> Result<(), WriteError> {
    let path = path.to_owned();
    match file.metadata() {
        Ok(metadata) if metadata.is_file() => {}
        Ok(_) => return Err(WriteError::NotRegular { path: part.to_owned() }),
        Err(error) => return Err(WriteError::Io { path, error }),
    }
    match file.try_lock() {
        Ok(()) => Ok(()),
        Err(TryLockError::WouldBlock) => Err(WriteError::InUse { path, writer: writer_of(file) }),
        // If the file system has no locks, an existing part counts as locked.
        Err(TryLockError::Error(_)) if is_made => Ok(()),
        Err(TryLockError::Error(_)) => {
            let writer = format!("another program, unless {} was left by one that was killed", part.display());
            Err(WriteError::InUse { path, writer })
        }
    }
}

/// Whether `file` is at `path`.
fn is_at(file: &File, path: &Path) -> bool {
    let (Ok(file), Ok(path)) = (file.metadata(), fs::symlink_metadata(path)) else { return false };
    (file.dev(), file.ino()) == (path.dev(), path.ino())
}

/// The name of the process that holds the lock of a file.
fn writer_of(file: &File) -> String {
    process_with_lock(file).map_or_else(|| "another program".to_owned(), |process| format!("process {process}"))
}

/// The process that holds the lock of a file, from the system's list: `1: FLOCK ADVISORY WRITE 4711 08:01:1234 0 EOF`.
fn process_with_lock(file: &File) -> Option<u32> {
    let inode = file.metadata().ok()?.ino();
    let locks = fs::read_to_string("/proc/locks").ok()?;
    let of_file = |line: &&str| {
        let place = line.split_whitespace().nth(5);
        line.contains(" FLOCK ") && place.and_then(|place| place.rsplit(':').next()) == Some(&inode.to_string())
    };
    let process = locks.lines().find(of_file)?.split_whitespace().nth(4)?;
    process.parse::<u32>().ok().filter(|process| *process > 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::fs::{CWD, FileType, Mode, mknodat};
    use std::io::Write;
    use std::os::unix::fs::symlink;

    #[test]
    fn if_one_file_cannot_be_written_the_earlier_files_stay() {
        let folder = tempfile::tempdir().unwrap();
        let (kept, missing) = (folder.path().join("a"), folder.path().join("none/b"));
        fs::write(&kept, "before").unwrap();
        let error = replace(&[(&kept, b"after"), (&missing, b"x")]).unwrap_err();
        assert!(error.to_string().contains("none/b"), "{error}");
        assert_eq!(fs::read_to_string(&kept).unwrap(), "before");
        replace(&[(&kept, b"after")]).unwrap();
        assert_eq!(fs::read_to_string(&kept).unwrap(), "after");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_file_has_one_writer_at_a_time_through_any_path() {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("sub")).unwrap();
        let (path, link) = (folder.path().join("a"), folder.path().join("link"));
        fs::write(&path, "before").unwrap();
        symlink(&path, &link).unwrap();
        let output = OutputFile::create(&path).unwrap();
        (&output.file).write_all(b"after").unwrap();
        for name in [&path, &link, &folder.path().join("sub/../a")] {
            let error = replace(&[(name, b"other")]).unwrap_err().to_string();
            assert!(error.contains(&format!("is being written by process {}", std::process::id())), "{error}");
            assert!(matches!(OutputFile::of_killed(name), Err(WriteError::InUse { .. })));
        }
        output.put_in_place().unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "after");
        replace(&[(&link, b"through the link")]).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read_to_string(&path).unwrap(), "through the link");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3);
    }

    #[test]
    fn a_file_that_has_replaced_the_part_is_not_taken_for_it() {
        let folder = tempfile::tempdir().unwrap();
        let (path, part) = (folder.path().join("a"), folder.path().join("a.part"));
        let output = OutputFile::create(&path).unwrap();
        fs::remove_file(&part).unwrap();
        fs::write(&part, "other").unwrap();
        let error = output.put_in_place().unwrap_err().to_string();
        assert!(error.contains("removed or replaced"), "{error}");
        assert!(!path.exists());
    }

    #[test]
    fn the_part_of_a_killed_writer_is_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let mut killed = OutputFile::create(&path).unwrap();
        killed.keep(true);
        drop(killed);
        assert!(OutputFile::of_killed(&path).unwrap().is_some());
        replace(&[(&path, b"whole")]).unwrap();
        assert!(OutputFile::of_killed(&path).unwrap().is_none());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_pipe_that_is_open_under_another_name_is_no_regular_file_and_a_name_without_room_for_a_part_is_too_long() {
        let (_reader, writer) = std::io::pipe().unwrap();
        let open = PathBuf::from(format!("/proc/self/fd/{}", std::os::fd::AsRawFd::as_raw_fd(&writer)));
        let error = check_writable(&open).unwrap_err();
        assert!(matches!(error, WriteError::NotRegular { .. }), "{error}");
        let folder = tempfile::tempdir().unwrap();
        check_writable(&folder.path().join("a".repeat(250))).unwrap();
        let error = check_writable(&folder.path().join("a".repeat(251))).unwrap_err().to_string();
        assert!(error.contains("at most 250 bytes"), "{error}");
    }

    #[test]
    fn devices_pipes_and_dangling_links_are_errors_and_stay() {
        let folder = tempfile::tempdir().unwrap();
        let (pipe, link, part) = (folder.path().join("pipe"), folder.path().join("link"), folder.path().join("a.part"));
        for pipe in [&pipe, &part] {
            mknodat(CWD, pipe, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0).unwrap();
        }
        symlink(folder.path().join("nowhere/x"), &link).unwrap();
        for path in [Path::new("/dev/full"), &pipe, &folder.path().join("a")] {
            let error = replace(&[(path, b"x")]).unwrap_err();
            assert!(matches!(error, WriteError::NotRegular { .. }), "{error}");
        }
        assert!(matches!(replace(&[(&link, b"x")]), Err(WriteError::Io { .. })));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3);
    }
}
