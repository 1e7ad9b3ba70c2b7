//! The file in the folder of a run that every process of the run keeps locked for as long as it lives.
//!
//! The system takes such a lock back when a process dies, in whatever way. So a folder that nobody has locked is left over:
//! whoever gets the lock for himself may remove it, and nobody else.

use super::user_folder::OWN_FILE;
use std::fs::{self, File, TryLockError};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::Path;

/// The file.
pub(super) const LOCK: &str = "lock";

fn lock_options() -> fs::OpenOptions {
    let mut options = File::options();
    options.read(true).write(true).mode(OWN_FILE);
    options
}

/// Makes the lock of a folder and locks it for the run; none if a program that cleans up was quicker.
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
    let is_there =
        fs::metadata(folder.join(LOCK)).is_ok_and(|there| there.ino() == lock.metadata().map_or(0, |m| m.ino()));
    Ok(is_there.then_some(lock))
}

/// What may be done with the folder of a run.
#[derive(Debug)]
pub(super) enum Removal {
    /// A process of it lives.
    Alive,
    /// No process of it lives, and nobody but the owner of this lock removes it.
    Dead(File),
    /// It is not there.
    Gone,
}

pub(super) fn lock_for_removal(folder: &Path) -> io::Result<Removal> {
    // Where there is no lock it is made, so that a run that is just being made sees that it was not quick enough.
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
