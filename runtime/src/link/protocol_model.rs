//! The protocol on a model of memory (loom) that tries every order of events, and every value that a load may return.

use super::protocol::{NOTHING_RECEIVED, Window, Word, ring, sleep};
use loom::sync::atomic::{AtomicU64, Ordering, fence};
use loom::sync::{Arc, Condvar, Mutex};
use loom::thread;
use std::convert::Infallible;
use std::time::Duration;

/// A word with a model of the kernel's futex. There are no timeouts here, so a lost wake-up is a deadlock, which loom
/// reports.
struct ModelWord {
    value: AtomicU64,
    asleep: Mutex<()>,
    woken: Condvar,
}

impl ModelWord {
    fn new() -> Self {
        Self { value: AtomicU64::new(0), asleep: Mutex::new(()), woken: Condvar::new() }
    }
}

impl Word for ModelWord {
    fn load(&self, ordering: Ordering) -> u64 {
        self.value.load(ordering)
    }

    fn store(&self, value: u64, ordering: Ordering) {
        self.value.store(value, ordering);
    }

    fn fetch_or(&self, bits: u64, ordering: Ordering) -> u64 {
        self.value.fetch_or(bits, ordering)
    }

    fn compare_exchange(&self, current: u64, new: u64, success: Ordering, failure: Ordering) -> Result<u64, u64> {
        self.value.compare_exchange(current, new, success, failure)
    }

    fn fence(ordering: Ordering) {
        fence(ordering);
    }

    fn sleep(&self, value: u64, _: Duration) {
        let asleep = self.asleep.lock().unwrap();
        // The kernel reads the latest value, as a read-modify-write does.
        if self.value.fetch_or(0, Ordering::Relaxed) == value {
            drop(self.woken.wait(asleep).unwrap());
        }
    }

    fn wake_all(&self) {
        let _asleep = self.asleep.lock().unwrap();
        self.woken.notify_all();
    }
}

/// Runs a model in every order of events with at most two preemptions: most concurrency bugs show with few.
fn model(run: impl Fn() + Sync + Send + 'static) {
    let mut builder = loom::model::Builder::new();
    builder.preemption_bound = Some(2);
    builder.check(run);
}

/// Sleeps on a doorbell until `is_ready`.
fn wait(doorbell: &ModelWord, is_ready: impl Fn() -> bool) {
    let mut ready = is_ready();
    while !ready {
        let check = || {
            ready = is_ready();
            Ok::<_, Infallible>(ready)
        };
        sleep(doorbell, Duration::MAX, check).unwrap();
    }
}

/// A sender and a reader: their doorbells, the number of sent samples, and the reader's window.
struct Link {
    sender: ModelWord,
    reader: ModelWord,
    sent: AtomicU64,
    origin: ModelWord,
    limit: ModelWord,
}

impl Link {
    fn new() -> Arc<Self> {
        let word = ModelWord::new;
        Arc::new(Self { sender: word(), reader: word(), sent: AtomicU64::new(0), origin: word(), limit: word() })
    }

    fn window(&self) -> Window<'_, ModelWord> {
        Window { origin: &self.origin, limit: &self.limit }
    }
}

/// The origin of the sender in these models.
const SENDER: u64 = 7;

/// Sends `samples` samples, each once there is credit for it.
fn send(link: &Link, samples: u64, depth: u64) {
    for number in 0..samples {
        wait(&link.sender, || match link.window().limit_of(SENDER) {
            Some(NOTHING_RECEIVED) => number < depth,
            limit => limit.is_some_and(|limit| number < limit),
        });
        // The protocol must not rely on any memory ordering of iceoryx2's delivery.
        link.sent.store(number + 1, Ordering::Relaxed);
        ring([&link.reader].into_iter());
    }
}

#[test]
fn no_wake_up_is_lost_and_no_reader_gets_more_samples_than_its_credit() {
    const SAMPLES: u64 = 2;
    const DEPTH: u64 = 1;
    model(|| {
        let link = Link::new();
        let sender = thread::spawn({
            let link = Arc::clone(&link);
            move || send(&link, SAMPLES, DEPTH)
        });
        link.window().assign(SENDER, NOTHING_RECEIVED);
        ring([&link.sender].into_iter());
        for taken in 0..SAMPLES {
            wait(&link.reader, || link.sent.load(Ordering::Relaxed) > taken);
            assert!(link.sent.load(Ordering::Relaxed) <= taken + DEPTH);
            link.window().set_limit(taken + 1 + DEPTH);
            ring([&link.sender].into_iter());
        }
        sender.join().unwrap();
    });
}

#[test]
fn all_that_sleep_on_one_doorbell_are_woken() {
    model(|| {
        let doorbell = Arc::new((ModelWord::new(), AtomicU64::new(0)));
        let sleepers = [1, 2].map(|last| {
            let doorbell = Arc::clone(&doorbell);
            thread::spawn(move || wait(&doorbell.0, || doorbell.1.load(Ordering::Relaxed) >= last))
        });
        for value in [1, 2] {
            doorbell.1.store(value, Ordering::Relaxed);
            ring([&doorbell.0].into_iter());
        }
        sleepers.into_iter().for_each(|sleeper| sleeper.join().unwrap());
    });
}

#[test]
fn a_sender_never_uses_the_window_of_another() {
    const OTHER: u64 = 8;
    model(|| {
        let link = Link::new();
        link.window().assign(OTHER, 100);
        let reader = thread::spawn({
            let link = Arc::clone(&link);
            move || {
                link.window().assign(SENDER, 1);
                link.window().assign(OTHER, 200);
                link.window().set_limit(300);
            }
        });
        let limit = link.window().limit_of(SENDER);
        assert!([None, Some(1)].contains(&limit), "{limit:?}");
        reader.join().unwrap();
    });
}
