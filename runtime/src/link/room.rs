//! Room in the shared memory of the machine.
//!
//! Memory is set aside there without being taken, and a write for which there is no room left ends the process by SIGBUS.
//! So it is asked before something is written whether there is enough, with some to spare for what iceoryx2 writes beside it,
//! and the memory of a sample is taken for good before the sample is written: another program may take what was free.

use super::LinkError;
use rustix::fs::statvfs;
use rustix::io::Errno;
use rustix::mm::{Advice, madvise};
use rustix::param::page_size;
use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::ops::Range;

/// Where the files of shared memory lie.
pub(crate) const SHARED_MEMORY: &str = "/dev/shm";
/// What must be free beyond what is asked for, bytes: for what iceoryx2 writes beside it.
const SPARE: u64 = 256 << 10;

/// The room of one sender.
#[derive(Debug, Default)]
pub(crate) struct Room {
    /// Whether the sample before was one whose memory is taken, as all are once each was used.
    is_warm: Cell<bool>,
    taken: RefCell<Taken>,
}

/// The memory of samples that is taken: by where it begins, its end. Samples use it again and again.
#[derive(Debug, Default)]
struct Taken {
    ends: BTreeMap<usize, usize>,
    /// The longest part. iceoryx2 moves all samples elsewhere before one becomes longer.
    longest: usize,
}

impl Room {
    /// Asks for room for so many bytes, unless a sample of that size is likely to be there; `doing` says what for.
    ///
    /// # Errors
    /// There is not enough.
    pub(crate) fn ask(&self, bytes: usize, doing: impl FnOnce() -> String) -> Result<(), LinkError> {
        if self.is_warm.get() && bytes <= self.taken.borrow().longest {
            return Ok(());
        }
        // A limit that is not known is none that could be kept.
        match free() {
            Some(free) if free < bytes as u64 + SPARE => Err(LinkError::Full { doing: doing() }),
            _ => Ok(()),
        }
    }

    /// Takes the memory at these addresses, which is mapped for writing, so that it can be written; `doing` says what for.
    ///
    /// # Errors
    /// There is not enough.
    pub(crate) fn take(&self, memory: Range<usize>, doing: impl FnOnce() -> String) -> Result<(), LinkError> {
        let Taken { ends, longest } = &mut *self.taken.borrow_mut();
        if memory.len() > *longest {
            ends.clear();
            *longest = memory.len();
        }
        self.is_warm.set(ends.get(&memory.start).is_some_and(|end| *end >= memory.end));
        if self.is_warm.get() {
            return Ok(());
        }
        match populate(&memory) {
            // What a write would meet, too: there is no memory that could be given.
            Err(Errno::FAULT | Errno::NOMEM | Errno::NOSPC) => Err(LinkError::Full { doing: doing() }),
            // A system that cannot say so is trusted with what was free.
            Ok(()) | Err(_) => {
                ends.insert(memory.start, memory.end);
                Ok(())
            }
        }
    }
}

/// Makes the system give the memory that is mapped at some addresses, without changing what it holds.
#[allow(unsafe_code)]
fn populate(memory: &Range<usize>) -> Result<(), Errno> {
    let start = memory.start - memory.start % page_size();
    let pages = std::ptr::without_provenance_mut(start);
    loop {
        // SAFETY: the advice changes no contents; of addresses that are not mapped it is an error.
        match unsafe { madvise(pages, memory.end - start, Advice::LinuxPopulateWrite) } {
            Err(Errno::INTR | Errno::AGAIN) => {}
            result => return result,
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
        room.ask(1000, || "send".to_owned()).unwrap();
        if free().is_some() {
            let error = room.ask(usize::MAX / 2, || "send on a.b".to_owned()).unwrap_err();
            assert_eq!(error, LinkError::Full { doing: "send on a.b".to_owned() });
        }
    }

    #[test]
    fn memory_that_is_taken_keeps_what_it_holds_and_memory_that_is_not_there_is_an_error() {
        let room = Room::default();
        let doing = || "send".to_owned();
        let bytes = vec![7u8; 3 * page_size()];
        let start = bytes.as_ptr().addr();
        for end in [start + 1, start + bytes.len(), start + bytes.len()] {
            room.take(start..end, doing).unwrap();
        }
        assert!(bytes.iter().all(|byte| *byte == 7));
        // Beyond the end of a file that is mapped, as where a file system is full.
        let file = tempfile::tempfile().unwrap();
        file.set_len(page_size() as u64).unwrap();
        let map = memmap2::MmapOptions::new().len(page_size()).map_raw(&file).unwrap();
        file.set_len(0).unwrap();
        let start = map.as_ptr().addr();
        assert_eq!(room.take(start..start + 10, doing), Err(LinkError::Full { doing: doing() }));
    }
}
