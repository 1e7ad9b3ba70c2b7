//! The end of a link of one that looks on.

use super::service::{MAX_OBSERVERS, OBSERVER_BUFFER};
use super::{LinkError, RunNames, SampleHeader, unpack};
use crate::message::{Message, MessageFlags};
use iceoryx2::node::Node;
use iceoryx2::port::subscriber::{Subscriber, SubscriberCreateError};
use iceoryx2::service::Service;
use iceoryx2::service::builder::publish_subscribe::PublishSubscribeOpenError as E;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use std::rc::Rc;

/// Looks on at a link, of a replay or a live one, and changes nothing: where it is too slow, it misses messages.
pub struct Observer<S: Service> {
    subscriber: Subscriber<S, [u8], SampleHeader>,
    name: String,
}

impl<S: Service + 'static> Observer<S> {
    /// Looks on at the link `STAGE.PORT` of a run; none if the link is not there, or not yet.
    ///
    /// # Errors
    /// Too many look on.
    pub fn new(node: &Node<S>, names: &RunNames, stage: &str, port: &str) -> Result<Option<Self>, LinkError> {
        let name = format!("{stage}.{port}");
        let failed = |cause: &dyn std::fmt::Debug| LinkError::shared(format!("look on at {name}"))(cause);
        let service = node
            .service_builder(&names.link(stage, port)?)
            .publish_subscribe::<[u8]>()
            .user_header::<SampleHeader>()
            .open();
        let service = match service {
            // It may be in the making.
            Err(E::DoesNotExist | E::ServiceInCorruptedState | E::HangsInCreation | E::IsMarkedForDestruction) => {
                return Ok(None);
            }
            other => other.map_err(|e| failed(&e))?,
        };
        let buffer = OBSERVER_BUFFER.min(service_buffer(&service));
        let subscriber = service.subscriber_builder().buffer_size(buffer).create().map_err(|e| match e {
            SubscriberCreateError::ExceedsMaxSupportedSubscribers => {
                LinkError::Crowded { doing: "look on at".into(), link: name.clone(), most: MAX_OBSERVERS }
            }
            other => failed(&other),
        })?;
        Ok(Some(Self { subscriber, name }))
    }

    /// Takes the messages that have passed since the last call, with the header of the sample that each came in. Marks of
    /// the protocol are left out.
    pub fn take(&self, mut take: impl FnMut(&SampleHeader, Message)) -> Result<(), LinkError> {
        let failed = |cause: &dyn std::fmt::Debug| LinkError::shared(format!("receive from {}", self.name))(cause);
        while let Some(sample) = self.subscriber.receive().map_err(|e| failed(&e))? {
            let header = *sample.user_header();
            // A copy, as one that looks on must not hold what the run's senders need.
            let bytes = Rc::new(sample.payload().to_vec());
            drop(sample);
            unpack(&header, bytes, &self.name, |message| {
                let flags = message.header().flags;
                let is_mark = flags.contains(MessageFlags::WATERMARK) || flags.contains(MessageFlags::END);
                if !is_mark {
                    take(&header, message);
                }
            })?;
        }
        Ok(())
    }
}

fn service_buffer<S: Service>(service: &PortFactory<S, [u8], SampleHeader>) -> usize {
    use iceoryx2::service::port_factory::PortFactory as _;
    service.static_config().subscriber_max_buffer_size()
}
