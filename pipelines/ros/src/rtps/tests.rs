//! A writer and a reader over a network that loses, swaps and repeats datagrams.

use super::guid::{EntityId, Guid, Prefix};
use super::number_set::NumberSet;
use super::outgoing::{Content, Outgoing};
use super::reader::Reader;
use super::submessage::{Body, submessages};
use super::writer::Writer;
use proptest::prelude::*;
use std::net::{Ipv4Addr, SocketAddrV4};
use std::time::{Duration, Instant};

const WRITER: Guid = Guid { prefix: Prefix([1; 12]), entity: EntityId::writer(1) };
const READER: Guid = Guid { prefix: Prefix([2; 12]), entity: EntityId::reader(1) };
const ADDRESS: SocketAddrV4 = SocketAddrV4::new(Ipv4Addr::LOCALHOST, 7411);

/// What becomes of a datagram.
#[derive(Clone, Copy, Debug)]
enum Fate {
    Comes,
    IsLost,
    ComesTwice,
    /// Comes after the next one.
    ComesLater,
}

/// Draws what becomes of datagrams. A fixed pattern could lose the same one for ever.
#[derive(Clone, Copy, Debug)]
struct Fates(u64);

impl Fates {
    fn next(&mut self) -> Fate {
        // SplitMix64.
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut drawn = self.0;
        drawn = (drawn ^ (drawn >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        drawn = (drawn ^ (drawn >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        match (drawn ^ (drawn >> 31)) % 8 {
            0..4 => Fate::Comes,
            4 | 5 => Fate::IsLost,
            6 => Fate::ComesTwice,
            _ => Fate::ComesLater,
        }
    }
}

fn datagrams(outgoing: Vec<Outgoing>) -> Vec<Vec<u8>> {
    let of = |content| match content {
        Content::Message(message) => vec![message.into_bytes()],
        Content::Fragments { route, change, numbers } => {
            numbers.into_iter().map(|number| route.fragment(&change, number).into_bytes()).collect()
        }
    };
    outgoing.into_iter().flat_map(|outgoing| of(outgoing.content)).collect()
}

struct Link {
    writer: Writer,
    reader: Reader,
    now: Instant,
    fates: Fates,
    received: Vec<(i64, Vec<u8>)>,
}

impl Link {
    fn new(fates: Fates, depth: Option<usize>) -> Self {
        let now = Instant::now();
        let (writer, mut reader) = (Writer::new(WRITER, depth, true), Reader::new(READER, true));
        reader.add_writer(WRITER, vec![ADDRESS], [true, true], now);
        Self { writer, reader, now, fates, received: Vec::new() }
    }

    fn start(&mut self) {
        let outgoing = self.writer.add_reader(READER, vec![ADDRESS], [true, true], self.now);
        self.carry(outgoing);
    }

    fn write(&mut self, payload: Vec<u8>) {
        let (_, outgoing) = self.writer.write(0, [Vec::new(), payload], false, self.now);
        self.carry(outgoing);
    }

    /// Carries what is sent, and what is answered to it, until nothing is sent any more.
    fn carry(&mut self, outgoing: Vec<Outgoing>) {
        let mut waiting = datagrams(outgoing);
        while !waiting.is_empty() {
            let mut arriving = Vec::new();
            let mut late = Vec::new();
            for datagram in waiting {
                match self.fates.next() {
                    Fate::Comes => arriving.push(datagram),
                    Fate::IsLost => {}
                    Fate::ComesTwice => arriving.extend([datagram.clone(), datagram]),
                    Fate::ComesLater => {
                        late.push(datagram);
                        continue;
                    }
                }
                arriving.append(&mut late);
            }
            arriving.append(&mut late);
            waiting = arriving.iter().flat_map(|datagram| datagrams(self.take(datagram))).collect();
        }
    }

    fn take(&mut self, datagram: &[u8]) -> Vec<Outgoing> {
        let mut outgoing = Vec::new();
        for part in submessages(datagram) {
            match &part.body {
                Body::AckNack { missing, count, is_final } => {
                    outgoing.extend(self.writer.take_acknack(READER, missing, *count, *is_final, self.now));
                }
                Body::NackFragments { sequence, missing, count } => {
                    outgoing.extend(self.writer.take_nack_fragments(READER, *sequence, missing, *count, self.now));
                }
                _ => {
                    let (samples, answer) = self.reader.take(&part, self.now);
                    self.received.extend(samples.into_iter().map(|sample| (sample.sequence, sample.payload)));
                    outgoing.extend(answer);
                }
            }
        }
        outgoing
    }

    /// Lets time pass, until all is acknowledged.
    fn settle(&mut self) {
        for _ in 0..10_000 {
            if !self.writer.is_behind() {
                return;
            }
            self.now += Duration::from_millis(50);
            let due = [self.writer.tick(self.now), self.reader.tick(self.now)];
            self.carry(due.into_iter().flatten().collect());
        }
        panic!("not all is acknowledged: {:?}", self.writer);
    }
}

/// The first and the last sample that are there by heartbeats, which are all that is sent.
#[track_caller]
fn heartbeats(outgoing: impl IntoIterator<Item = Outgoing>) -> Vec<[i64; 2]> {
    let datagrams = datagrams(outgoing.into_iter().collect());
    let range = |body: &Body<'_>| match body {
        Body::Heartbeat { first, last, .. } => [*first, *last],
        other => panic!("{other:?}"),
    };
    datagrams
        .iter()
        .flat_map(|bytes| submessages(bytes).iter().map(|part| range(&part.body)).collect::<Vec<_>>())
        .collect()
}

#[test]
fn a_reader_that_is_not_served_is_told_that_there_is_nothing_once_it_asks() {
    let (mut writer, now) = (Writer::new(WRITER, Some(1), true), Instant::now());
    let write = |writer: &mut Writer| writer.write(0, [Vec::new(), payload(1, 9)], false, now).1;
    write(&mut writer);
    assert_eq!(heartbeats(writer.add_unserved_reader(READER, vec![ADDRESS])), [[2, 1]]);
    let first_question = NumberSet::new(0, []);
    assert_eq!(heartbeats(writer.take_acknack(READER, &first_question, 1, false, now)), [[2, 1]]);
    assert_eq!(
        heartbeats(writer.take_acknack(READER, &NumberSet::new(2, []), 2, false, now)),
        <[[i64; 2]; 0]>::default()
    );
    assert_eq!(datagrams(write(&mut writer)).len(), 0);
    assert!(!writer.is_behind() && writer.tick(now + Duration::from_secs(9)).is_empty());
    writer.remove_participant(READER.prefix);
    assert_eq!(datagrams(writer.take_acknack(READER, &first_question, 3, false, now)).len(), 0);
}

/// A sample of so many bytes, with its number in them. Its size needs no padding.
fn payload(number: usize, size: usize) -> Vec<u8> {
    (0..size * 4).map(|at| (at * 7 + number) as u8).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn all_samples_come_once_and_in_their_order(
        seed in any::<u64>(),
        sizes in prop::collection::vec(prop_oneof![1_usize..50, 5_000_usize..20_000], 1..8),
    ) {
        let mut link = Link::new(Fates(seed), None);
        let payloads: Vec<Vec<u8>> = sizes.iter().enumerate().map(|(number, size)| payload(number, *size)).collect();
        // The reader comes in the middle, and gets what was kept.
        for (number, payload) in payloads.iter().enumerate() {
            if number == payloads.len() / 2 {
                link.start();
            }
            link.write(payload.clone());
        }
        link.settle();
        let expected: Vec<(i64, Vec<u8>)> = (1..).zip(payloads).collect();
        prop_assert!(link.received == expected, "{:?}", link.received.iter().map(|(number, _)| number).collect::<Vec<_>>());
    }

    #[test]
    fn of_a_writer_that_keeps_one_the_last_comes_whatever_was_lost(seed in any::<u64>(), count in 1_usize..20) {
        let mut link = Link::new(Fates(seed), Some(1));
        link.start();
        (0..count).for_each(|number| link.write(payload(number, 3000)));
        link.settle();
        let numbers: Vec<i64> = link.received.iter().map(|(number, _)| *number).collect();
        prop_assert_eq!(numbers.last(), Some(&(count as i64)));
        prop_assert!(numbers.is_sorted_by(|a, b| a < b), "{numbers:?}");
        prop_assert_eq!(&link.received.last().unwrap().1, &payload(count - 1, 3000));
    }
}
