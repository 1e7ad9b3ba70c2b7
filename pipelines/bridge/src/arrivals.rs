//! What has arrived at a receiver and was not handled yet.
//!
//! A sender waits for the answer of a batch before it sends the next, so one batch of each session is kept: a later one
//! takes its place, as the sender has given up the earlier one. What is not kept ends without an answer, and an honest
//! sender then sends it again. All batches together are limited in number and size, those of announced sessions apart
//! from others: an honest sender announces its session, and does not compete with invented ones.

use super::difference::MAX_SIZE;
use super::presence::Presence;
use super::wire::session_of;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::io::Read as _;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use zenoh::query::Query;

/// The maximum number of waiting batches of a share. Each may take long to restore, and honest senders wait for those
/// before them.
const MAX_BATCHES: usize = 128;
/// The size of the waiting batches of a share from which on no other is kept, bytes. A batch of any size is kept below
/// it, so that many small ones cannot keep a large one out.
const FULL: usize = 32 << 20;
/// The maximum size of a batch that can be read, bytes: compression adds less than 1/128.
const MAX_BATCH: usize = MAX_SIZE + MAX_SIZE / 128;
/// What is kept of a larger one, bytes: enough to answer why it cannot be read.
const HEAD: usize = 1024;

/// An event at a receiver.
#[derive(Debug, PartialEq)]
pub(super) enum Arrival<Q> {
    /// A sender has come (true) or gone.
    Sender(Presence, bool),
    /// A batch.
    Batch(ArrivedBatch<Q>),
}

/// A batch that waits for its answer.
#[derive(Debug, PartialEq)]
pub(super) struct ArrivedBatch<Q> {
    /// The query to be answered. When it is dropped, it ends without an answer.
    pub(super) query: Q,
    pub(super) bytes: Vec<u8>,
    /// When it came, nanoseconds by the clock of the receiver.
    pub(super) came: i64,
    /// The size of everything that the query keeps in memory besides, bytes.
    pub(super) beside: usize,
}

impl<Q> ArrivedBatch<Q> {
    fn size(&self) -> usize {
        self.bytes.len().saturating_add(self.beside)
    }
}

/// The arrivals in their order, filled by threads of the network and emptied by the stage.
#[derive(Debug)]
pub(super) struct Arrivals<Q> {
    queue: Mutex<Queue<Q>>,
    has_arrived: Condvar,
}

#[derive(Debug)]
struct Queue<Q> {
    places: VecDeque<Place>,
    /// The waiting batches by session; those whose session cannot be read share the place of `None`.
    batches: BTreeMap<Option<u64>, (IsAnnounced, ArrivedBatch<Q>)>,
    /// What the batches of announced sessions take, and those of others.
    announced: Share,
    others: Share,
    /// The sessions of the senders that are there.
    senders: BTreeSet<u64>,
    /// The number of batches that were not kept since this was last asked for.
    left_out: u64,
    is_closed: bool,
}

/// Whether the session of a batch was announced when it came.
type IsAnnounced = bool;

/// The number of waiting batches, and their size in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Share {
    batches: usize,
    size: usize,
}

#[derive(Debug)]
enum Place {
    Sender(Presence, bool),
    Batch(Option<u64>),
}

impl<Q> Default for Arrivals<Q> {
    fn default() -> Self {
        let queue = Queue {
            places: VecDeque::new(),
            batches: BTreeMap::new(),
            announced: Share::default(),
            others: Share::default(),
            senders: BTreeSet::new(),
            left_out: 0,
            is_closed: false,
        };
        Self { queue: Mutex::new(queue), has_arrived: Condvar::new() }
    }
}

impl Arrivals<Query> {
    /// Adds the batch of a query that came at `came`, by the clock of the receiver.
    pub(super) fn add_query(&self, mut query: Query, came: i64) {
        let most = match query.payload().map_or(0, |payload| payload.len()) {
            size if size > MAX_BATCH => HEAD,
            size => size,
        };
        let mut bytes = Vec::new();
        let read = match (query.payload(), bytes.try_reserve_exact(most)) {
            (Some(payload), Ok(())) => payload.reader().take(most as u64).read_to_end(&mut bytes).is_ok(),
            (None, _) => true,
            (Some(_), Err(_)) => false,
        };
        // What is left of the query would keep the buffers of the network, which may be much larger than its content.
        query.payload_mut().map(std::mem::take);
        query.attachment_mut().map(std::mem::take);
        if read {
            let beside = query.parameters().as_str().len() + query.key_expr().as_str().len();
            self.add_batch(ArrivedBatch { query, bytes, came, beside });
        }
    }
}

