//! The state of a participant: its endpoints, the other participants and theirs, and which endpoints match.

use super::super::discovery::node_identity::is_of_gridweave;
use super::discovered::{EndpointData, ParticipantData};
use super::guid::{EntityId, Guid, Prefix};
use super::locator::reachable;
use super::outgoing::Outgoing;
use super::policies::Policies;
use super::reader::{Reader, Sample};
use super::writer::Writer;
use std::collections::{BTreeMap, BTreeSet};
use std::net::{Ipv4Addr, SocketAddrV4};
use std::time::Instant;

/// An event of which watchers are notified.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Event {
    /// An endpoint of another participant is there, or is no more.
    Endpoint(Box<EndpointData>, bool),
    /// A local and a remote endpoint do not match.
    Mismatch(Box<Mismatch>),
    /// A sample has come for a reader.
    Sample(EntityId, Sample),
}

/// Why a local and a remote endpoint of one topic do not match.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Mismatch {
    pub(crate) here: EndpointData,
    pub(crate) there: EndpointData,
    /// The policies that do not fit; none if their types are not the same.
    pub(crate) policies: Vec<&'static str>,
}

/// What an endpoint here does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    Writer,
    /// A writer that serves readers which state the hash of the type that it states, and all those of participants that
    /// it is told to [serve](State::serve).
    WriterOfHash,
    Reader,
    /// A reader that matches only writers with the same definition of the type, and none of a run of Gridweave.
    ReaderOfRobots,
}

/// A writer or reader here, as it is announced.
#[derive(Debug)]
struct Announced {
    role: Role,
    data: EndpointData,
    /// The number of the announcement.
    sequence: i64,
    /// The participants that it is told to serve.
    served: BTreeSet<Prefix>,
}

/// Another participant.
#[derive(Debug)]
pub(super) struct Peer {
    pub(super) data: ParticipantData,
    pub(super) heard: Instant,
    /// The address that it first sent from.
    pub(super) from: Ipv4Addr,
}

/// What a participant knows.
#[derive(Debug)]
pub(crate) struct State {
    pub(super) prefix: Prefix,
    pub(super) writers: BTreeMap<EntityId, Writer>,
    pub(super) readers: BTreeMap<EntityId, Reader>,
    announced: BTreeMap<EntityId, Announced>,
    pub(super) peers: BTreeMap<Prefix, Peer>,
    endpoints: BTreeMap<Guid, EndpointData>,
    next_number: u16,
    pub(super) events: Vec<Event>,
    pub(super) outgoing: Vec<Outgoing>,
}

impl State {
    pub(crate) fn new(prefix: Prefix) -> Self {
        let writer = |entity| (entity, Writer::new(Guid { prefix, entity }, None, true));
        let reader = |entity| (entity, Reader::new(Guid { prefix, entity }, true));
        Self {
            prefix,
            writers: [EntityId::PUBLICATIONS_WRITER, EntityId::SUBSCRIPTIONS_WRITER, EntityId::MESSAGES_WRITER]
                .map(writer)
                .into(),
            readers: [EntityId::PUBLICATIONS_READER, EntityId::SUBSCRIPTIONS_READER].map(reader).into(),
            announced: BTreeMap::new(),
            peers: BTreeMap::new(),
            endpoints: BTreeMap::new(),
            next_number: 1,
            events: Vec::new(),
            outgoing: Vec::new(),
        }
    }

    /// The endpoints of others.
    pub(crate) fn endpoints(&self) -> impl Iterator<Item = &EndpointData> {
        self.endpoints.values()
    }

    /// Makes a writer (or a reader) and announces it. Of `data` all but the identifier counts.
    pub(crate) fn create(&mut self, mut data: EndpointData, role: Role, now: Instant) -> Guid {
        let is_writer = matches!(role, Role::Writer | Role::WriterOfHash);
        let number = self.next_number;
        self.next_number = self.next_number.wrapping_add(1).max(1);
        let entity = if is_writer { EntityId::writer(number) } else { EntityId::reader(number) };
        let guid = Guid { prefix: self.prefix, entity };
        data.guid = guid;
        let Policies { is_reliable, depth, .. } = data.policies;
        match is_writer {
            true => {
                let depth = depth.map(|depth| depth as usize);
                self.writers.insert(entity, Writer::new(guid, depth, data.policies.is_latched()));
            }
            false => {
                self.readers.insert(entity, Reader::new(guid, is_reliable));
            }
        }
        let sequence = self.announce(is_writer, [Vec::new(), data.to_bytes()], false, now);
        self.announced.insert(entity, Announced { role, data, sequence, served: BTreeSet::new() });
        let others: Vec<Guid> = self.endpoints.keys().copied().collect();
        for other in others {
            self.match_pair(entity, other, now);
        }
        guid
    }

