//! Retained messages: the latest message of each latched topic, for late joiners and for viewers that are behind.

use crate::tf::is_static;
use foxglove::{ChannelId, RawChannel};
use gridweave_runtime::ros::{RosMessage, TFMessage, TransformStamped, decode, encode};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The latest messages of the latched channels.
#[derive(Default)]
pub(super) struct RetainedMessages(Vec<Retained>);

/// The latest message of one channel.
pub(super) struct Retained {
    pub(super) channel: Arc<RawChannel>,
    pub(super) log_time: u64,
    what: What,
}

enum What {
    /// The latest message replaces the earlier ones.
    Message(Vec<u8>),
    /// Transforms, of which the latest of each child frame is retained.
    Transforms(BTreeMap<String, TransformStamped>),
}

impl RetainedMessages {
    /// Retains a message.
    pub(super) fn keep(&mut self, channel: &Arc<RawChannel>, log_time: u64, message: &[u8]) {
        let place = self.0.iter().position(|retained| retained.channel.id() == channel.id()).unwrap_or_else(|| {
            self.0.push(Retained { channel: Arc::clone(channel), log_time, what: What::Message(Vec::new()) });
            self.0.len() - 1
        });
        self.0[place].keep(log_time, message);
    }

    /// What is retained of a channel, if it is latched and has had a message.
    pub(super) fn of(&self, channel: ChannelId) -> Option<&Retained> {
        self.0.iter().find(|retained| retained.channel.id() == channel)
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

    /// The message; `None` if it cannot be written.
    pub(super) fn message(&self) -> Option<Cow<'_, [u8]>> {
        match &self.what {
            What::Message(message) => Some(message.into()),
            What::Transforms(retained) => {
                encode(&TFMessage { transforms: retained.values().cloned().collect() }).ok().map(Cow::from)
            }
        }
    }
}

fn by_frame(message: TFMessage) -> impl Iterator<Item = (String, TransformStamped)> {
    message.transforms.into_iter().map(|transform| (transform.child_frame_id.clone(), transform))
}
