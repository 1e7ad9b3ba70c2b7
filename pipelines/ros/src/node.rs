//! A ROS 2 node with its publishers and subscribers, on each middleware that it speaks.

use super::attachment::Attachment;
use super::connection::Connection;
use super::dds_node::{DdsNode, DdsPublisher, DdsSubscriber};
use super::discovery::node_identity::NodeIdentity;
use super::key_expression::Topic;
use super::liveliness::Entity;
use super::middleware::{Middleware, Middlewares};
use super::qos::Qos;
use super::rtps;
use super::zenoh_node::{ZenohNode, ZenohPublisher, ZenohSubscriber};
use gridweave_runtime::stage::StageError;
use std::borrow::Cow;
use std::sync::Arc;

/// A node.
pub(crate) struct Node {
    name: NodeIdentity,
    domain: u32,
    dds: Option<DdsNode>,
    zenoh: Option<ZenohNode>,
}

/// A message as it was received.
pub(crate) enum Received {
    Dds(rtps::Sample),
    Zenoh(zenoh::sample::Sample),
}

/// What is known of a message beside its content.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Sent {
    /// The number that its publisher has given it.
    pub(crate) sequence: u32,
    /// When it was sent, nanoseconds since the Unix epoch.
    pub(crate) time: Option<u64>,
}

impl Received {
    /// The encoded message.
    pub(crate) fn content(&self) -> Cow<'_, [u8]> {
        match self {
            Self::Dds(sample) => Cow::Borrowed(&sample.payload),
            Self::Zenoh(sample) => sample.payload().to_bytes(),
        }
    }

    /// The identifier of its publisher, if it is one of Zenoh. On DDS nothing comes of a run of Gridweave.
    pub(crate) fn zenoh_publisher(&self) -> Option<[u8; 16]> {
        match self {
            Self::Dds(_) => None,
            Self::Zenoh(sample) => Some(Attachment::from_bytes(&sample.attachment()?.to_bytes())?.gid),
        }
    }

    /// What its publisher says of it; `None` if it says nothing.
    pub(crate) fn sent(&self) -> Option<Sent> {
        match self {
            Self::Dds(sample) => {
                let time = sample.published.and_then(|time| u64::try_from(time).ok());
                Some(Sent { sequence: sample.sequence as u32, time })
            }
            Self::Zenoh(sample) => {
                let attachment = Attachment::from_bytes(&sample.attachment()?.to_bytes())?;
                let time = u64::try_from(attachment.source_time).ok();
                Some(Sent { sequence: attachment.sequence as u32, time })
            }
        }
    }
}

impl Node {
    /// Joins the network as a node.
    ///
    /// # Errors
    /// The network cannot be joined. Where either middleware would do, that is only so if neither can.
    pub(crate) fn start(connection: Connection, name: NodeIdentity) -> Result<Self, StageError> {
        let domain = connection.domain()?;
        let middlewares = connection.middleware;
        let dds = match middlewares.has(Middleware::Dds) {
            true => connection.join_dds(domain, &name).map(Some),
            false => Ok(None),
        };
        let dds = match (dds, middlewares) {
            (Err(error), Middlewares::Auto) => {
                tracing::warn!("robots on DDS are not heard: {error}");
                None
            }
            (dds, _) => dds?,
        };
        let zenoh =
            middlewares.has(Middleware::Zenoh).then(|| ZenohNode::start(connection, domain, &name)).transpose()?;
        Ok(Self { name, domain, dds, zenoh })
    }

    /// The names of its session and its participant.
    pub(crate) fn session_names(&self) -> Vec<String> {
        let zenoh = self.zenoh.as_ref().map(|node| node.session_name().to_owned());
        self.dds.as_ref().map(DdsNode::session_name).into_iter().chain(zenoh).collect()
    }

    /// Its name.
    pub(crate) const fn name(&self) -> &NodeIdentity {
        &self.name
    }

