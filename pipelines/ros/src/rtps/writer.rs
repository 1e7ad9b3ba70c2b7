//! A writer: it keeps its last samples, and sends again what a reliable reader has missed (RTPS 2.3, 8.4.9).

use super::guid::{EntityId, Guid, Prefix};
use super::number_set::NumberSet;
use super::outgoing::{Change, Content, Outgoing, Route};
use std::collections::BTreeMap;
use std::net::SocketAddrV4;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// After a sample that is not acknowledged a heartbeat follows so soon, and then in ever longer intervals up to the
/// longest.
const FIRST_HEARTBEAT: Duration = Duration::from_millis(50);
const LONGEST_HEARTBEAT: Duration = Duration::from_secs(1);

/// What is sent again is followed by a heartbeat at once, but no more often than this: where samples of some size never
/// arrive, no more is sent than that.
const REPAIR_INTERVAL: Duration = Duration::from_millis(10);

/// A writer.
#[derive(Debug)]
pub(crate) struct Writer {
    guid: Guid,
    /// The number of samples that it keeps; `None` for all.
    depth: Option<usize>,
    /// Whether late joiners get the samples that it keeps.
    is_latched: bool,
    kept: BTreeMap<i64, Arc<Change>>,
    last: i64,
    readers: BTreeMap<Guid, MatchedReader>,
    /// Readers that get nothing, with their addresses.
    unserved: BTreeMap<Guid, Vec<SocketAddrV4>>,
    heartbeats: u32,
    interval: Duration,
    due: Option<Instant>,
    /// When the next heartbeat after a repair may be sent.
    next_repair: Option<Instant>,
}

#[derive(Debug)]
struct MatchedReader {
    addresses: Vec<SocketAddrV4>,
    is_reliable: bool,
    /// The first sample that is for it.
    first: i64,
    /// It has all up to this one.
    acknowledged: i64,
    /// The number of its last request.
    request: Option<u32>,
    fragments_request: Option<u32>,
}

/// Whether a count comes after the last one. Counts may overflow.
pub(crate) fn is_later(count: u32, last: Option<u32>) -> bool {
    last.is_none_or(|last| count.wrapping_sub(last).cast_signed() > 0)
}

impl Writer {
    pub(crate) const fn new(guid: Guid, depth: Option<usize>, is_latched: bool) -> Self {
        Self {
            guid,
            depth,
            is_latched,
            kept: BTreeMap::new(),
            last: 0,
            readers: BTreeMap::new(),
            unserved: BTreeMap::new(),
            heartbeats: 0,
            interval: FIRST_HEARTBEAT,
            due: None,
            next_repair: None,
        }
    }

    /// Whether a reliable reader lacks something.
    pub(crate) fn is_behind(&self) -> bool {
        self.readers.values().any(|reader| reader.is_reliable && reader.acknowledged < self.last)
    }

    /// Keeps a sample and gives what is to be sent, with the sample's number.
    pub(crate) fn write(
        &mut self,
        published: i64,
        [inline, payload]: [Vec<u8>; 2],
        is_key: bool,
        now: Instant,
    ) -> (i64, Vec<Outgoing>) {
        self.last += 1;
        let change = Arc::new(Change { sequence: self.last, published, inline, is_key, payload });
        self.kept.insert(self.last, Arc::clone(&change));
        while self.depth.is_some_and(|depth| self.kept.len() > depth.max(1)) {
            self.kept.pop_first();
        }
        let mut to: Vec<SocketAddrV4> = self.readers.values().flat_map(|reader| reader.addresses.clone()).collect();
        to.sort_unstable();
        to.dedup();
        let mut outgoing = Vec::new();
        if !to.is_empty() {
            let route = self.route(Prefix::UNKNOWN, EntityId::UNKNOWN);
            outgoing.push(Outgoing { to, content: route.sample(&change) });
        }
        outgoing.extend(self.heartbeat(now, true));
        (self.last, outgoing)
    }

    /// Keeps a sample no longer.
    pub(crate) fn forget(&mut self, sequence: i64) {
        self.kept.remove(&sequence);
    }

