//! The observing end of a link.

use super::repeats::{Repeat, Repeats};
use super::sample_tracker::SampleTracker;
use super::service::{MAX_OBSERVERS, OBSERVER_BUFFER};
use super::{LinkError, RunNames, SampleHeader, unpack};
use crate::message::{Message, MessageFlags, Storage};
use iceoryx2::node::Node;
use iceoryx2::port::subscriber::{Subscriber, SubscriberCreateError};
use iceoryx2::service::Service;
use iceoryx2::service::builder::publish_subscribe::PublishSubscribeOpenError as E;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use std::collections::BTreeMap;
use std::rc::Rc;

/// An observer of a link of a replay or a live run. It never affects the run: if it is too slow, it misses messages.
pub struct Observer<S: Service> {
    subscriber: Subscriber<S, [u8], SampleHeader>,
    trackers: BTreeMap<u64, SampleTracker>,
    name: String,
}

impl<S: Service + 'static> Observer<S> {
    /// Observes the link `STAGE.PORT` of a run; none if the link does not exist (yet).
    ///
    /// # Errors
    /// The link has the maximum number of observers, or iceoryx2 fails.
    pub fn new(node: &Node<S>, names: &RunNames, stage: &str, port: &str) -> Result<Option<Self>, LinkError> {
        let name = format!("{stage}.{port}");
        let failed = |cause: &dyn std::fmt::Debug| LinkError::shared(format!("observe {name}"))(cause);
        let service = node
            .service_builder(&names.link(stage, port)?)
            .publish_subscribe::<[u8]>()
            .user_header::<SampleHeader>()
            .open();
        let service = match service {
            // It may be under construction.
            Err(E::DoesNotExist | E::ServiceInCorruptedState | E::HangsInCreation | E::IsMarkedForDestruction) => {
                return Ok(None);
            }
            other => other.map_err(|e| failed(&e))?,
        };
        let buffer = OBSERVER_BUFFER.min(service_buffer(&service));
        let subscriber = service.subscriber_builder().buffer_size(buffer).create().map_err(|e| match e {
            SubscriberCreateError::ExceedsMaxSupportedSubscribers => {
                LinkError::Crowded { doing: "observe".into(), link: name.clone(), most: MAX_OBSERVERS }
            }
            other => failed(&other),
        })?;
        Ok(Some(Self { subscriber, trackers: BTreeMap::new(), name }))
    }

    /// Takes the messages since the last call, without duplicates, each with the header of its sample. Watermarks and
    /// ends are omitted.
    pub fn take(&mut self, mut take: impl FnMut(&SampleHeader, Message)) -> Result<(), LinkError> {
        let failed = |cause: &dyn std::fmt::Debug| LinkError::shared(format!("receive from {}", self.name))(cause);
        let mut repeats = Repeats::default();
        while let Some(sample) = self.subscriber.receive().map_err(|e| failed(&e))? {
            let header = *sample.user_header();
            // A copy: an observer must not borrow samples that the senders of the run need.
            let bytes: Rc<dyn Storage> = Rc::new(sample.payload().to_vec());
            drop(sample);
            if header.message.flags.contains(MessageFlags::REPEATED) {
                repeats.push((header, bytes));
                continue;
            }
            for repeat in repeats.before(&header) {
                unpack_new(&mut self.trackers, repeat, &self.name, &mut take)?;
            }
            unpack_new(&mut self.trackers, (header, bytes), &self.name, &mut take)?;
        }
        repeats
            .take_all()
            .into_iter()
            .try_for_each(|repeat| unpack_new(&mut self.trackers, repeat, &self.name, &mut take))
    }
}

/// Takes the messages of a sample, unless it is a duplicate.
fn unpack_new(
    trackers: &mut BTreeMap<u64, SampleTracker>,
    (header, bytes): Repeat,
    link: &str,
    take: &mut impl FnMut(&SampleHeader, Message),
) -> Result<(), LinkError> {
    let is_repeated = header.message.flags.contains(MessageFlags::REPEATED);
    if !trackers.entry(header.origin).or_insert_with(|| SampleTracker::new(false)).record(header.number, is_repeated).0
    {
        return Ok(());
    }
    unpack(&header, bytes, link, |message| {
        let flags = message.header().flags;
        let is_mark = flags.contains(MessageFlags::WATERMARK) || flags.contains(MessageFlags::END);
        if !is_mark {
            take(&header, message);
        }
    })
}

fn service_buffer<S: Service>(service: &PortFactory<S, [u8], SampleHeader>) -> usize {
    use iceoryx2::service::port_factory::PortFactory as _;
    service.static_config().subscriber_max_buffer_size()
}