impl<Q> Arrivals<Q> {
    fn lock(&self) -> MutexGuard<'_, Queue<Q>> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds that a sender has come or gone.
    pub(super) fn add_sender(&self, sender: Presence, is_present: bool) {
        let mut queue = self.lock();
        if !queue.is_closed {
            match is_present {
                true => queue.senders.insert(sender.number),
                false => queue.senders.remove(&sender.number),
            };
            queue.places.push_back(Place::Sender(sender, is_present));
        }
        drop(queue);
        self.has_arrived.notify_all();
    }

    /// Adds a batch, in the place of an earlier one of its session if that still waits; leaves it out if there are too
    /// many.
    pub(super) fn add_batch(&self, batch: ArrivedBatch<Q>) {
        let session = session_of(&batch.bytes);
        let left_out = self.lock().add(session, batch);
        self.has_arrived.notify_all();
        // Not under the lock: dropping a query sends its end.
        drop(left_out);
    }

    /// Waits until something has arrived, for at most `longest`.
    pub(super) fn wait(&self, longest: Duration) {
        let queue = self.lock();
        drop(self.has_arrived.wait_timeout_while(queue, longest, |queue| queue.places.is_empty()));
    }

    /// Takes the next arrival.
    pub(super) fn next(&self) -> Option<Arrival<Q>> {
        let mut queue = self.lock();
        while let Some(place) = queue.places.pop_front() {
            match place {
                Place::Sender(sender, is_present) => return Some(Arrival::Sender(sender, is_present)),
                Place::Batch(session) => {
                    if let Some(batch) = queue.remove(session) {
                        return Some(Arrival::Batch(batch));
                    }
                }
            }
        }
        None
    }

    /// The number of batches that were left out or replaced since the last call.
    pub(super) fn take_left_out(&self) -> u64 {
        std::mem::take(&mut self.lock().left_out)
    }

    /// Leaves out everything from now on, so that senders send it to the next receiver.
    pub(super) fn close(&self) {
        let mut queue = self.lock();
        queue.is_closed = true;
        queue.places.clear();
        let batches = std::mem::take(&mut queue.batches);
        drop(queue);
        drop(batches);
    }
}

impl<Q> Queue<Q> {
    /// Adds a batch; returns the one that is not kept.
    fn add(&mut self, session: Option<u64>, batch: ArrivedBatch<Q>) -> Option<ArrivedBatch<Q>> {
        if self.is_closed {
            return Some(batch);
        }
        let is_announced = session.is_some_and(|session| self.senders.contains(&session));
        let before = self.batches.get(&session).filter(|(was_announced, _)| *was_announced == is_announced);
        let before = before.map_or(Share::default(), |(_, batch)| Share { batches: 1, size: batch.size() });
        let share = self.share(is_announced);
        if share.size - before.size >= FULL || share.batches - before.batches >= MAX_BATCHES {
            self.left_out += 1;
            return Some(batch);
        }
        let replaced = self.remove(session);
        let share = self.share(is_announced);
        share.batches += 1;
        share.size += batch.size();
        self.batches.insert(session, (is_announced, batch));
        match replaced {
            Some(_) => self.left_out += 1,
            None => self.places.push_back(Place::Batch(session)),
        }
        replaced
    }

    fn remove(&mut self, session: Option<u64>) -> Option<ArrivedBatch<Q>> {
        let (is_announced, batch) = self.batches.remove(&session)?;
        let share = self.share(is_announced);
        share.batches -= 1;
        share.size -= batch.size();
        Some(batch)
    }

    fn share(&mut self, is_announced: IsAnnounced) -> &mut Share {
        if is_announced { &mut self.announced } else { &mut self.others }
    }
}

#[cfg(test)]
mod tests {
    use super::super::wire::{Batch, to_bytes};
    use super::*;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// A query that counts the queries that have ended.
    #[derive(Debug)]
    struct Asked(Arc<AtomicUsize>);

    impl Drop for Asked {
        fn drop(&mut self) {
            self.0.fetch_add(1, Ordering::Relaxed);
        }
    }

    #[derive(Default)]
    struct World {
        arrivals: Arrivals<Asked>,
        ended: Arc<AtomicUsize>,
    }

    impl World {
        /// A batch of a session, of the given size besides its few bytes.
        fn add(&self, session: u64, came: i64, beside: usize) {
            let batch = Batch { sender: "robot1".into(), session, ..Batch::default() };
            self.add_bytes(to_bytes(&batch).unwrap(), came, beside);
        }

