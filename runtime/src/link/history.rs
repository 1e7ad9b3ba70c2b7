//! The history of a live link for late joiners: the last message of each topic.

use super::borrowed_samples::BorrowedSamples;
use super::service::{HISTORY_BORROWED, HISTORY_BUFFER, MAX_TOPICS};
use super::{LinkError, SampleHeader};
use crate::message::{FixedText, MessageFlags, MessageHeader, Storage};
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::service::Service;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use std::collections::BTreeMap;
use std::rc::Rc;

/// Messages up to this size, bytes, are copied; larger ones are borrowed.
const LARGEST_COPIED: usize = 16 * 1024;

/// The key of an entry: whether it is a message (and not the announcement of a channel), the channel, and the topic.
type Topic = (bool, u32, FixedText<128>);

/// A retained message.
struct Entry {
    topic: Topic,
    header: SampleHeader,
    bytes: Bytes,
}

enum Bytes {
    Copied(Vec<u8>),
    Borrowed(Rc<dyn Storage>),
}

/// The last message of each topic of a live link, retained by its owner.
pub(super) struct History<S: Service> {
    service: PortFactory<S, [u8], SampleHeader>,
    /// Receives the messages that the owner does not copy while sending: large ones, and those of other senders.
    subscriber: Option<Subscriber<S, [u8], SampleHeader>>,
    borrowed: BorrowedSamples,
    messages: Vec<Entry>,
    /// The index of the entry that was updated last: the next message often has the same topic.
    recent: usize,
    /// The expected number of the next sample of each other sender.
    next: BTreeMap<u64, u64>,
    /// Whether the owner was never restarted: every sample of other senders is counted from its first one.
    is_first: bool,
    /// Whether there were more than [`MAX_TOPICS`] topics.
    is_over_limit: bool,
    origin: u64,
    link: String,
}

