//! The part of the protocol that hangs on the order of memory accesses: how one sleeps and others wake it, and how a reader
//! tells a sender how much room it has. It is written over [`Word`], so that the tests can run it on a model of memory in
//! which every order happens that the language allows.

use std::sync::atomic::Ordering::{self, Acquire, Relaxed, Release, SeqCst};
use std::time::Duration;

/// A word of memory that several processes see.
pub(crate) trait Word {
    /// As of [`AtomicU64`](std::sync::atomic::AtomicU64).
    fn load(&self, ordering: Ordering) -> u64;
    /// As of [`AtomicU64`](std::sync::atomic::AtomicU64).
    fn store(&self, value: u64, ordering: Ordering);
    /// As of [`AtomicU64`](std::sync::atomic::AtomicU64).
    fn fetch_or(&self, bits: u64, ordering: Ordering) -> u64;
    /// As of [`AtomicU64`](std::sync::atomic::AtomicU64).
    fn compare_exchange(&self, current: u64, new: u64, success: Ordering, failure: Ordering) -> Result<u64, u64>;
    /// As [`fence`](std::sync::atomic::fence).
    fn fence(ordering: Ordering);
    /// Sleeps until it is woken, but not longer than this, and not at all if the word has another value. May return early.
    fn sleep(&self, value: u64, longest: Duration);
    /// Wakes all who sleep on the word.
    fn wake_all(&self);
}

/// Somebody sleeps at the bell, or is about to.
const ASLEEP: u64 = 1;
/// What each ring adds, so that who was about to sleep sees that it was rung.
const RUNG: u64 = 2;

/// Sleeps at a bell until it is rung, but not longer than this, and not at all if `is_ready`. May return early.
///
/// What has been changed before a ring either is seen by `is_ready`, or the ring ends the sleep: of the two fences, here and
/// in [`ring`], one comes first.
pub(crate) fn sleep<W: Word, E>(
    bell: &W,
    longest: Duration,
    is_ready: impl FnOnce() -> Result<bool, E>,
) -> Result<(), E> {
    let seen = bell.fetch_or(ASLEEP, Relaxed) | ASLEEP;
    W::fence(SeqCst);
    if !is_ready()? {
        bell.sleep(seen, longest);
    }
    Ok(())
}

/// Wakes all who sleep at one of the bells. Costs a fence and a look at each bell where nobody sleeps.
pub(crate) fn ring<'a, W: Word + 'a>(bells: impl Iterator<Item = &'a W>) {
    W::fence(SeqCst);
    for bell in bells {
        let mut word = bell.load(Relaxed);
        while word & ASLEEP != 0 {
            match bell.compare_exchange(word, (word & !ASLEEP).wrapping_add(RUNG), Relaxed, Relaxed) {
                Ok(_) => {
                    bell.wake_all();
                    break;
                }
                Err(changed) => word = changed,
            }
        }
    }
}

/// The limit that a reader gives a sender of which it has heard nothing.
pub(crate) const NOTHING_HEARD: u64 = u64::MAX;

/// How much room a reader gives to one sender: the samples before `limit`.
pub(crate) struct Window<'a, W> {
    /// Whom it is given to, 0 for nobody.
    pub(crate) origin: &'a W,
    /// The number of the first sample for which there is no room.
    pub(crate) limit: &'a W,
}

impl<W: Word> Window<'_, W> {
    /// Gives the window to a sender, or to nobody (0). Only for the reader.
    pub(crate) fn give(&self, origin: u64, limit: u64) {
        // The sender before must not take the limit of this one for its own.
        self.origin.store(0, Relaxed);
        self.limit.store(limit, Release);
        self.origin.store(origin, Release);
    }

    /// Gives its sender another limit. Only for the reader.
    pub(crate) fn set_limit(&self, limit: u64) {
        self.limit.store(limit, Release);
    }

    /// The limit that `origin` has; none while the window is not its own.
    pub(crate) fn limit_of(&self, origin: u64) -> Option<u64> {
        if self.origin.load(Acquire) != origin {
            return None;
        }
        let limit = self.limit.load(Acquire);
        (self.origin.load(Relaxed) == origin).then_some(limit)
    }
}
