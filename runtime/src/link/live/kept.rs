//! The last message of each topic of a link, for readers that come late.

use super::service::{HELD_SAMPLES, KEEPER_BUFFER};
use crate::link::shared::{HeldSamples, LinkError, SampleHeader};
use crate::message::{FixedText, MessageFlags, Storage};
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::service::Service;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use std::collections::BTreeMap;
use std::rc::Rc;

/// The most topics of which the last message is kept. What is beyond is not repeated.
const MAX_TOPICS: usize = 40;
/// Messages up to this size are copied, larger ones held where they are.
const LARGEST_COPIED: usize = 16 * 1024;

/// What tells messages apart of which each is kept: announcements of channels, and the topics of messages.
type Topic = (bool, u32, FixedText<128>);

/// The last message of each topic.
pub(super) struct Kept<S: Service> {
    subscriber: Subscriber<S, [u8], SampleHeader>,
    held: HeldSamples,
    messages: BTreeMap<Topic, (SampleHeader, Rc<dyn Storage>)>,
    /// For each sender the number of its next message.
    next: BTreeMap<u64, u64>,
    is_first: bool,
}

impl<S: Service + 'static> Kept<S> {
    /// Nothing is kept yet. `is_first` says that the owner was not started again: all that was sent is still to come.
    pub(super) fn new(
        service: &PortFactory<S, [u8], SampleHeader>,
        link: &str,
        is_first: bool,
    ) -> Result<Self, LinkError> {
        let subscriber = service.subscriber_builder().buffer_size(KEEPER_BUFFER).create();
        let subscriber = subscriber.map_err(|e| LinkError::shared(format!("keep the last messages of {link}"))(&e))?;
        Ok(Self {
            subscriber,
            held: HeldSamples::default(),
            messages: BTreeMap::new(),
            next: BTreeMap::new(),
            is_first,
        })
    }

    /// Takes in what was sent since the last call. Gives how many messages these were.
    pub(super) fn update(&mut self, link: &str) -> Result<u64, LinkError> {
        let mut count = 0;
        let failed =
            |cause: &dyn std::fmt::Debug| LinkError::shared(format!("keep the last messages of {link}"))(cause);
        while let Some(sample) = self.subscriber.receive().map_err(|e| failed(&e))? {
            let header = *sample.user_header();
            let message = header.message;
            let is_channel = message.flags.contains(MessageFlags::CHANNEL);
            if message.flags.contains(MessageFlags::REPEATED)
                || !(is_channel || message.flags.contains(MessageFlags::DATA))
            {
                continue;
            }
            // Others may send faster than this is called: what was missed is counted as well.
            let first = if self.is_first { 0 } else { message.sequence };
            let next = self.next.insert(header.origin, message.sequence.saturating_add(1)).unwrap_or(first);
            count += message.sequence.saturating_sub(next) + u64::from(!is_channel);
            let topic = (!is_channel, message.channel, message.topic);
            if self.messages.len() < MAX_TOPICS || self.messages.contains_key(&topic) {
                let most = if sample.payload().len() > LARGEST_COPIED { HELD_SAMPLES - 2 } else { 0 };
                self.messages.insert(topic, (header, self.held.hold(sample, most)));
            }
        }
        Ok(count)
    }

    /// All that is kept: announcements first, then by the numbers that they had.
    pub(super) fn messages(&self) -> Vec<(SampleHeader, Rc<dyn Storage>)> {
        let mut messages: Vec<_> = self.messages.iter().collect();
        messages.sort_by_key(|((is_data, ..), (header, _))| (*is_data, header.origin, header.message.sequence));
        messages.into_iter().map(|(_, (header, bytes))| (*header, Rc::clone(bytes))).collect()
    }
}
