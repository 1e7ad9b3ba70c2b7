//! What becomes of a datagram.

use super::discovered::{EndpointData, ParticipantData};
use super::disposal;
use super::guid::{EntityId, Guid, Prefix};
use super::outgoing::Outgoing;
use super::reader::Sample;
use super::state::{Event, State};
use super::submessage::{Body, Submessage, submessages};
use std::net::Ipv4Addr;
use std::time::Instant;

impl State {
    /// Takes a datagram. Gives the participants that were not known before.
    pub(crate) fn take(&mut self, datagram: &[u8], from: Ipv4Addr, now: Instant) -> Vec<Prefix> {
        let mut new = Vec::new();
        for part in submessages(datagram) {
            let is_for_us = part.destination == Prefix::UNKNOWN || part.destination == self.prefix;
            if !is_for_us || part.source == self.prefix {
                continue;
            }
            if let Some(peer) = self.peers.get_mut(&part.source) {
                peer.heard = now;
            }
            match &part.body {
                Body::Data { .. } if part.writer == EntityId::PARTICIPANTS_WRITER => {
                    new.extend(self.take_participant(&part, from, now));
                }
                Body::AckNack { missing, count, is_final } => {
                    let reader = Guid { prefix: part.source, entity: part.reader };
                    if let Some(writer) = self.writers.get_mut(&part.writer) {
                        self.outgoing.extend(writer.take_acknack(reader, missing, *count, *is_final, now));
                    }
                }
                Body::NackFragments { sequence, missing, count } => {
                    let reader = Guid { prefix: part.source, entity: part.reader };
                    if let Some(writer) = self.writers.get_mut(&part.writer) {
                        self.outgoing.extend(writer.take_nack_fragments(reader, *sequence, missing, *count, now));
                    }
                }
                _ => self.take_for_readers(&part, now),
            }
        }
        new
    }

    /// A participant says that it is there, or that it is no more.
    fn take_participant(&mut self, part: &Submessage<'_>, from: Ipv4Addr, now: Instant) -> Option<Prefix> {
        let Body::Data { inline, is_little, payload, .. } = part.body else { return None };
        if let Some(gone) = disposal::subject(inline, is_little, payload) {
            self.remove_peer(gone.prefix);
            return None;
        }
        let data = ParticipantData::read(payload)?;
        let prefix = data.prefix;
        self.note_peer(data, from, now).then_some(prefix)
    }

    fn take_for_readers(&mut self, part: &Submessage<'_>, now: Instant) {
        let readers: Vec<EntityId> = match part.reader {
            EntityId::UNKNOWN => self.readers.keys().copied().collect(),
            one => vec![one],
        };
        for entity in readers {
            let Some(reader) = self.readers.get_mut(&entity) else { continue };
            let (samples, answer): (Vec<Sample>, Option<Outgoing>) = reader.take(part, now);
            self.outgoing.extend(answer);
            for sample in samples {
                match entity {
                    EntityId::PUBLICATIONS_READER => self.take_announcement(&sample, true, now),
                    EntityId::SUBSCRIPTIONS_READER => self.take_announcement(&sample, false, now),
                    _ => self.events.push(Event::Sample(entity, sample)),
                }
            }
        }
    }

    fn take_announcement(&mut self, sample: &Sample, is_writer: bool, now: Instant) {
        if let Some(gone) = disposal::subject(&sample.inline, sample.is_little, &sample.payload) {
            self.remove_endpoint(gone);
        } else if let Some(data) = EndpointData::read(&sample.payload, is_writer) {
            self.note_endpoint(data, now);
        }
    }
}
