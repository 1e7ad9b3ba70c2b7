//! What this process removes if it has to end at once, without the drop of its values.
//!
//! Who makes a file or a folder that only its drop removes registers how to remove it.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

type Remove = Box<dyn Fn() + Send>;

/// What is registered, by number, and the next number.
struct Registered {
    next: u64,
    removals: BTreeMap<u64, Remove>,
}

static REGISTERED: Mutex<Registered> = Mutex::new(Registered { next: 0, removals: BTreeMap::new() });

/// The registration of something that is removed if this process ends at once. On drop it is no longer.
#[derive(Debug)]
pub struct RegisteredRemoval(u64);

/// Registers how something is removed. `remove` must register nothing itself.
#[must_use]
pub fn register(remove: impl Fn() + Send + 'static) -> RegisteredRemoval {
    let mut registered = REGISTERED.lock().unwrap_or_else(PoisonError::into_inner);
    let number = registered.next;
    registered.next += 1;
    registered.removals.insert(number, Box::new(remove));
    RegisteredRemoval(number)
}

impl Drop for RegisteredRemoval {
    fn drop(&mut self) {
        REGISTERED.lock().unwrap_or_else(PoisonError::into_inner).removals.remove(&self.0);
    }
}

/// Removes all that is registered, and ends this process. Other threads that register something wait until then.
pub fn end_process(status: i32) -> ! {
    let registered = REGISTERED.lock().unwrap_or_else(PoisonError::into_inner);
    registered.removals.values().for_each(|remove| remove());
    // The lock is held until the end.
    std::process::exit(status)
}
