//! The last message of each topic of a live link, for readers that come late.

use super::held::HeldSamples;
use super::service::{KEEPER_BUFFER, KEEPER_HELD};
use super::{LinkError, SampleHeader};
use crate::message::{FixedText, MessageFlags, MessageHeader, Storage};
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::service::Service;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use std::collections::BTreeMap;
use std::rc::Rc;

/// The most topics of which the last message is kept. What is beyond is not repeated, and that is told. Every reader has room for
/// all that is repeated, which is memory that is set aside for the largest message of the link.
pub(super) const MAX_TOPICS: usize = 40;
/// Messages up to this size are copied, larger ones held where they are.
const LARGEST_COPIED: usize = 16 * 1024;

/// What tells messages apart of which each is kept: announcements of channels, and the topics of messages.
type Topic = (bool, u32, FixedText<128>);

/// One message that is kept.
struct Last {
    topic: Topic,
    header: SampleHeader,
    bytes: Bytes,
}

enum Bytes {
    Copied(Vec<u8>),
    Held(Rc<dyn Storage>),
}

/// The last message of each topic.
pub(super) struct Kept<S: Service> {
    service: PortFactory<S, [u8], SampleHeader>,
    /// Takes in what the owner cannot copy as it sends it: what is large, and what others send.
    subscriber: Option<Subscriber<S, [u8], SampleHeader>>,
    held: HeldSamples,
    messages: Vec<Last>,
    /// The place of the message that was put in last. The next is often of the same topic.
    recent: usize,
    /// Of each other sender the number of its next sample.
    next: BTreeMap<u64, u64>,
    /// Whether the owner was not started again: all that was sent is still to come.
    is_first: bool,
    /// Whether there were more topics than are kept.
    has_more: bool,
    origin: u64,
    link: String,
}

impl<S: Service + 'static> Kept<S> {
    /// Nothing is kept yet by the owner, who sends as `origin`.
    pub(super) fn new(service: PortFactory<S, [u8], SampleHeader>, link: &str, origin: u64, is_first: bool) -> Self {
        Self {
            service,
            subscriber: None,
            held: HeldSamples::default(),
            messages: Vec::new(),
            recent: 0,
            next: BTreeMap::new(),
            is_first,
            has_more: false,
            origin,
            link: link.to_owned(),
        }
    }

    /// From here on takes in what is sent as well, and not only what it is shown.
    pub(super) fn listen(&mut self) -> Result<(), LinkError> {
        if self.subscriber.is_none() {
            let subscriber = self.service.subscriber_builder().buffer_size(KEEPER_BUFFER).create();
            let subscriber = subscriber.map_err(|e| self.failed(&e))?;
            subscriber.update_connections().map_err(|e| self.failed(&e))?;
            self.subscriber = Some(subscriber);
        }
        Ok(())
    }

    /// Is shown a message before the owner sends it.
    pub(super) fn show(&mut self, header: &SampleHeader, bytes: &[u8]) -> Result<(), LinkError> {
        if !is_kept(&header.message) {
            return Ok(());
        }
        if bytes.len() > LARGEST_COPIED {
            return self.listen();
        }
        let topic = topic(&header.message);
        let Some(place) = self.place(&topic) else { return Ok(()) };
        match self.messages.get_mut(place) {
            Some(Last { header: last, bytes: Bytes::Copied(copy), .. }) => {
                *last = *header;
                copy.clear();
                copy.extend_from_slice(bytes);
            }
            _ => self.put(place, Last { topic, header: *header, bytes: Bytes::Copied(bytes.to_vec()) }),
        }
        Ok(())
    }

    /// Takes in what it was not shown. Gives how many messages others have sent since the last call.
    pub(super) fn update(&mut self) -> Result<u64, LinkError> {
        let mut count = 0;
        while let Some(sample) = self.receive()? {
            let header = *sample.user_header();
            if !is_kept(&header.message) || header.message.flags.contains(MessageFlags::REPEATED) {
                continue;
            }
            let is_own = header.origin == self.origin;
            let is_large = sample.payload().len() > LARGEST_COPIED;
            if !is_own {
                // Others may send faster than this is called: what was missed is counted as well.
                let first = if self.is_first { 0 } else { header.number };
                let next = self.next.insert(header.origin, header.number.saturating_add(1)).unwrap_or(first);
                let is_data = header.message.flags.contains(MessageFlags::DATA);
                count += header.number.saturating_sub(next) + u64::from(is_data);
            }
            let topic = topic(&header.message);
            if let Some(place) = self.place(&topic).filter(|_| is_large || !is_own) {
                let bytes = match is_large {
                    true => Bytes::Held(self.held.hold(sample, KEEPER_HELD)),
                    false => Bytes::Copied(sample.payload().to_vec()),
                };
                self.put(place, Last { topic, header, bytes });
            }
        }
        Ok(count)
    }

    /// Whether there is something to take in.
    pub(super) fn has_news(&self) -> Result<bool, LinkError> {
        let Some(subscriber) = &self.subscriber else { return Ok(false) };
        subscriber.has_samples().map_err(|e| self.failed(&e))
    }

    /// All that is kept: announcements first, then by the numbers that they had.
    pub(super) fn messages(&self) -> impl Iterator<Item = (&SampleHeader, &[u8])> {
        let mut messages: Vec<&Last> = self.messages.iter().collect();
        messages.sort_by_key(|last| (last.topic.0, last.header.origin, last.header.number));
        messages.into_iter().filter_map(|last| {
            let bytes = match &last.bytes {
                Bytes::Copied(bytes) => bytes.as_slice(),
                Bytes::Held(storage) => storage.bytes(),
            };
            // A program of another may say a length that its sample does not have.
            Some((&last.header, bytes.get(..last.header.message.length as usize)?))
        })
    }

    /// Where the message of a topic is kept, or would be; none if there are too many.
    fn place(&mut self, topic: &Topic) -> Option<usize> {
        if self.messages.get(self.recent).is_none_or(|last| last.topic != *topic) {
            let found = self.messages.iter().position(|last| last.topic == *topic);
            let place = found.or((self.messages.len() < MAX_TOPICS).then_some(self.messages.len()));
            if place.is_none() && !std::mem::replace(&mut self.has_more, true) {
                tracing::warn!(
                    "{} has more than {MAX_TOPICS} topics and channels: who reads it late, such as a stage that is started again, \
                     gets the last message of the first {MAX_TOPICS} alone",
                    self.link
                );
            }
            self.recent = place?;
        }
        Some(self.recent)
    }

    fn put(&mut self, place: usize, last: Last) {
        match self.messages.get_mut(place) {
            Some(old) => *old = last,
            None => self.messages.push(last),
        }
    }

    fn receive(&self) -> Result<Option<iceoryx2::sample::Sample<S, [u8], SampleHeader>>, LinkError> {
        let Some(subscriber) = &self.subscriber else { return Ok(None) };
        subscriber.receive().map_err(|e| self.failed(&e))
    }

    fn failed(&self, cause: &dyn std::fmt::Debug) -> LinkError {
        LinkError::shared(format!("keep the last messages of {}", self.link))(cause)
    }
}

/// Whether it is one of those that are sent again.
fn is_kept(message: &MessageHeader) -> bool {
    message.flags.contains(MessageFlags::DATA) || message.flags.contains(MessageFlags::CHANNEL)
}

fn topic(message: &MessageHeader) -> Topic {
    (!message.flags.contains(MessageFlags::CHANNEL), message.channel, message.topic)
}
