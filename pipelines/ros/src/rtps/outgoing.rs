//! What is to be sent, and the samples that it is made of.

use super::guid::{EntityId, Prefix};
use super::message::Message;
use std::net::SocketAddrV4;
use std::sync::Arc;

/// A sample that is larger is sent in fragments of this size, bytes. What fits into few packets of Ethernet is lost
/// less, and sent again at less cost, than the largest that UDP takes.
pub(crate) const FRAGMENT_SIZE: u16 = 8192;

/// A sample of a writer.
#[derive(Debug)]
pub(crate) struct Change {
    pub(crate) sequence: i64,
    /// When it was published, nanoseconds since the Unix epoch.
    pub(crate) published: i64,
    /// Parameters beside it.
    pub(crate) inline: Vec<u8>,
    /// Whether it is a key alone, of what is no more.
    pub(crate) is_key: bool,
    pub(crate) payload: Vec<u8>,
}

impl Change {
    /// The number of fragments in which it is sent; 0 if it is sent whole.
    pub(crate) fn fragment_count(&self) -> u32 {
        match self.payload.len() > usize::from(FRAGMENT_SIZE) {
            true => u32::try_from(self.payload.len().div_ceil(usize::from(FRAGMENT_SIZE))).unwrap_or(u32::MAX),
            false => 0,
        }
    }
}

/// Something to be sent to some addresses.
#[derive(Debug)]
pub(crate) struct Outgoing {
    pub(crate) to: Vec<SocketAddrV4>,
    pub(crate) content: Content,
}

/// What is to be sent.
#[derive(Debug)]
pub(crate) enum Content {
    Message(Message),
    /// Fragments of a sample, each as a message.
    Fragments {
        route: Route,
        change: Arc<Change>,
        numbers: Vec<u32>,
    },
}

/// From whom something is, and for whom.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Route {
    pub(crate) source: Prefix,
    pub(crate) writer: EntityId,
    /// [`Prefix::UNKNOWN`] for everybody.
    pub(crate) destination: Prefix,
    /// [`EntityId::UNKNOWN`] for all readers of the writer.
    pub(crate) reader: EntityId,
}

impl Route {
    pub(crate) fn message(&self) -> Message {
        let message = Message::new(self.source);
        if self.destination == Prefix::UNKNOWN { message } else { message.to(self.destination) }
    }

    /// A sample, whole or in fragments.
    pub(crate) fn sample(self, change: &Arc<Change>) -> Content {
        match change.fragment_count() {
            0 => Content::Message(self.whole(change)),
            count => Content::Fragments { route: self, change: Arc::clone(change), numbers: (1..=count).collect() },
        }
    }

    fn whole(&self, change: &Change) -> Message {
        let Change { sequence, published, inline, is_key, payload } = change;
        let message = self.message().published(*published);
        message.data(self.reader, self.writer, *sequence, inline, *is_key, payload)
    }

    /// One fragment of a sample.
    pub(crate) fn fragment(&self, change: &Change, number: u32) -> Message {
        let message = self.message().published(change.published);
        message.fragment(self.reader, self.writer, change.sequence, number, FRAGMENT_SIZE, &change.payload)
    }
}