    /// Takes up a reader, or where it is now.
    pub(crate) fn add_reader(
        &mut self,
        guid: Guid,
        addresses: Vec<SocketAddrV4>,
        [is_reliable, is_latched]: [bool; 2],
        now: Instant,
    ) -> Vec<Outgoing> {
        if let Some(known) = self.readers.get_mut(&guid) {
            known.addresses = addresses;
            return Vec::new();
        }
        let first = if self.is_latched && is_latched { 1 } else { self.last + 1 };
        let (acknowledged, request, fragments_request) = (first - 1, None, None);
        let reader = MatchedReader { addresses, is_reliable, first, acknowledged, request, fragments_request };
        self.readers.insert(guid, reader);
        self.interval = FIRST_HEARTBEAT;
        self.due = Some(now + FIRST_HEARTBEAT);
        self.heartbeat_for(&guid).into_iter().collect()
    }

    /// Takes up a reader that matches by the rules of DDS and is to get nothing. It is told that there is nothing for it,
    /// or else it asks for ever.
    pub(crate) fn add_unserved_reader(&mut self, guid: Guid, addresses: Vec<SocketAddrV4>) -> Option<Outgoing> {
        self.unserved.insert(guid, addresses);
        self.empty_heartbeat_for(&guid)
    }

    /// The readers of a participant that got nothing, which are not taken for such ones any longer.
    pub(crate) fn take_unserved_readers(&mut self, prefix: Prefix) -> Vec<Guid> {
        let readers: Vec<Guid> = self.unserved.keys().filter(|guid| guid.prefix == prefix).copied().collect();
        self.unserved.retain(|guid, _| guid.prefix != prefix);
        readers
    }

    fn empty_heartbeat_for(&mut self, guid: &Guid) -> Option<Outgoing> {
        let to = self.unserved.get(guid)?.clone();
        self.heartbeats = self.heartbeats.wrapping_add(1);
        let (route, range) = (self.route(guid.prefix, guid.entity), [self.last + 1, self.last]);
        let message = route.message().heartbeat(guid.entity, self.guid.entity, range, self.heartbeats);
        Some(Outgoing { to, content: Content::Message(message) })
    }

    pub(crate) fn remove_reader(&mut self, guid: &Guid) {
        self.readers.remove(guid);
        self.unserved.remove(guid);
    }

    pub(crate) fn remove_participant(&mut self, prefix: Prefix) {
        self.readers.retain(|guid, _| guid.prefix != prefix);
        self.take_unserved_readers(prefix);
    }

    /// A reader says what it has and asks for what it misses.
    pub(crate) fn take_acknack(
        &mut self,
        reader: Guid,
        missing: &NumberSet,
        count: u32,
        is_final: bool,
        now: Instant,
    ) -> Vec<Outgoing> {
        if !is_final && known_nothing(missing) && self.unserved.contains_key(&reader) {
            return self.empty_heartbeat_for(&reader).into_iter().collect();
        }
        let route = self.route(reader.prefix, reader.entity);
        let Some(known) = self.readers.get_mut(&reader).filter(|known| is_later(count, known.request)) else {
            return Vec::new();
        };
        known.request = Some(count);
        known.acknowledged = missing.base.saturating_sub(1).clamp(known.acknowledged, self.last);
        let (to, first) = (known.addresses.clone(), known.first);
        let mut outgoing = Vec::new();
        let mut gone = Vec::new();
        for number in missing.numbers.iter().filter(|number| **number <= self.last) {
            match self.kept.get(number).filter(|_| *number >= first) {
                Some(change) => outgoing.push(Outgoing { to: to.clone(), content: route.sample(change) }),
                None => gone.push(*number),
            }
        }
        outgoing.extend(gaps(route, &gone).map(|content| Outgoing { to: to.clone(), content }));
        if !outgoing.is_empty() || !is_final {
            self.interval = FIRST_HEARTBEAT;
            let is_behind = self.readers.get(&reader).is_some_and(|known| known.acknowledged < self.last);
            if is_behind || known_nothing(missing) {
                outgoing.extend(self.heartbeat_after_repair(&reader, now));
            }
        }
        outgoing
    }

