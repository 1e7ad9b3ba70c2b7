//! The lock file of a run, which every process of the run keeps locked while it lives.
//!
//! The kernel releases the lock when a process dies, whatever the cause. So a folder that nobody has locked is left
//! over from a killed run; only a program that gets its exclusive lock may remove it.

use super::user_folder::OWN_FILE;
use std::fs::{self, File, TryLockError};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::Path;

/// The name of the file.
pub(super) const LOCK: &str = "lock";

fn lock_options() -> fs::OpenOptions {
    let mut options = File::options();
    options.read(true).write(true).mode(OWN_FILE);
    options
}

/// Creates the lock file of a folder and locks it for the run; none if a program that cleans up was faster.
pub(super) fn lock_for_run(folder: &Path) -> io::Result<Option<File>> {
    let lock = match lock_options().create_new(true).open(folder.join(LOCK)) {
        Err(error) if matches!(error.kind(), ErrorKind::AlreadyExists | ErrorKind::NotFound) => return Ok(None),
        lock => lock?,
    };
    match lock.try_lock_shared() {
        Err(TryLockError::WouldBlock) => return Ok(None),
        Err(TryLockError::Error(error)) => return Err(error),
        Ok(()) => {}
    }
    // It may have been removed before it was locked.
    let exists = fs::metadata(folder.join(LOCK)).is_ok_and(|file| file.ino() == lock.metadata().map_or(0, |m| m.ino()));
    Ok(exists.then_some(lock))
}

/// Whether the folder of a run may be removed.
#[derive(Debug)]
pub(super) enum Removal {
    /// No: the run has a living process.
    Alive,
    /// Yes: the run has no living process, and only the owner of this lock may remove the folder.
    Dead(File),
    /// The folder does not exist.
    Gone,
}

pub(super) fn lock_for_removal(folder: &Path) -> io::Result<Removal> {
    // A missing lock file is created, so that a run that is being created notices that it was too slow.
    let lock = match lock_options().create(true).truncate(false).open(folder.join(LOCK)) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Removal::Gone),
        lock => lock?,
    };
    match lock.try_lock() {
        Ok(()) => Ok(Removal::Dead(lock)),
        Err(TryLockError::WouldBlock) => Ok(Removal::Alive),
        Err(TryLockError::Error(error)) => Err(error),
    }
}
