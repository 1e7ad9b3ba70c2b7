//! The protocol on a model of memory (loom) that tries every order of events, and every value that a load may give.

use super::protocol::{NOTHING_HEARD, Window, Word, ring, sleep};
use loom::sync::atomic::{AtomicU64, Ordering, fence};
use loom::sync::{Arc, Condvar, Mutex};
use loom::thread;
use std::convert::Infallible;
use std::time::Duration;

/// A word, and what the system does for those who sleep on it. Nobody wakes by himself here, so that a wake-up that is lost
/// leaves nobody to go on, which loom tells.
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
        // The system reads the latest value, as an operation that changes it does.
        if self.value.fetch_or(0, Ordering::Relaxed) == value {
            drop(self.woken.wait(asleep).unwrap());
        }
    }

    fn wake_all(&self) {
        let _asleep = self.asleep.lock().unwrap();
        self.woken.notify_all();
    }
}

/// Runs a model in every order of events in which the threads take turns so often at most beside those that they must:
/// what goes wrong at all goes wrong in few.
fn model(run: impl Fn() + Sync + Send + 'static) {
    let mut builder = loom::model::Builder::new();
    builder.preemption_bound = Some(2);
    builder.check(run);
}

/// Sleeps at a bell until something is so.
fn wait(bell: &ModelWord, is_ready: impl Fn() -> bool) {
    let mut ready = is_ready();
    while !ready {
        let look = || {
            ready = is_ready();
            Ok::<_, Infallible>(ready)
        };
        sleep(bell, Duration::MAX, look).unwrap();
    }
}

/// A sender and a reader: their bells, what was sent, and the reader's window.
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

/// The sender of these models.
const SENDER: u64 = 7;

/// One that sends `samples`, each when there is room for it.
fn send(link: &Link, samples: u64, depth: u64) {
    for number in 0..samples {
        wait(&link.sender, || match link.window().limit_of(SENDER) {
            Some(NOTHING_HEARD) => number < depth,
            limit => limit.is_some_and(|limit| number < limit),
        });
        // What iceoryx2 delivers is written before and read after, with no order that the protocol may build on.
        link.sent.store(number + 1, Ordering::Relaxed);
        ring([&link.reader].into_iter());
    }
}

#[test]
fn no_wake_up_is_lost_and_no_reader_gets_more_than_it_has_room_for() {
    const SAMPLES: u64 = 2;
    const DEPTH: u64 = 1;
    model(|| {
        let link = Link::new();
        let sender = thread::spawn({
            let link = Arc::clone(&link);
            move || send(&link, SAMPLES, DEPTH)
        });
        link.window().give(SENDER, NOTHING_HEARD);
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
fn all_who_sleep_at_one_bell_are_woken() {
    model(|| {
        let bell = Arc::new((ModelWord::new(), AtomicU64::new(0)));
        let sleepers = [1, 2].map(|last| {
            let bell = Arc::clone(&bell);
            thread::spawn(move || wait(&bell.0, || bell.1.load(Ordering::Relaxed) >= last))
        });
        for value in [1, 2] {
            bell.1.store(value, Ordering::Relaxed);
            ring([&bell.0].into_iter());
        }
        sleepers.into_iter().for_each(|sleeper| sleeper.join().unwrap());
    });
}

#[test]
fn a_sender_never_takes_the_window_of_another_for_its_own() {
    const OTHER: u64 = 8;
    model(|| {
        let link = Link::new();
        link.window().give(OTHER, 100);
        let reader = thread::spawn({
            let link = Arc::clone(&link);
            move || {
                link.window().give(SENDER, 1);
                link.window().give(OTHER, 200);
                link.window().set_limit(300);
            }
        });
        let limit = link.window().limit_of(SENDER);
        assert!([None, Some(1)].contains(&limit), "{limit:?}");
        reader.join().unwrap();
    });
}
