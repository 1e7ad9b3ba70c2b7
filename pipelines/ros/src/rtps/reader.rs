//! A reader: it puts samples into their order, and asks for those that it has missed (RTPS 2.3, 8.4.12).

use super::assembly::Assembly;
use super::guid::{Guid, Prefix};
use super::message::Message;
use super::number_set::NumberSet;
use super::outgoing::{Content, Outgoing};
use super::submessage::{Body, Submessage};
use super::writer::is_later;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::net::SocketAddrV4;
use std::time::{Duration, Instant};

/// A writer that says nothing is asked again, in ever longer intervals from the first to the longest.
const FIRST_QUESTION: Duration = Duration::from_millis(100);
const LONGEST_QUESTION: Duration = Duration::from_secs(5);
/// Fragments that do not come on are asked for after this time, and then in ever longer intervals up to the longest.
/// The heartbeats of some writers are seconds apart.
const STALL: Duration = Duration::from_millis(20);
const LONGEST_STALL: Duration = Duration::from_secs(1);
/// The vendor of Fast DDS, as the identifiers of its participants begin.
const FAST_DDS: [u8; 2] = [1, 15];
/// The maximum number of samples that wait for earlier ones. Further ones are requested again.
const HELD_SAMPLES: usize = 1024;
/// The maximum number of samples that are assembled at a time.
const ASSEMBLIES: usize = 16;

/// A sample as it was received.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Sample {
    pub(crate) writer: Guid,
    pub(crate) sequence: i64,
    /// When it was published, nanoseconds since the Unix epoch.
    pub(crate) published: Option<i64>,
    /// Parameters beside it.
    pub(crate) inline: Vec<u8>,
    /// Whether these are little-endian.
    pub(crate) is_little: bool,
    pub(crate) payload: Vec<u8>,
}

/// A reader.
#[derive(Debug)]
pub(crate) struct Reader {
    guid: Guid,
    is_reliable: bool,
    writers: BTreeMap<Guid, MatchedWriter>,
}

#[derive(Debug)]
struct MatchedWriter {
    addresses: Vec<SocketAddrV4>,
    is_reliable: bool,
    /// Whether its samples are passed on.
    is_heard: bool,
    /// All before this one have come, or never will.
    next: i64,
    /// Later ones that have come; `None` for those that do not come.
    held: BTreeMap<i64, Option<Sample>>,
    assemblies: BTreeMap<i64, Assembly>,
    /// The number of its last heartbeat.
    heartbeat: Option<u32>,
    requests: u32,
    /// When it is asked for its samples, because it has sent nothing yet.
    question: Option<(Instant, Duration)>,
    /// When missing fragments are asked for, if none come before.
    stall: Option<(Instant, Duration)>,
}

impl Reader {
    pub(crate) const fn new(guid: Guid, is_reliable: bool) -> Self {
        Self { guid, is_reliable, writers: BTreeMap::new() }
    }

    /// Takes up a writer, or where it is now.
    pub(crate) fn add_writer(
        &mut self,
        guid: Guid,
        addresses: Vec<SocketAddrV4>,
        [is_reliable, is_heard]: [bool; 2],
        now: Instant,
    ) {
        if let Some(known) = self.writers.get_mut(&guid) {
            known.addresses = addresses;
            return;
        }
        let is_reliable = is_reliable && self.is_reliable;
        let writer = MatchedWriter {
            addresses,
            is_reliable,
            is_heard,
            next: 1,
            held: BTreeMap::new(),
            assemblies: BTreeMap::new(),
            heartbeat: None,
            requests: 0,
            question: is_reliable.then_some((now, FIRST_QUESTION)),
            stall: None,
        };
        self.writers.insert(guid, writer);
    }

    pub(crate) fn remove_writer(&mut self, guid: &Guid) {
        self.writers.remove(guid);
    }

    pub(crate) fn remove_participant(&mut self, prefix: Prefix) {
        self.writers.retain(|guid, _| guid.prefix != prefix);
    }

    /// Takes what a writer says: gives the samples that are in their turn, and what is to be answered.
    pub(crate) fn take(&mut self, part: &Submessage<'_>, now: Instant) -> (Vec<Sample>, Option<Outgoing>) {
        let from = Guid { prefix: part.source, entity: part.writer };
        let (samples, answer) = self.take_from(from, part, now);
        let is_heard = self.writers.get(&from).is_some_and(|writer| writer.is_heard);
        (if is_heard { samples } else { Vec::new() }, answer)
    }