    /// Removes a writer or reader, and says so.
    pub(crate) fn remove(&mut self, entity: EntityId, now: Instant) {
        let Some(announced) = self.announced.remove(&entity) else { return };
        self.writers.remove(&entity);
        self.readers.remove(&entity);
        let is_writer = entity.is_writer();
        if let Some(writer) = self.writers.get_mut(&announcer(is_writer)) {
            writer.forget(announced.sequence);
        }
        let guid = Guid { prefix: self.prefix, entity };
        self.announce(is_writer, super::disposal::of_endpoint(guid), true, now);
    }

    fn announce(&mut self, is_writer: bool, sample: [Vec<u8>; 2], is_key: bool, now: Instant) -> i64 {
        let Some(writer) = self.writers.get_mut(&announcer(is_writer)) else { return 0 };
        let (sequence, outgoing) = writer.write(gridweave_bridge::clock::nanoseconds_now(), sample, is_key, now);
        self.outgoing.extend(outgoing);
        sequence
    }

    /// Publishes a sample.
    pub(crate) fn write(&mut self, entity: EntityId, published: i64, payload: Vec<u8>, now: Instant) -> Option<i64> {
        let writer = self.writers.get_mut(&entity)?;
        let (sequence, outgoing) = writer.write(published, [Vec::new(), payload], false, now);
        self.outgoing.extend(outgoing);
        Some(sequence)
    }

    /// Lets a writer serve all readers of a participant. Whether one was told before that there is nothing for it, which
    /// holds for what was written until now.
    pub(crate) fn serve(&mut self, entity: EntityId, prefix: Prefix, now: Instant) -> bool {
        let Some(announced) = self.announced.get_mut(&entity).filter(|_| self.peers.contains_key(&prefix)) else {
            return false;
        };
        if !announced.served.insert(prefix) {
            return false;
        }
        let unserved =
            self.writers.get_mut(&entity).map(|writer| writer.take_unserved_readers(prefix)).unwrap_or_default();
        unserved.iter().for_each(|reader| self.match_pair(entity, *reader, now));
        !unserved.is_empty()
    }

    /// Whether a reliable reader lacks something of a writer.
    pub(crate) fn is_behind(&self, writer: EntityId) -> bool {
        self.writers.get(&writer).is_some_and(Writer::is_behind)
    }

    /// Another participant says that it is there. Whether it was not known.
    pub(super) fn note_peer(&mut self, data: ParticipantData, from: Ipv4Addr, now: Instant) -> bool {
        let prefix = data.prefix;
        if prefix == self.prefix {
            return false;
        }
        if let Some(peer) = self.peers.get_mut(&prefix) {
            peer.heard = now;
            if peer.data == data {
                return false;
            }
        }
        let to = reachable(&data.discovery, from);
        let is_new = self.peers.insert(prefix, Peer { data, heard: now, from }).is_none();
        for entity in [EntityId::PUBLICATIONS_READER, EntityId::SUBSCRIPTIONS_READER] {
            if let (Some(writer), Some(reader)) =
                (self.writers.get_mut(&matching(entity)), self.readers.get_mut(&entity))
            {
                self.outgoing.extend(writer.add_reader(Guid { prefix, entity }, to.clone(), [true, true], now));
                reader.add_writer(Guid { prefix, entity: matching(entity) }, to.clone(), [true, true], now);
            }
        }
        // Fast DDS up to 2.9 asks for it whether it is announced or not, and does not cease without an answer.
        if let Some(writer) = self.writers.get_mut(&EntityId::MESSAGES_WRITER) {
            let reader = Guid { prefix, entity: EntityId::MESSAGES_READER };
            self.outgoing.extend(writer.add_reader(reader, to, [true, true], now));
        }
        is_new
    }

    /// Another participant is gone, with all its endpoints.
    pub(super) fn remove_peer(&mut self, prefix: Prefix) {
        if self.peers.remove(&prefix).is_none() {
            return;
        }
        self.writers.values_mut().for_each(|writer| writer.remove_participant(prefix));
        self.readers.values_mut().for_each(|reader| reader.remove_participant(prefix));
        self.announced.values_mut().for_each(|announced| _ = announced.served.remove(&prefix));
        let first = Guid { prefix, entity: EntityId::UNKNOWN };
        let gone: Vec<Guid> = self.endpoints.range(first..).map(|(guid, _)| *guid).collect();
        gone.into_iter().take_while(|guid| guid.prefix == prefix).for_each(|guid| self.remove_endpoint(guid));
    }

    /// Another participant's endpoint is there, or is as `data` says from now on.
    pub(super) fn note_endpoint(&mut self, mut data: EndpointData, now: Instant) {
        let guid = data.guid;
        let Some(peer) = self.peers.get(&guid.prefix) else { return };
        data.enclave.clone_from(&peer.data.enclave);
        match self.endpoints.get(&guid) {
            Some(known) if *known == data => return,
            Some(_) => self.remove_endpoint(guid),
            None => {}
        }
        self.endpoints.insert(guid, data.clone());
        let own: Vec<EntityId> = self.announced.keys().copied().collect();
        for entity in own {
            self.match_pair(entity, guid, now);
        }
        // After the mismatches, which end if a reader subscribes again because of it.
        self.events.push(Event::Endpoint(Box::new(data), true));
    }