    /// Whether it is on DDS.
    pub(crate) const fn has_dds(&self) -> bool {
        self.dds.is_some()
    }

    /// Whether it is on Zenoh.
    pub(crate) const fn has_zenoh(&self) -> bool {
        self.zenoh.is_some()
    }

    /// The addresses of Zenoh's routers, if it is to be on Zenoh and is connected to neither a router nor another
    /// program.
    pub(crate) fn looks_for_router(&self) -> Option<String> {
        self.zenoh.as_ref().and_then(ZenohNode::looks_for_router)
    }

    /// The ROS domain.
    pub(crate) const fn domain(&self) -> u32 {
        self.domain
    }

    /// Calls `call` with every present and future entity of the domain, and again when it disappears.
    ///
    /// # Errors
    /// A session has failed.
    pub(crate) fn watch(
        &self,
        call: impl Fn(Middleware, Entity, bool) + Send + Sync + 'static,
    ) -> Result<(), StageError> {
        let call = Arc::new(call);
        if let Some(node) = &self.dds {
            let call = Arc::clone(&call);
            node.watch(move |entity, is_there| call(Middleware::Dds, entity, is_there));
        }
        match &self.zenoh {
            Some(node) => node.watch(move |entity, is_there| call(Middleware::Zenoh, entity, is_there)),
            None => Ok(()),
        }
    }

    /// Problems with other nodes that have come up since the last call. They were logged already.
    pub(crate) fn take_problems(&self) -> Vec<String> {
        self.dds.as_ref().map(DdsNode::take_problems).unwrap_or_default()
    }

    /// Creates a publisher of a topic.
    ///
    /// # Errors
    /// The topic has an invalid name, or a session has failed.
    pub(crate) fn publish(&mut self, topic: Topic, qos: Qos) -> Result<Publisher, StageError> {
        let dds = self.dds.as_ref().map(|node| node.publish(&topic, qos));
        Ok(Publisher { dds, zenoh: self.zenoh.as_mut().map(|node| node.publish(topic, qos)).transpose()? })
    }

    /// Subscribes to a topic on a middleware: calls `call` with each message, first with those that its publishers have
    /// retained.
    ///
    /// # Errors
    /// The topic has an invalid name, or a session has failed.
    pub(crate) fn subscribe(
        &mut self,
        middleware: Middleware,
        topic: Topic,
        qos: Qos,
        call: impl Fn(Received) + Send + Sync + 'static,
    ) -> Result<Subscriber, StageError> {
        let (dds, zenoh) = match middleware {
            Middleware::Dds => {
                let subscribe = |node: &DdsNode| node.subscribe(&topic, qos, move |sample| call(Received::Dds(sample)));
                (self.dds.as_ref().map(subscribe), None)
            }
            Middleware::Zenoh => {
                let subscribe =
                    |node: &mut ZenohNode| node.subscribe(topic, qos, move |sample| call(Received::Zenoh(sample)));
                (None, self.zenoh.as_mut().map(subscribe).transpose()?)
            }
        };
        Ok(Subscriber { _dds: dds, _zenoh: zenoh })
    }
}

/// A publisher of a topic.
pub(crate) struct Publisher {
    dds: Option<DdsPublisher>,
    zenoh: Option<ZenohPublisher>,
}

impl Publisher {
    /// Publishes an encoded message.
    ///
    /// # Errors
    /// A session has failed.
    pub(crate) fn send(&mut self, message: &[u8]) -> Result<(), StageError> {
        if let Some(publisher) = &self.dds {
            publisher.send(message);
        }
        self.zenoh.as_mut().map_or(Ok(()), |publisher| publisher.send(message))
    }
}

/// A subscriber of a topic, until it is dropped.
pub(crate) struct Subscriber {
    _dds: Option<DdsSubscriber>,
    _zenoh: Option<ZenohSubscriber>,
}