    fn take_from(&mut self, from: Guid, part: &Submessage<'_>, now: Instant) -> (Vec<Sample>, Option<Outgoing>) {
        let Some(writer) = self.writers.get_mut(&from) else { return Default::default() };
        match &part.body {
            Body::Data { sequence, inline, is_little, payload, .. } => {
                let (inline, payload, is_little) = (inline.to_vec(), payload.to_vec(), *is_little);
                let (sequence, published) = (*sequence, part.published);
                let sample = Sample { writer: from, sequence, published, inline, is_little, payload };
                (writer.take_sample(sample), None)
            }
            Body::Fragments { sequence, first, fragment_size, sample_size, payload, .. } => {
                let sizes = (*sample_size, *fragment_size);
                writer.stall = writer.is_reliable.then_some((now + STALL, STALL));
                let Some(payload) = writer.assemble(*sequence, *first, sizes, payload) else {
                    return Default::default();
                };
                let (sequence, published, inline) = (*sequence, part.published, Vec::new());
                let sample = Sample { writer: from, sequence, published, inline, is_little: true, payload };
                (writer.take_sample(sample), None)
            }
            Body::Heartbeat { first, last, count, is_final } if writer.is_reliable => {
                if !is_later(*count, writer.heartbeat) {
                    return Default::default();
                }
                (writer.heartbeat, writer.question) = (Some(*count), None);
                let samples = writer.advance_to(*first);
                let is_whole = writer.next > *last;
                let answer = !(is_whole && *is_final);
                (samples, answer.then(|| writer.request(self.guid, from, *last)))
            }
            Body::Gap { start, set } if writer.is_reliable => (writer.take_gap(*start, set), None),
            _ => Default::default(),
        }
    }

    /// When it has something to ask.
    pub(crate) fn due(&self) -> Option<Instant> {
        self.writers.values().flat_map(|writer| [writer.question, writer.stall]).flatten().map(|(at, _)| at).min()
    }

    /// The questions that are due.
    pub(crate) fn tick(&mut self, now: Instant) -> Vec<Outgoing> {
        let mut outgoing = Vec::new();
        for (guid, writer) in &mut self.writers {
            if let Some((_, interval)) = writer.question.filter(|(at, _)| *at <= now) {
                writer.question = Some((now + interval, (interval * 2).min(LONGEST_QUESTION)));
                outgoing.push(writer.ask(self.guid, *guid));
            }
            if let Some((_, interval)) = writer.stall.filter(|(at, _)| *at <= now) {
                let last = writer.assemblies.keys().next_back().copied();
                let interval = (interval * 2).min(LONGEST_STALL);
                writer.stall = last.map(|_| (now + interval, interval));
                outgoing.extend(last.map(|last| writer.request(self.guid, *guid, last)));
            }
        }
        outgoing
    }
}

impl MatchedWriter {
    /// Takes a sample, and gives those that are in their turn.
    fn take_sample(&mut self, sample: Sample) -> Vec<Sample> {
        let sequence = sample.sequence;
        if sequence < self.next || sequence == i64::MAX {
            return Vec::new();
        }
        if !self.is_reliable {
            self.next = sequence + 1;
            self.assemblies.retain(|other, _| *other > sequence);
            return vec![sample];
        }
        if sequence == self.next || self.held.len() < HELD_SAMPLES {
            self.held.entry(sequence).or_insert(Some(sample));
        }
        self.in_turn()
    }