    pub(super) fn remove_endpoint(&mut self, guid: Guid) {
        let Some(data) = self.endpoints.remove(&guid) else { return };
        self.writers.values_mut().for_each(|writer| writer.remove_reader(&guid));
        self.readers.values_mut().for_each(|reader| reader.remove_writer(&guid));
        self.events.push(Event::Endpoint(Box::new(data), false));
    }

    /// Connects a local endpoint with a remote one if they match.
    fn match_pair(&mut self, entity: EntityId, other: Guid, now: Instant) {
        let (Some(announced), Some(there)) = (self.announced.get(&entity), self.endpoints.get(&other)) else { return };
        let here = &announced.data;
        if here.topic != there.topic || entity.is_writer() == other.entity.is_writer() {
            return;
        }
        let of_types = [here, there].map(|endpoint| (&endpoint.type_name, endpoint.type_hash.as_ref()));
        let has_other_type = of_types[0].0 != of_types[1].0;
        let has_other_hash = of_types[0].1 != of_types[1].1;
        let is_served = announced.served.contains(&other.prefix) || (here.type_hash.is_some() && !has_other_hash);
        if announced.role == Role::WriterOfHash && !is_served {
            let to = self.addresses_of(there);
            if let Some(writer) = self.writers.get_mut(&entity) {
                self.outgoing.extend(writer.add_unserved_reader(other, to));
            }
            return;
        }
        if entity.is_writer() && !has_other_type && has_other_hash && of_types.iter().all(|(_, hash)| hash.is_some()) {
            // As among nodes of ROS, they are connected all the same.
            let mismatch = Mismatch { here: here.clone(), there: there.clone(), policies: Vec::new() };
            self.events.push(Event::Mismatch(Box::new(mismatch)));
        }
        // The writer takes it for a reader, and so it is one, though it may not pass on what it gets.
        let is_heard = announced.role != Role::ReaderOfRobots || !(has_other_hash || is_of_gridweave(&there.enclave));
        let (reader, writer) = if entity.is_writer() { (there, here) } else { (here, there) };
        let policies = reader.policies.mismatches(&writer.policies);
        if has_other_type || !policies.is_empty() {
            let policies = if has_other_type { Vec::new() } else { policies };
            let mismatch = Mismatch { here: here.clone(), there: there.clone(), policies };
            self.events.push(Event::Mismatch(Box::new(mismatch)));
            return;
        }
        let Policies { is_reliable, .. } = there.policies;
        let is_latched = there.policies.is_latched();
        let to = self.addresses_of(there);
        if let Some(writer) = self.writers.get_mut(&entity) {
            self.outgoing.extend(writer.add_reader(other, to, [is_reliable, is_latched], now));
        } else if let Some(reader) = self.readers.get_mut(&entity) {
            reader.add_writer(other, to, [is_reliable, is_heard], now);
        }
    }

    /// Where an endpoint is reached.
    fn addresses_of(&self, endpoint: &EndpointData) -> Vec<SocketAddrV4> {
        let Some(peer) = self.peers.get(&endpoint.guid.prefix) else { return Vec::new() };
        let own = if endpoint.addresses.is_empty() { &peer.data.user } else { &endpoint.addresses };
        reachable(own, peer.from)
    }

    /// When something is due, if anything is.
    pub(super) fn due(&self) -> Option<Instant> {
        let writers = self.writers.values().filter_map(Writer::due);
        writers.chain(self.readers.values().filter_map(Reader::due)).min()
    }

    /// Does what is due.
    pub(super) fn tick(&mut self, now: Instant) {
        let gone =
            |peer: &&Prefix| self.peers.get(*peer).is_some_and(|peer| now.duration_since(peer.heard) > peer.data.lease);
        let gone: Vec<Prefix> = self.peers.keys().filter(gone).copied().collect();
        gone.into_iter().for_each(|prefix| self.remove_peer(prefix));
        let Self { writers, readers, outgoing, .. } = self;
        outgoing.extend(writers.values_mut().flat_map(|writer| writer.tick(now)));
        outgoing.extend(readers.values_mut().flat_map(|reader| reader.tick(now)));
    }
}

/// The writer that announces writers, or readers.
const fn announcer(of_writers: bool) -> EntityId {
    if of_writers { EntityId::PUBLICATIONS_WRITER } else { EntityId::SUBSCRIPTIONS_WRITER }
}

/// The writer of announcements that matches a reader of them.
fn matching(reader: EntityId) -> EntityId {
    announcer(reader == EntityId::PUBLICATIONS_READER)
}
