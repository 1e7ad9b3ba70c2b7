//! Free space in the shared memory of the machine.
//!
//! Shared memory is reserved without being committed, and a write without free space kills the process with SIGBUS.
//! Therefore the free space is checked before every write, with a margin for what iceoryx2 writes itself, and the
//! memory of a sample is committed before the sample is written: another program may use up what was free.

use super::LinkError;
use rustix::fs::statvfs;
use rustix::io::Errno;
use rustix::mm::{Advice, madvise};
use rustix::param::page_size;
use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// The folder of the files of shared memory.
pub(crate) const SHARED_MEMORY_FOLDER: &str = "/dev/shm";
/// The margin that must be free in addition, bytes: for what iceoryx2 writes itself.
const SPARE: u64 = 256 << 10;

/// The shared memory that one sender writes to.
#[derive(Debug, Default)]
pub(crate) struct SharedMemory {
    /// Whether the memory of the last sample was committed already, as it is for all samples once each was used.
    is_warm: Cell<bool>,
    committed: RefCell<Committed>,
}

/// The committed memory of samples, which samples reuse: the end by the start.
#[derive(Debug, Default)]
struct Committed {
    ends: BTreeMap<usize, usize>,
    /// The longest range. iceoryx2 moves all samples to other memory before one becomes longer.
    longest: usize,
}

impl SharedMemory {
    /// Checks that `bytes` bytes are free, unless a sample of that size is probably committed; `doing` describes the
    /// purpose.
    ///
    /// # Errors
    /// There is not enough space.
    pub(crate) fn check_free(&self, bytes: usize, doing: impl FnOnce() -> String) -> Result<(), LinkError> {
        if self.is_warm.get() && bytes <= self.committed.borrow().longest {
            return Ok(());
        }
        // An unknown limit cannot be enforced.
        match free() {
            Some(free) if free < bytes as u64 + SPARE => Err(LinkError::Full { doing: doing() }),
            _ => Ok(()),
        }
    }

    /// Commits the memory at these addresses, which is mapped for writing; `doing` describes the purpose.
    ///
    /// # Errors
    /// There is not enough space.
    pub(crate) fn commit(&self, memory: Range<usize>, doing: impl FnOnce() -> String) -> Result<(), LinkError> {
        let Committed { ends, longest } = &mut *self.committed.borrow_mut();
        if memory.len() > *longest {
            ends.clear();
            *longest = memory.len();
        }
        self.is_warm.set(ends.get(&memory.start).is_some_and(|end| *end >= memory.end));
        if self.is_warm.get() {
            return Ok(());
        }
        match populate(&memory) {
            // A write would fail in the same way: there is no memory to commit.
            Err(Errno::FAULT | Errno::NOMEM | Errno::NOSPC) => Err(LinkError::Full { doing: doing() }),
            // A kernel without this advice: rely on the check of the free space.
            Ok(()) | Err(_) => {
                ends.insert(memory.start, memory.end);
                Ok(())
            }
        }
    }
}

/// One thread of this process at a time creates what iceoryx2 keeps in shared memory, and only where there is space for
/// it: each thread would find the same free space otherwise.
static CREATION: Mutex<()> = Mutex::new(());

/// Waits until nobody else creates anything, and checks that there is space; `doing` describes the purpose. The
/// creation ends with the guard.
///
/// # Errors
/// There is not enough space.
pub(crate) fn begin_creation(doing: impl FnOnce() -> String) -> Result<MutexGuard<'static, ()>, LinkError> {
    // It guards no data that a panic could leave incomplete.
    let guard = CREATION.lock().unwrap_or_else(PoisonError::into_inner);
    SharedMemory::default().check_free(0, doing)?;
    Ok(guard)
}

/// Commits the memory that is mapped at some addresses without changing its contents.
#[allow(unsafe_code)]
fn populate(memory: &Range<usize>) -> Result<(), Errno> {
    let start = memory.start - memory.start % page_size();
    let pages = std::ptr::without_provenance_mut(start);
    loop {
        // SAFETY: the advice changes no contents, and it fails for addresses that are not mapped.
        match unsafe { madvise(pages, memory.end - start, Advice::LinuxPopulateWrite) } {
            Err(Errno::INTR | Errno::AGAIN) => {}
            result => return result,
        }
    }
}

/// The free bytes; none if there is no limit, or if it is unknown.
fn free() -> Option<u64> {
    let memory = statvfs(SHARED_MEMORY_FOLDER).ok().filter(|memory| memory.f_blocks > 0)?;
    Some(memory.f_bavail.saturating_mul(memory.f_frsize))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_write_larger_than_the_free_space_is_an_error() {
        let memory = SharedMemory::default();
        memory.check_free(1000, || "send".to_owned()).unwrap();
        if free().is_some() {
            let error = memory.check_free(usize::MAX / 2, || "send on a.b".to_owned()).unwrap_err();
            assert_eq!(error, LinkError::Full { doing: "send on a.b".to_owned() });
        }
    }

    #[test]
    fn memory_that_is_taken_keeps_what_it_holds_and_memory_that_is_not_there_is_an_error() {
        let memory = SharedMemory::default();
        let doing = || "send".to_owned();
        let bytes = vec![7u8; 3 * page_size()];
        let start = bytes.as_ptr().addr();
        for end in [start + 1, start + bytes.len(), start + bytes.len()] {
            memory.commit(start..end, doing).unwrap();
        }
        assert!(bytes.iter().all(|byte| *byte == 7));
        // An access beyond the end of a mapped file fails like one on a full file system.
        let file = tempfile::tempfile().unwrap();
        file.set_len(page_size() as u64).unwrap();
        let map = memmap2::MmapOptions::new().len(page_size()).map_raw(&file).unwrap();
        file.set_len(0).unwrap();
        let start = map.as_ptr().addr();
        assert_eq!(memory.commit(start..start + 10, doing), Err(LinkError::Full { doing: doing() }));
    }
}
