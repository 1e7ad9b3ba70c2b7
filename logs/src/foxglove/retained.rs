//! Retained messages: the latest message of each latched topic, for late joiners.

use crate::tf::is_static;
use foxglove::websocket::{ChannelView, Client, ServerListener};
use foxglove::{ChannelId, PartialMetadata, RawChannel, SinkId};
use gridweave_runtime::ros::{RosMessage, TFMessage, TransformStamped, decode, encode};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The latest messages of the latched channels.
///
/// The lock is also held while a message is sent: otherwise a client that subscribes at that time could get an older
/// message after a newer one.
#[derive(Clone, Default)]
pub(super) struct RetainedMessages(Arc<Mutex<Vec<Retained>>>);

/// The latest message of one channel.
struct Retained {
    channel: Arc<RawChannel>,
    log_time: u64,
    what: What,
}

enum What {
    /// The latest message replaces the earlier ones.
    Message(Vec<u8>),
    /// Transforms, of which the latest of each child frame is retained.
    Transforms(BTreeMap<String, TransformStamped>),
}

impl RetainedMessages {
    /// Sends a message to all subscribers of its channel, and retains it if the channel is latched.
    pub(super) fn send(&self, channel: &Arc<RawChannel>, is_latched: bool, log_time: u64, message: &[u8]) {
        let mut retained = self.lock();
        if is_latched {
            let place =
                retained.iter().position(|retained| retained.channel.id() == channel.id()).unwrap_or_else(|| {
                    retained.push(Retained { channel: Arc::clone(channel), log_time, what: What::Message(Vec::new()) });
                    retained.len() - 1
                });
            retained[place].keep(log_time, message);
        }
        channel.log_with_meta(message, PartialMetadata::with_log_time(log_time));
    }

    /// Sends the retained messages of a channel to a client that has just subscribed.
    fn send_to(&self, subscriber: Option<SinkId>, channel: ChannelId) {
        if let Some(retained) = self.lock().iter().find(|retained| retained.channel.id() == channel) {
            retained.send_to(subscriber);
        }
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Retained>> {
        // The retained messages are consistent between any two changes.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Retained {
    fn keep(&mut self, log_time: u64, message: &[u8]) {
        self.log_time = log_time;
        let is_transforms = self.channel.schema().is_some_and(|schema| schema.name == TFMessage::NAME);
        let transforms = (is_transforms && is_static(self.channel.topic())).then(|| decode::<TFMessage>(message).ok());
        match (transforms.flatten(), &mut self.what) {
            (Some(more), What::Transforms(retained)) => retained.extend(by_frame(more)),
            (Some(first), what) => *what = What::Transforms(by_frame(first).collect()),
            (None, What::Message(retained)) => {
                retained.clear();
                retained.extend_from_slice(message);
            }
            // Transforms that cannot be read are dropped.
            (None, What::Transforms(_)) => {}
        }
    }

    fn send_to(&self, subscriber: Option<SinkId>) {
        let metadata = PartialMetadata::with_log_time(self.log_time);
        match &self.what {
            What::Message(message) => self.channel.log_with_meta_to_sink(message, metadata, subscriber),
            What::Transforms(retained) => {
                if let Ok(message) = encode(&TFMessage { transforms: retained.values().cloned().collect() }) {
                    self.channel.log_with_meta_to_sink(&message, metadata, subscriber);
                }
            }
        }
    }
}

fn by_frame(message: TFMessage) -> impl Iterator<Item = (String, TransformStamped)> {
    message.transforms.into_iter().map(|transform| (transform.child_frame_id.clone(), transform))
}

impl ServerListener for RetainedMessages {
    fn on_subscribe(&self, client: Client, channel: ChannelView<'_>) {
        self.send_to(client.sink_id(), channel.id());
    }
}
