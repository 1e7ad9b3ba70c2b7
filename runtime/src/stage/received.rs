//! A received message, decoded.

use crate::message::{LogTime, Message};
use crate::ros::RosMessage;
use std::ops::Deref;

/// A message received on a port of type `T`, decoded. It dereferences to its content, which borrows what it can, such
/// as the cells of a map, from the memory of the message.
pub struct Received<'a, T: RosMessage> {
    message: &'a Message,
    content: T::Borrowed<'a>,
}

impl<'a, T: RosMessage> Received<'a, T> {
    pub(super) fn new(message: &'a Message, content: T::Borrowed<'a>) -> Self {
        Self { message, content }
    }

    /// The robot that the message is about; empty if it is about none in particular.
    pub fn robot(&self) -> &'a str {
        self.message.robot()
    }

    /// The time at which it was logged.
    pub fn log_time(&self) -> LogTime {
        self.message.header().log_time
    }

    /// The wire that it was received on, an index into [`Context::inputs`](super::Context::inputs).
    pub fn wire(&self) -> usize {
        self.message.wire()
    }

    /// The encoded message. Cloning it keeps its memory borrowed, without copying the bytes.
    pub fn message(&self) -> &'a Message {
        self.message
    }

    /// The decoded content.
    pub fn into_content(self) -> T::Borrowed<'a> {
        self.content
    }
}

impl<'a, T: RosMessage> Deref for Received<'a, T> {
    type Target = T::Borrowed<'a>;

    fn deref(&self) -> &Self::Target {
        &self.content
    }
}
