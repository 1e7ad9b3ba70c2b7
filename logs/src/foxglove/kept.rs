//! The last message of each latched topic, for those who subscribe later.

use crate::tf::is_static;
use foxglove::websocket::{ChannelView, Client, ServerListener};
use foxglove::{ChannelId, PartialMetadata, RawChannel, SinkId};
use gridweave_runtime::ros::{RosMessage, TFMessage, TransformStamped, decode, encode};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// What was sent last on the latched channels.
///
/// It is locked while a message is sent, too: otherwise somebody who subscribes meanwhile could get an older message after a
/// newer one.
#[derive(Clone, Default)]
pub(super) struct KeptMessages(Arc<Mutex<Vec<Kept>>>);

/// What was sent last on one channel.
struct Kept {
    channel: Arc<RawChannel>,
    log_time: u64,
    what: What,
}

enum What {
    /// The last message counts.
    Message(Vec<u8>),
    /// Each message has some of them: by the frame that they tie.
    Transforms(BTreeMap<String, TransformStamped>),
}

impl KeptMessages {
    /// Sends a message to all who have subscribed to its channel, and keeps it if that is latched.
    pub(super) fn send(&self, channel: &Arc<RawChannel>, is_latched: bool, log_time: u64, message: &[u8]) {
        let mut kept = self.lock();
        if is_latched {
            let place = kept.iter().position(|kept| kept.channel.id() == channel.id()).unwrap_or_else(|| {
                kept.push(Kept { channel: Arc::clone(channel), log_time, what: What::Message(Vec::new()) });
                kept.len() - 1
            });
            kept[place].keep(log_time, message);
        }
        channel.log_with_meta(message, PartialMetadata::with_log_time(log_time));
    }

    /// Sends what is kept of a channel to one who has just subscribed to it.
    fn send_to(&self, subscriber: Option<SinkId>, channel: ChannelId) {
        if let Some(kept) = self.lock().iter().find(|kept| kept.channel.id() == channel) {
            kept.send_to(subscriber);
        }
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Kept>> {
        // What is kept is whole between any two of its changes.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Kept {
    fn keep(&mut self, log_time: u64, message: &[u8]) {
        self.log_time = log_time;
        let is_transforms = self.channel.schema().is_some_and(|schema| schema.name == TFMessage::NAME);
        let transforms = (is_transforms && is_static(self.channel.topic())).then(|| decode::<TFMessage>(message).ok());
        match (transforms.flatten(), &mut self.what) {
            (Some(more), What::Transforms(kept)) => kept.extend(by_frame(more)),
            (Some(first), what) => *what = What::Transforms(by_frame(first).collect()),
            (None, What::Message(kept)) => {
                kept.clear();
                kept.extend_from_slice(message);
            }
            // Transforms that cannot be read tell nobody anything.
            (None, What::Transforms(_)) => {}
        }
    }

    fn send_to(&self, subscriber: Option<SinkId>) {
        let metadata = PartialMetadata::with_log_time(self.log_time);
        match &self.what {
            What::Message(message) => self.channel.log_with_meta_to_sink(message, metadata, subscriber),
            What::Transforms(kept) => {
                if let Ok(message) = encode(&TFMessage { transforms: kept.values().cloned().collect() }) {
                    self.channel.log_with_meta_to_sink(&message, metadata, subscriber);
                }
            }
        }
    }
}

fn by_frame(message: TFMessage) -> impl Iterator<Item = (String, TransformStamped)> {
    message.transforms.into_iter().map(|transform| (transform.child_frame_id.clone(), transform))
}

impl ServerListener for KeptMessages {
    fn on_subscribe(&self, client: Client, channel: ChannelView<'_>) {
        self.send_to(client.sink_id(), channel.id());
    }
}
