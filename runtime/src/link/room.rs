//! Room in the shared memory of the machine.
//!
//! Memory is set aside there without being taken, and a write for which there is no room left ends the process by SIGBUS.
//! So it is asked before something is written whether there is enough. Another program may take it in between, which is why
//! some is kept spare.

use super::LinkError;
use rustix::fs::statvfs;
use std::cell::Cell;

/// Where the files of shared memory lie.
pub(crate) const SHARED_MEMORY: &str = "/dev/shm";
/// What must be free beyond what is asked for, bytes: for what iceoryx2 writes beside it.
const SPARE: u64 = 256 << 10;
/// After it was asked, this share of what was free may be used before it is asked again.
const TRUSTED_SHARE: u64 = 8;

/// How much may be written before it must be asked again.
#[derive(Debug, Default)]
pub(super) struct Room {
    trusted: Cell<u64>,
}

impl Room {
    /// Takes room for so many bytes; `doing` says what for.
    ///
    /// # Errors
    /// There is not enough.
    pub(super) fn take(&self, bytes: usize, doing: impl FnOnce() -> String) -> Result<(), LinkError> {
        let needed = bytes as u64 + SPARE;
        if let Some(left) = self.trusted.get().checked_sub(needed) {
            self.trusted.set(left);
            return Ok(());
        }
        match free() {
            Some(free) if free < needed => Err(LinkError::Full { doing: doing() }),
            // A limit that is not known is none that could be kept.
            free => {
                self.trusted.set(free.unwrap_or_default() / TRUSTED_SHARE);
                Ok(())
            }
        }
    }
}

/// The bytes that are free; none if there is no limit, or if it is not known.
fn free() -> Option<u64> {
    let memory = statvfs(SHARED_MEMORY).ok().filter(|memory| memory.f_blocks > 0)?;
    Some(memory.f_bavail.saturating_mul(memory.f_frsize))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_an_error_and_what_fits_is_not() {
        let room = Room::default();
        room.take(1000, || "send".to_owned()).unwrap();
        if free().is_some() {
            let error = room.take(usize::MAX / 2, || "send on a.b".to_owned()).unwrap_err();
            assert_eq!(error, LinkError::Full { doing: "send on a.b".to_owned() });
        }
    }
}
