//! The service of a link, as those who look on, and live links, open it.

use crate::link::board::{MAX_SENDERS, StageBoard};
use crate::link::shared::{LinkError, RunNames, SampleHeader};
use crate::message::{Message, MessageFlags};
use crate::pipeline::Overflow;
use iceoryx2::node::Node;
use iceoryx2::port::subscriber::{Subscriber, SubscriberCreateError};
use iceoryx2::service::Service;
use iceoryx2::service::builder::publish_subscribe::PublishSubscribeOpenError as E;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use std::rc::Rc;

/// How many programs may look on at a link.
pub(crate) const MAX_OBSERVERS: usize = 4;
/// How many samples wait for one that looks on.
pub(crate) const OBSERVER_BUFFER: usize = 64;
/// How many samples wait for the owner of a live link, which keeps the last of them.
pub(super) const KEEPER_BUFFER: usize = 128;
/// How many samples may be held by a reader of a live link beside those that wait; what comes on top of that is copied.
pub(super) const HELD_SAMPLES: usize = 24;
/// What a reader of a live link has room for beyond its depth: for what is repeated.
pub(super) const REPEAT_ROOM: usize = 48;

/// What all ends of a live link must agree on.
#[derive(Clone, Debug)]
pub struct LinkShape<'a> {
    /// The owner.
    pub stage: &'a str,
    /// Its output port.
    pub port: &'a str,
    /// How many stages read it.
    pub readers: usize,
    /// The largest of their depths.
    pub depth: usize,
    /// What becomes of a message for which there is no room.
    pub overflow: Overflow,
}

/// An output port on the board.
pub struct PortBoard {
    /// That of the stage.
    pub board: StageBoard,
    /// The port.
    pub port: usize,
}

impl LinkShape<'_> {
    /// STAGE.PORT
    pub fn name(&self) -> String {
        format!("{}.{}", self.stage, self.port)
    }

    pub(super) fn open<S: Service>(
        &self,
        node: &Node<S>,
        names: &RunNames,
    ) -> Result<PortFactory<S, [u8], SampleHeader>, LinkError> {
        let failed = |cause: &dyn std::fmt::Debug| LinkError::shared(format!("open the link {}", self.name()))(cause);
        let subscribers = self.readers + MAX_OBSERVERS + 1;
        // Aligned as the user header is, like all links.
        node.service_builder(&names.link(self.stage, self.port)?)
            .publish_subscribe::<[u8]>()
            .user_header::<SampleHeader>()
            .enable_safe_overflow(self.overflow == Overflow::DropOldest)
            .history_size(0)
            .subscriber_max_buffer_size((self.depth + REPEAT_ROOM).max(KEEPER_BUFFER))
            .subscriber_max_borrowed_samples(HELD_SAMPLES)
            .max_publishers(MAX_SENDERS)
            .max_subscribers(subscribers)
            .max_nodes(subscribers + MAX_SENDERS + 1)
            .open_or_create()
            .map_err(|e| failed(&e))
    }
}

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
            crate::link::shared::unpack(&header, bytes, &self.name, |message| {
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