impl<S: Service + 'static> History<S> {
    /// An empty history of the owner, which sends as `origin`.
    pub(super) fn new(service: PortFactory<S, [u8], SampleHeader>, link: &str, origin: u64, is_first: bool) -> Self {
        Self {
            service,
            subscriber: None,
            borrowed: BorrowedSamples::default(),
            messages: Vec::new(),
            recent: 0,
            next: BTreeMap::new(),
            is_first,
            is_over_limit: false,
            origin,
            link: link.to_owned(),
        }
    }

    /// Subscribes to the link, to receive what is not passed to [`record`](Self::record).
    pub(super) fn subscribe(&mut self) -> Result<(), LinkError> {
        if self.subscriber.is_none() {
            let subscriber = self.service.subscriber_builder().buffer_size(HISTORY_BUFFER).create();
            let subscriber = subscriber.map_err(|e| self.failed(&e))?;
            subscriber.update_connections().map_err(|e| self.failed(&e))?;
            self.subscriber = Some(subscriber);
        }
        Ok(())
    }

    /// Records a message that the owner is about to send. A large one is received through the subscription instead.
    pub(super) fn record(&mut self, header: &SampleHeader, bytes: &[u8]) -> Result<(), LinkError> {
        if !is_recorded(&header.message) {
            return Ok(());
        }
        if bytes.len() > LARGEST_COPIED {
            return self.subscribe();
        }
        let topic = topic(&header.message);
        let Some(slot) = self.slot(&topic) else { return Ok(()) };
        match self.messages.get_mut(slot) {
            Some(Entry { header: last, bytes: Bytes::Copied(copy), .. }) => {
                *last = *header;
                copy.clear();
                copy.extend_from_slice(bytes);
            }
            _ => self.put(slot, Entry { topic, header: *header, bytes: Bytes::Copied(bytes.to_vec()) }),
        }
        Ok(())
    }

    /// Receives the messages that were not recorded. Returns how many messages others have sent since the last call.
    pub(super) fn ingest(&mut self) -> Result<u64, LinkError> {
        let mut count = 0;
        while let Some(sample) = self.receive()? {
            let header = *sample.user_header();
            if !is_recorded(&header.message) || header.message.flags.contains(MessageFlags::REPEATED) {
                continue;
            }
            let is_own = header.origin == self.origin;
            let is_large = sample.payload().len() > LARGEST_COPIED;
            if !is_own {
                // Others may send faster than this is called: missed messages are counted too.
                let first = if self.is_first { 0 } else { header.number };
                let next = self.next.insert(header.origin, header.number.saturating_add(1)).unwrap_or(first);
                let is_data = header.message.flags.contains(MessageFlags::DATA);
                count += header.number.saturating_sub(next) + u64::from(is_data);
            }
            let topic = topic(&header.message);
            if let Some(slot) = self.slot(&topic).filter(|_| is_large || !is_own) {
                let bytes = match is_large {
                    true => Bytes::Borrowed(self.borrowed.borrow(sample, HISTORY_BORROWED)),
                    false => Bytes::Copied(sample.payload().to_vec()),
                };
                self.put(slot, Entry { topic, header, bytes });
            }
        }
        Ok(count)
    }

    /// Whether there is something to ingest.
    pub(super) fn has_pending(&self) -> Result<bool, LinkError> {
        let Some(subscriber) = &self.subscriber else { return Ok(false) };
        subscriber.has_samples().map_err(|e| self.failed(&e))
    }

    /// All entries: announcements first, then by origin and number.
    pub(super) fn messages(&self) -> impl Iterator<Item = (&SampleHeader, &[u8])> {
        let mut messages: Vec<&Entry> = self.messages.iter().collect();
        messages.sort_by_key(|last| (last.topic.0, last.header.origin, last.header.number));
        messages.into_iter().filter_map(|last| {
            let bytes = match &last.bytes {
                Bytes::Copied(bytes) => bytes.as_slice(),
                Bytes::Borrowed(storage) => storage.bytes(),
            };
            // The length of another program's message may be larger than its sample.
            Some((&last.header, bytes.get(..last.header.message.length as usize)?))
        })
    }

    /// The index of the entry of a topic, existing or to be added; none if there are too many topics.
    fn slot(&mut self, topic: &Topic) -> Option<usize> {
        if self.messages.get(self.recent).is_none_or(|last| last.topic != *topic) {
            let found = self.messages.iter().position(|last| last.topic == *topic);
            let slot = found.or((self.messages.len() < MAX_TOPICS).then_some(self.messages.len()));
            if slot.is_none() && !std::mem::replace(&mut self.is_over_limit, true) {
                tracing::warn!(
                    "{} has more than {MAX_TOPICS} topics and channels: a late joiner, such as a restarted stage, gets the last \
                     message of the first {MAX_TOPICS} only",
                    self.link
                );
            }
            self.recent = slot?;
        }
        Some(self.recent)
    }

    fn put(&mut self, slot: usize, last: Entry) {
        match self.messages.get_mut(slot) {
            Some(old) => *old = last,
            None => self.messages.push(last),
        }
    }

    fn receive(&self) -> Result<Option<iceoryx2::sample::Sample<S, [u8], SampleHeader>>, LinkError> {
        let Some(subscriber) = &self.subscriber else { return Ok(None) };
        subscriber.receive().map_err(|e| self.failed(&e))
    }

    fn failed(&self, cause: &dyn std::fmt::Debug) -> LinkError {
        LinkError::shared(format!("retain the last messages of {}", self.link))(cause)
    }
}

/// Whether a message is repeated to late joiners.
fn is_recorded(message: &MessageHeader) -> bool {
    message.flags.contains(MessageFlags::DATA) || message.flags.contains(MessageFlags::CHANNEL)
}

fn topic(message: &MessageHeader) -> Topic {
    (!message.flags.contains(MessageFlags::CHANNEL), message.channel, message.topic)
}