    /// Takes fragments of a sample, and gives it once it is whole.
    fn assemble(&mut self, sequence: i64, first: u32, sizes: (u32, u16), payload: &[u8]) -> Option<Vec<u8>> {
        if sequence < self.next || self.held.contains_key(&sequence) {
            return None;
        }
        let assembly = match self.assemblies.entry(sequence) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(unknown) => unknown.insert(Assembly::new(sizes.0, sizes.1)?),
        };
        assembly.add(first, sizes, payload);
        let sample = assembly.sample();
        if sample.is_some() {
            self.assemblies.remove(&sequence);
        } else if self.assemblies.len() > ASSEMBLIES {
            // Of what is not sent again the last counts, and of all else the first that is missing.
            match self.is_reliable {
                true => self.assemblies.pop_last(),
                false => self.assemblies.pop_first(),
            };
        }
        sample
    }

    /// Samples before this one do not come any more.
    fn advance_to(&mut self, first: i64) -> Vec<Sample> {
        let mut samples = Vec::new();
        // Those that have come are passed on, though others before them are lost.
        while let Some(entry) = self.held.first_entry().filter(|entry| *entry.key() < first) {
            samples.extend(entry.remove());
        }
        self.next = self.next.max(first);
        samples.extend(self.in_turn());
        samples
    }

    fn take_gap(&mut self, start: i64, set: &NumberSet) -> Vec<Sample> {
        if (start..set.base).contains(&self.next) {
            let samples = self.advance_to(set.base);
            self.mark_gone(&set.numbers);
            return samples.into_iter().chain(self.in_turn()).collect();
        }
        let room = HELD_SAMPLES.saturating_sub(self.held.len());
        let gone: Vec<i64> = (start.max(self.next)..set.base).take(room).collect();
        self.mark_gone(&gone);
        self.mark_gone(&set.numbers);
        self.in_turn()
    }

    fn mark_gone(&mut self, numbers: &[i64]) {
        for number in numbers.iter().filter(|number| **number >= self.next) {
            self.held.entry(*number).or_insert(None);
        }
    }

    /// Takes out the samples that are in their turn.
    fn in_turn(&mut self) -> Vec<Sample> {
        let mut samples = Vec::new();
        while let Some(entry) = self.held.first_entry().filter(|entry| *entry.key() <= self.next) {
            self.next = self.next.max(entry.key().saturating_add(1));
            samples.extend(entry.remove());
        }
        self.assemblies.retain(|sequence, _| *sequence >= self.next);
        samples
    }

    /// What asks a writer what it has: numbers begin with 1 (RTPS 2.3, 8.3.5.5), and Cyclone DDS rejects what begins
    /// with 0. Fast DDS answers at once if it begins with 0, and with 1 when its next heartbeat is due, after three
    /// seconds. So it is asked both in turn.
    fn ask(&mut self, own: Guid, writer: Guid) -> Outgoing {
        self.requests = self.requests.wrapping_add(1);
        let begins_with_zero = writer.prefix.is_of(FAST_DDS) && !self.requests.is_multiple_of(2);
        let nothing = NumberSet::new(i64::from(!begins_with_zero), []);
        let message = Message::new(own.prefix).to(writer.prefix);
        let message = message.acknack(own.entity, writer.entity, &nothing, self.requests, false);
        Outgoing { to: self.addresses.clone(), content: Content::Message(message) }
    }

    /// What says what has come, and asks for what is missing up to the last sample of the writer.
    fn request(&mut self, own: Guid, writer: Guid, last: i64) -> Outgoing {
        self.requests = self.requests.wrapping_add(1);
        let is_missing = |number: &i64| !self.held.contains_key(number);
        let missing = (self.next..=last).take(super::number_set::CAPACITY as usize).filter(is_missing);
        let (partly, wholly): (Vec<i64>, Vec<i64>) = missing.partition(|number| self.assemblies.contains_key(number));
        let missing = NumberSet::new(self.next, wholly);
        let (reader, from) = (own.entity, writer.entity);
        let mut message =
            Message::new(own.prefix).to(writer.prefix).acknack(reader, from, &missing, self.requests, true);
        for sequence in partly.into_iter().take(2) {
            let Some(assembly) = self.assemblies.get(&sequence) else { continue };
            let mut fragments = assembly.missing().peekable();
            let Some(base) = fragments.peek().copied() else { continue };
            let fragments = NumberSet::new(base, fragments);
            self.requests = self.requests.wrapping_add(1);
            message = message.nack_fragments(reader, from, sequence, &fragments, self.requests);
        }
        Outgoing { to: self.addresses.clone(), content: Content::Message(message) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::guid::EntityId;
    use super::super::submessage::submessages;
    use super::*;
    use std::net::Ipv4Addr;

    /// Where the first questions to a writer begin that says nothing.
    fn questions_begin_with(vendor: [u8; 2]) -> Vec<i64> {
        let of = |prefix, entity| Guid { prefix, entity };
        let mut prefix = [7; 12];
        prefix[..2].copy_from_slice(&vendor);
        let mut reader = Reader::new(of(Prefix([1; 12]), EntityId::reader(1)), true);
        let mut now = Instant::now();
        let address = SocketAddrV4::new(Ipv4Addr::LOCALHOST, 7411);
        reader.add_writer(of(Prefix(prefix), EntityId::writer(1)), vec![address], [true, true], now);
        let mut begins = Vec::new();
        for _ in 0..4 {
            now += LONGEST_QUESTION;
            for outgoing in reader.tick(now) {
                let Content::Message(message) = outgoing.content else { continue };
                for part in submessages(&message.into_bytes()) {
                    let Body::AckNack { missing, is_final, .. } = part.body else { continue };
                    assert!(missing.numbers.is_empty() && !is_final);
                    begins.push(missing.base);
                }
            }
        }
        begins
    }

    #[test]
    fn a_question_begins_with_one_and_for_fast_dds_with_zero_in_turn() {
        assert_eq!(questions_begin_with([1, 16]), [1; 4]);
        assert_eq!(questions_begin_with([0, 0]), [1; 4]);
        assert_eq!(questions_begin_with(FAST_DDS), [0, 1, 0, 1]);
    }
}
