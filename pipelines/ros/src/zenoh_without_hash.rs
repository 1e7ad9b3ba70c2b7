//! Publishing over Zenoh to nodes of Humble, whose types have no hash: the topic has another key there.
//!
//! Whoever hears a topic with any hash would get all twice. So nothing is sent until such a subscriber is there.

use super::key_expression::{NO_HASH, Topic};
use super::liveliness::Entity;
use std::sync::{Arc, Mutex, PoisonError};
use zenoh::bytes::ZBytes;
use zenoh::pubsub::Subscriber;
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait};
use zenoh_ext::AdvancedPublisher;

/// A publisher of a topic for subscribers that state no hash, until it is dropped.
pub(crate) struct PublisherWithoutHash {
    shared: Arc<Shared>,
    _subscribers: Subscriber<()>,
}

struct Shared {
    publisher: AdvancedPublisher<'static>,
    is_latched: bool,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    has_subscribers: bool,
    /// The last message, with its attachment, if late joiners get it.
    last: Option<[ZBytes; 2]>,
}

/// A topic without a hash of its type.
pub(crate) fn without_hash(topic: &Topic) -> Topic {
    Topic { type_hash: NO_HASH.to_owned(), ..topic.clone() }
}

impl PublisherWithoutHash {
    /// Waits for subscribers of a topic without a hash, to which `publisher` sends.
    ///
    /// # Errors
    /// The session has failed.
    pub(crate) fn new(
        session: &Session,
        domain: u32,
        topic: &Topic,
        is_latched: bool,
        publisher: AdvancedPublisher<'static>,
    ) -> zenoh::Result<Self> {
        let shared = Arc::new(Shared { publisher, is_latched, state: Mutex::default() });
        let to = Arc::clone(&shared);
        let callback = move |sample: Sample| {
            if sample.kind() == SampleKind::Put {
                to.begin();
            }
        };
        let tokens = session.liveliness().declare_subscriber(Entity::subscribers(domain, topic)).history(true);
        Ok(Self { shared, _subscribers: tokens.callback(callback).wait()? })
    }

    /// Publishes a message.
    ///
    /// # Errors
    /// The session has failed.
    pub(crate) fn send(&self, message: [ZBytes; 2]) -> zenoh::Result<()> {
        self.shared.send(message)
    }
}

impl Shared {
    fn send(&self, message: [ZBytes; 2]) -> zenoh::Result<()> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        if self.is_latched {
            state.last = Some(message.clone());
        }
        if state.has_subscribers { self.put(message) } else { Ok(()) }
    }

    /// There is a subscriber. The first one gets the last message; the publisher has it for those that come later.
    fn begin(&self) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let is_first = !std::mem::replace(&mut state.has_subscribers, true);
        if let Some(Err(error)) = state.last.clone().filter(|_| is_first).map(|message| self.put(message)) {
            tracing::warn!("cannot send a message to a node of Humble: {error}");
        }
    }

    fn put(&self, [message, attachment]: [ZBytes; 2]) -> zenoh::Result<()> {
        self.publisher.put(message).attachment(attachment).wait()
    }
}