    /// A reader asks for fragments of a sample.
    pub(crate) fn take_nack_fragments(
        &mut self,
        reader: Guid,
        sequence: i64,
        missing: &NumberSet,
        count: u32,
        now: Instant,
    ) -> Vec<Outgoing> {
        let route = self.route(reader.prefix, reader.entity);
        let Some(known) = self.readers.get_mut(&reader).filter(|known| is_later(count, known.fragments_request)) else {
            return Vec::new();
        };
        known.fragments_request = Some(count);
        let to = known.addresses.clone();
        let content = match self.kept.get(&sequence) {
            Some(change) => {
                let is_there = |number: &u32| (1..=change.fragment_count()).contains(number);
                let numbers = missing.numbers.iter().filter_map(|number| u32::try_from(*number).ok());
                let numbers = numbers.filter(is_there).collect();
                Some(Content::Fragments { route, change: Arc::clone(change), numbers })
            }
            None => gaps(route, &[sequence]).next(),
        };
        let mut outgoing: Vec<Outgoing> =
            content.into_iter().map(|content| Outgoing { to: to.clone(), content }).collect();
        self.interval = FIRST_HEARTBEAT;
        outgoing.extend(self.heartbeat_after_repair(&reader, now));
        outgoing
    }

    /// When it has something to say, if nothing comes before.
    pub(crate) const fn due(&self) -> Option<Instant> {
        self.due
    }

    /// What is due.
    pub(crate) fn tick(&mut self, now: Instant) -> Vec<Outgoing> {
        if self.due.is_none_or(|due| due > now) {
            return Vec::new();
        }
        self.heartbeat(now, false)
    }

    /// Heartbeats for all reliable readers that lack something, of which those after a sample are the first.
    fn heartbeat(&mut self, now: Instant, is_first: bool) -> Vec<Outgoing> {
        let last = self.last;
        let lacks = |reader: &MatchedReader| reader.is_reliable && reader.acknowledged < last;
        let lacking: Vec<Guid> =
            self.readers.iter().filter(|(_, reader)| lacks(reader)).map(|(guid, _)| *guid).collect();
        self.interval = if is_first { FIRST_HEARTBEAT } else { (self.interval * 2).min(LONGEST_HEARTBEAT) };
        self.due = (!lacking.is_empty()).then(|| now + self.interval);
        lacking.iter().filter_map(|guid| self.heartbeat_for(guid)).collect()
    }

    /// A heartbeat at once, or else when it may be sent.
    fn heartbeat_after_repair(&mut self, guid: &Guid, now: Instant) -> Option<Outgoing> {
        if let Some(next) = self.next_repair.filter(|next| *next > now) {
            self.due = Some(self.due.map_or(next, |due| due.min(next)));
            return None;
        }
        self.next_repair = Some(now + REPAIR_INTERVAL);
        self.due = Some(now + self.interval);
        self.heartbeat_for(guid)
    }

    fn heartbeat_for(&mut self, guid: &Guid) -> Option<Outgoing> {
        let reader = self.readers.get(guid).filter(|reader| reader.is_reliable)?;
        let oldest = self.kept.keys().next().copied().unwrap_or(self.last + 1);
        self.heartbeats = self.heartbeats.wrapping_add(1);
        let (route, range) = (self.route(guid.prefix, guid.entity), [oldest.max(reader.first), self.last]);
        let message = route.message().heartbeat(guid.entity, self.guid.entity, range, self.heartbeats);
        Some(Outgoing { to: reader.addresses.clone(), content: Content::Message(message) })
    }

    const fn route(&self, destination: Prefix, reader: EntityId) -> Route {
        Route { source: self.guid.prefix, writer: self.guid.entity, destination, reader }
    }
}

/// Whether a reader has received nothing of the writer yet.
const fn known_nothing(missing: &NumberSet) -> bool {
    missing.base <= 1
}

/// What says that samples do not come, a message for each run of consecutive ones.
fn gaps(route: Route, gone: &[i64]) -> impl Iterator<Item = Content> + '_ {
    gone.chunk_by(|a, b| a + 1 == *b).filter_map(move |run| {
        let end = NumberSet::new(run.last()? + 1, []);
        Some(Content::Message(route.message().gap(route.reader, route.writer, *run.first()?, &end)))
    })
}