        fn add_bytes(&self, bytes: Vec<u8>, came: i64, beside: usize) {
            self.arrivals.add_batch(ArrivedBatch { query: Asked(Arc::clone(&self.ended)), bytes, came, beside });
        }

        fn ended(&self) -> usize {
            self.ended.load(Ordering::Relaxed)
        }

        /// The times of the waiting batches.
        fn times(&self) -> Vec<i64> {
            let time = |arrival| match arrival {
                Arrival::Batch(batch) => batch.came,
                Arrival::Sender(..) => -1,
            };
            std::iter::from_fn(|| self.arrivals.next()).map(time).collect()
        }
    }

    #[test]
    fn a_later_batch_of_a_session_takes_the_place_of_the_one_that_its_sender_has_given_up() {
        let world = World::default();
        let sender = Presence { name: "robot1".into(), number: 1 };
        world.add(1, 10, 0);
        world.add(2, 20, 0);
        world.arrivals.add_sender(sender, false);
        for came in 30..40 {
            world.add(1, came, 0);
        }
        assert_eq!((world.ended(), world.arrivals.take_left_out(), world.arrivals.take_left_out()), (10, 10, 0));
        assert_eq!(world.times(), [39, 20, -1]);
        // The place is free again.
        world.add(1, 50, 0);
        assert_eq!(world.times(), [50]);
    }

    #[test]
    fn batches_whose_session_cannot_be_read_share_one_place() {
        let world = World::default();
        for came in 0..100 {
            world.add_bytes(vec![came as u8; 1 << 10], came, 0);
        }
        assert_eq!((world.times(), world.ended()), (vec![99], 100));
    }

    #[test]
    fn one_session_that_sends_without_end_takes_one_place_among_the_others() {
        let world = World::default();
        for round in 0..100 {
            for came in 0..50 {
                world.add(7, came, FULL / 2);
            }
            world.add(8, 100, 1000);
            world.add(9, 101, 1000);
            assert_eq!(world.times(), [49, 100, 101], "round {round}");
        }
    }

    #[test]
    fn the_size_and_the_number_of_the_batches_of_many_sessions_are_limited() {
        let world = World::default();
        for session in 0..1000 {
            world.add(session, session as i64, 1 << 20);
        }
        let size = world.arrivals.lock().others.size;
        assert!((FULL..FULL + (2 << 20)).contains(&size), "{size}");
        assert_eq!(world.arrivals.take_left_out(), 1000 - (FULL >> 20) as u64);
        // One that has a place may send again, however full it is.
        world.add(5, 5000, 1 << 20);
        assert_eq!(world.times().len(), FULL >> 20);
        assert_eq!(world.arrivals.lock().others, Share::default());
        for session in 0..1000 {
            world.add(session, session as i64, 0);
        }
        assert_eq!(world.times(), (0..MAX_BATCHES as i64).collect::<Vec<_>>());
    }

    #[test]
    fn an_announced_session_is_not_kept_out_by_invented_ones() {
        let world = World::default();
        let announced = Presence { name: "robot1".into(), number: 1 };
        // A session that is announced later moves to the other share.
        world.add(1, 0, 10);
        for session in 1000..2000 {
            world.add(session, session as i64, 1 << 20);
        }
        world.arrivals.add_sender(announced.clone(), true);
        world.add(1, 1, 20 << 20);
        assert_eq!(world.arrivals.lock().announced.batches, 1);
        let times = world.times();
        assert_eq!((times[0], world.arrivals.lock().announced), (1, Share::default()));
        world.arrivals.add_sender(announced, false);
        world.add(1, 2, 0);
        assert_eq!(world.arrivals.lock().others.batches, 1);
    }

    #[test]
    fn a_batch_of_any_size_is_kept_once_a_little_is_free() {
        let world = World::default();
        for session in 0..100 {
            world.add(session, session as i64, 1 << 20);
        }
        world.add(1000, 1000, FULL * 2);
        assert!(matches!(world.arrivals.next(), Some(Arrival::Batch(ArrivedBatch { came: 0, .. }))));
        world.add(1000, 1001, FULL * 2);
        // Until it is handled there is no room for others.
        world.add(1001, 1002, 0);
        let times = world.times();
        assert_eq!(times.last(), Some(&1001));
        assert!(!times.contains(&1000));
    }

    #[test]
    fn all_that_waits_ends_without_an_answer_when_the_receiver_ends() {
        let world = World::default();
        world.add(1, 1, 0);
        world.add(2, 2, 0);
        world.arrivals.close();
        world.add(3, 3, 0);
        assert_eq!((world.ended(), world.times()), (3, vec![]));
    }
}
