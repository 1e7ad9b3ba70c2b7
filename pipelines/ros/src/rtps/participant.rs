//! A participant: it finds others and is found by them, and notifies watchers of what happens.

use super::discovered::{EndpointData, ParticipantData};
use super::disposal;
use super::guid::{EntityId, Guid, Prefix};
use super::message::Message;
use super::network::{Network, Reach};
use super::outgoing::{Content, Outgoing};
use super::reader::Sample;
use super::state::{Event, Mismatch, Role, State};
use gridweave_bridge::clock::nanoseconds_now;
use std::collections::BTreeMap;
use std::io;
use std::net::{Ipv4Addr, SocketAddrV4};
use std::sync::atomic::{AtomicBool, AtomicU16, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// Periods of the announcements of a participant: afterwards, and for the first ones; and the number of those.
const ANNOUNCEMENT: Duration = Duration::from_secs(3);
const FIRST_ANNOUNCEMENT: Duration = Duration::from_millis(100);
const FIRST_ANNOUNCEMENTS: u32 = 10;
/// Time after its last announcement after which others take it to be gone.
const LEASE: Duration = Duration::from_secs(20);
/// The largest datagram, bytes.
const LARGEST_DATAGRAM: usize = 65536;
/// Number of fragments that are sent at a time, and the pause after these: the buffers of a reader's system may hold no
/// more.
const BURST: usize = 8;
const PAUSE: Duration = Duration::from_micros(200);
/// Longest time at the end for readers to acknowledge what they lack.
const LINGER: Duration = Duration::from_secs(2);
/// Longest wait before it checks what is due.
const LONGEST_WAIT: Duration = Duration::from_secs(1);

/// Called with each sample of a reader.
type OnSample = Arc<dyn Fn(Sample) + Send + Sync>;

/// A watcher, which is notified of the endpoints of others.
pub(crate) trait Watch: Send + Sync {
    /// An endpoint is there, or is no more.
    fn endpoint(&self, endpoint: &EndpointData, is_there: bool);
    /// A local and a remote endpoint do not match.
    fn mismatch(&self, mismatch: &Mismatch);
    /// Called at least every second.
    fn tick(&self);
}

/// A participant, until it is dropped.
pub(crate) struct Participant {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

struct Shared {
    domain: u32,
    name: String,
    own: ParticipantData,
    network: Network,
    state: Mutex<State>,
    readers: Mutex<BTreeMap<EntityId, OnSample>>,
    watchers: Mutex<Vec<Box<dyn Watch>>>,
    is_over: AtomicBool,
    /// Notified when readers may have acknowledged something.
    has_answer: Condvar,
    /// Until when readers are waited for, since the first one was.
    patience: OnceLock<Instant>,
}

fn lock<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

/// An identifier that no other participant has: of the vendor, the process, the time and the number within the process.
fn new_prefix() -> Prefix {
    static NUMBER: AtomicU16 = AtomicU16::new(0);
    let number = NUMBER.fetch_add(1, Ordering::Relaxed).to_be_bytes();
    let process = std::process::id().to_be_bytes();
    let time = (nanoseconds_now() / 1000).to_be_bytes();
    let [a, b] = super::message::VENDOR;
    Prefix([
        a, b, time[3], time[4], time[5], time[6], time[7], process[1], process[2], process[3], number[0], number[1],
    ])
}

impl Participant {
    /// Joins a domain. `name` is shown by other programs, `enclave` is that of ROS.
    ///
    /// # Errors
    /// The system refuses a socket or a thread.
    pub(crate) fn start(domain: u32, [name, enclave]: [&str; 2], reach: Reach, peers: &[Ipv4Addr]) -> io::Result<Self> {
        let network = Network::open(domain, reach, peers)?;
        let [discovery, user] = network.locators();
        let prefix = new_prefix();
        let shared = Arc::new(Shared {
            domain,
            name: name.to_owned(),
            own: ParticipantData { prefix, discovery, user, lease: LEASE, enclave: enclave.to_owned() },
            network,
            state: Mutex::new(State::new(prefix)),
            readers: Mutex::default(),
            watchers: Mutex::default(),
            is_over: AtomicBool::new(false),
            has_answer: Condvar::new(),
            patience: OnceLock::new(),
        });
        let of = Arc::clone(&shared);
        let thread = thread::Builder::new().name("dds".to_owned()).spawn(move || of.run())?;
        Ok(Self { shared, thread: Some(thread) })
    }

    pub(crate) fn prefix(&self) -> Prefix {
        self.shared.own.prefix
    }

    /// Notifies a watcher of all endpoints of others, those that are there and those that come.
    pub(crate) fn watch(&self, watcher: Box<dyn Watch>) {
        // Locks in the order of `notify`.
        let mut watchers = lock(&self.shared.watchers);
        let present: Vec<EndpointData> = lock(&self.shared.state).endpoints().cloned().collect();
        present.iter().for_each(|endpoint| watcher.endpoint(endpoint, true));
        watchers.push(watcher);
    }

    /// Makes a writer. Of `data` all but the identifier counts.
    pub(crate) fn write_to(&self, data: EndpointData) -> Writing {
        Writing::new(&self.shared, data, Role::Writer)
    }

    /// Makes a writer for those readers that state the hash of the type as `data` does, and those that it is told to
    /// [serve](Writing::serve).
    pub(crate) fn write_to_hash(&self, data: EndpointData) -> Writing {
        Writing::new(&self.shared, data, Role::WriterOfHash)
    }

    /// Makes a reader, and calls `call` with what it hears: all that is published of its topic and type or, if it
    /// `hears_robots`, what has the same definition of the type and is of no run of Gridweave. Of `data` all but the identifier counts.
    pub(crate) fn read_from(
        &self,
        data: EndpointData,
        hears_robots: bool,
        call: impl Fn(Sample) + Send + Sync + 'static,
    ) -> Reading {
        // What comes at once waits until it is known for whom.
        let mut readers = lock(&self.shared.readers);
        let role = if hears_robots { Role::ReaderOfRobots } else { Role::Reader };
        let guid = self.shared.change(|state, now| state.create(data, role, now));
        readers.insert(guid.entity, Arc::new(call));
        Reading { shared: Arc::clone(&self.shared), guid }
    }
}

impl Drop for Participant {
    fn drop(&mut self) {
        self.shared.is_over.store(true, Ordering::Release);
        self.shared.network.wake();
        if let Some(thread) = self.thread.take() {
            // A panic has been reported already.
            let _ = thread.join();
        }
    }
}

/// A writer, until it is dropped.
pub(crate) struct Writing {
    shared: Arc<Shared>,
    guid: Guid,
}

impl Writing {
    fn new(shared: &Arc<Shared>, data: EndpointData, role: Role) -> Self {
        let guid = shared.change(|state, now| state.create(data, role, now));
        Self { shared: Arc::clone(shared), guid }
    }

    /// The same of the same participant.
    pub(crate) fn beside_to_hash(&self, data: EndpointData) -> Self {
        Self::new(&self.shared, data, Role::WriterOfHash)
    }

    /// Lets it serve all readers of a participant. Whether one of these misses what was written before.
    pub(crate) fn serve(&self, participant: Prefix) -> bool {
        self.shared.change(|state, now| state.serve(self.guid.entity, participant, now))
    }

    pub(crate) const fn guid(&self) -> Guid {
        self.guid
    }

    /// Publishes a sample.
    pub(crate) fn write(&self, payload: &[u8]) {
        let time = nanoseconds_now();
        self.shared.change(|state, now| state.write(self.guid.entity, time, payload.to_vec(), now));
    }
}

impl Drop for Writing {
    /// Its readers are given time to take what was written last.
    fn drop(&mut self) {
        self.shared.wait_for_readers(self.guid.entity);
        self.shared.change(|state, now| state.remove(self.guid.entity, now));
    }
}

/// A reader, until it is dropped.
pub(crate) struct Reading {
    shared: Arc<Shared>,
    guid: Guid,
}

impl Reading {
    pub(crate) const fn guid(&self) -> Guid {
        self.guid
    }
}

impl Drop for Reading {
    fn drop(&mut self) {
        lock(&self.shared.readers).remove(&self.guid.entity);
        self.shared.change(|state, now| state.remove(self.guid.entity, now));
    }
}

impl Shared {
    /// Changes the state, and sends what comes of it.
    fn change<T>(&self, change: impl FnOnce(&mut State, Instant) -> T) -> T {
        let mut state = lock(&self.state);
        let changed = change(&mut state, Instant::now());
        let outgoing = std::mem::take(&mut state.outgoing);
        drop(state);
        self.send(outgoing);
        // Something may be due sooner, and mismatches are to be reported.
        self.network.wake();
        changed
    }

    /// Waits until the readers of a writer have all that was written, or will not take it.
    fn wait_for_readers(&self, writer: EntityId) {
        let until = *self.patience.get_or_init(|| Instant::now() + LINGER);
        let longest = until.saturating_duration_since(Instant::now());
        let is_behind = |state: &mut State| !self.is_over.load(Ordering::Acquire) && state.is_behind(writer);
        drop(self.has_answer.wait_timeout_while(lock(&self.state), longest, is_behind));
    }

    fn run(&self) {
        let mut buffer = vec![0; LARGEST_DATAGRAM];
        let (mut announcements, mut announced) = (0, None::<Instant>);
        while !self.is_over.load(Ordering::Acquire) {
            let period = if announcements < FIRST_ANNOUNCEMENTS { FIRST_ANNOUNCEMENT } else { ANNOUNCEMENT };
            if announced.is_none_or(|last| last.elapsed() >= period) {
                self.announce();
                (announcements, announced) = (announcements + 1, Some(Instant::now()));
            }
            let mut state = lock(&self.state);
            let now = Instant::now();
            state.tick(now);
            let until =
                state.due().map_or(period, |due| due.saturating_duration_since(now)).min(period).min(LONGEST_WAIT);
            let (outgoing, events) = (std::mem::take(&mut state.outgoing), std::mem::take(&mut state.events));
            drop(state);
            self.send(outgoing);
            self.notify(events);
            lock(&self.watchers).iter().for_each(|watcher| watcher.tick());
            self.network.receive(until, &mut buffer, |datagram, from| self.take(datagram, from));
        }
        self.leave();
    }

    fn take(&self, datagram: &[u8], from: Ipv4Addr) {
        let mut state = lock(&self.state);
        let new = state.take(datagram, from, Instant::now());
        let (outgoing, events) = (std::mem::take(&mut state.outgoing), std::mem::take(&mut state.events));
        let known = |prefix: &Prefix| state.peers.get(prefix).map(|peer| peer.data.discovery.clone());
        let greeted: Vec<SocketAddrV4> = new.iter().filter_map(known).flatten().collect();
        drop(state);
        self.has_answer.notify_all();
        if !greeted.is_empty() {
            let greeting = self.announcement();
            greeted.into_iter().for_each(|to| self.network.send(&greeting, to));
        }
        self.send(outgoing);
        self.notify(events);
    }

    /// The message that it is there.
    fn announcement(&self) -> Vec<u8> {
        let data = self.own.to_bytes(&self.name, self.domain, self.network.multicast_locator());
        self.participant_message([Vec::new(), data], false)
    }

    fn participant_message(&self, [inline, payload]: [Vec<u8>; 2], is_key: bool) -> Vec<u8> {
        let (reader, writer) = (EntityId::PARTICIPANTS_READER, EntityId::PARTICIPANTS_WRITER);
        let message = Message::new(self.own.prefix).published(nanoseconds_now());
        message.data(reader, writer, 1, &inline, is_key, &payload).into_bytes()
    }

    /// Says to all that it is there.
    fn announce(&self) {
        self.say_to_all(&self.announcement());
    }

    /// Says to all that it is no more.
    fn leave(&self) {
        self.say_to_all(&self.participant_message(disposal::of_participant(self.own.prefix), true));
    }

    fn say_to_all(&self, message: &[u8]) {
        self.network.send_to_unknown(message);
        let state = lock(&self.state);
        let known: Vec<SocketAddrV4> = state.peers.values().flat_map(|peer| peer.data.discovery.clone()).collect();
        drop(state);
        known.into_iter().for_each(|to| self.network.send(message, to));
    }

    fn send(&self, outgoing: Vec<Outgoing>) {
        for Outgoing { to, content } in outgoing {
            match content {
                Content::Message(message) => {
                    let bytes = message.into_bytes();
                    to.iter().for_each(|to| self.network.send(&bytes, *to));
                }
                Content::Fragments { route, change, numbers } => {
                    for burst in numbers.chunks(BURST) {
                        for number in burst {
                            let bytes = route.fragment(&change, *number).into_bytes();
                            to.iter().for_each(|to| self.network.send(&bytes, *to));
                        }
                        thread::sleep(PAUSE);
                    }
                }
            }
        }
    }

    fn notify(&self, events: Vec<Event>) {
        for event in events {
            match event {
                Event::Sample(reader, sample) => {
                    let call = lock(&self.readers).get(&reader).cloned();
                    if let Some(call) = call {
                        call(sample);
                    }
                }
                Event::Endpoint(endpoint, is_there) => {
                    lock(&self.watchers).iter().for_each(|watcher| watcher.endpoint(&endpoint, is_there));
                }
                Event::Mismatch(mismatch) => {
                    lock(&self.watchers).iter().for_each(|watcher| watcher.mismatch(&mismatch))
                }
            }
        }
    }
}
