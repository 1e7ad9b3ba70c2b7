//! The part of the protocol that depends on memory ordering: sleeping and waking, and the credit that a reader grants a
//! sender. It is generic over [`Word`], so that the tests can run it on a model of memory that tries every order that
//! the language allows.

use std::sync::atomic::Ordering::{self, Acquire, Relaxed, Release, SeqCst};
use std::time::Duration;

/// A word of memory that several processes share.
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
    /// Sleeps until it is woken, for at most `longest`, and not at all if the word differs from `value`. May return
    /// early.
    fn sleep(&self, value: u64, longest: Duration);
    /// Wakes all that sleep on the word.
    fn wake_all(&self);
}

/// The bit that says that somebody sleeps on the doorbell, or is about to.
const ASLEEP: u64 = 1;
/// The increment of each ring, so that one that is about to sleep notices the ring.
const RUNG: u64 = 2;

/// Sleeps on a doorbell until it is rung, for at most `longest`, and not at all if `is_ready`. May return early.
///
/// A change made before a ring is either seen by `is_ready`, or the ring ends the sleep: one of the two fences, here
/// and in [`ring`], comes first.
pub(crate) fn sleep<W: Word, E>(
    doorbell: &W,
    longest: Duration,
    is_ready: impl FnOnce() -> Result<bool, E>,
) -> Result<(), E> {
    let seen = doorbell.fetch_or(ASLEEP, Relaxed) | ASLEEP;
    W::fence(SeqCst);
    if !is_ready()? {
        doorbell.sleep(seen, longest);
    }
    Ok(())
}

/// Wakes all that sleep on the given doorbells. A doorbell on which nobody sleeps costs one load.
pub(crate) fn ring<'a, W: Word + 'a>(doorbells: impl Iterator<Item = &'a W>) {
    W::fence(SeqCst);
    for doorbell in doorbells {
        let mut word = doorbell.load(Relaxed);
        while word & ASLEEP != 0 {
            match doorbell.compare_exchange(word, (word & !ASLEEP).wrapping_add(RUNG), Relaxed, Relaxed) {
                Ok(_) => {
                    doorbell.wake_all();
                    break;
                }
                Err(changed) => word = changed,
            }
        }
    }
}

/// The limit of a window whose reader has not received any sample of the sender.
pub(crate) const NOTHING_RECEIVED: u64 = u64::MAX;

/// The credit that a reader grants one sender: the samples before `limit`.
pub(crate) struct Window<'a, W> {
    /// The sender that it is assigned to; 0 if none.
    pub(crate) origin: &'a W,
    /// The number of the first sample for which there is no credit.
    pub(crate) limit: &'a W,
}

impl<W: Word> Window<'_, W> {
    /// Assigns the window to a sender, or to none (0). Only for the reader.
    pub(crate) fn assign(&self, origin: u64, limit: u64) {
        // The previous sender must not use the limit of this one.
        self.origin.store(0, Relaxed);
        self.limit.store(limit, Release);
        self.origin.store(origin, Release);
    }

    /// Sets the limit of the sender. Only for the reader.
    pub(crate) fn set_limit(&self, limit: u64) {
        self.limit.store(limit, Release);
    }

    /// The limit for `origin`; none while the window is not assigned to it.
    pub(crate) fn limit_of(&self, origin: u64) -> Option<u64> {
        if self.origin.load(Acquire) != origin {
            return None;
        }
        let limit = self.limit.load(Acquire);
        (self.origin.load(Relaxed) == origin).then_some(limit)
    }
}
