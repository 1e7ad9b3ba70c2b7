//! A message as a stage is given it.

use crate::message::{LogTime, Message};
use crate::ros::RosMessage;
use std::ops::Deref;

/// A message that has come in on a port of type `T`, decoded. It stands for its content, and borrows what that can borrow,
/// such as the cells of a map, from the memory that the message came in.
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

    /// When it was logged.
    pub fn log_time(&self) -> LogTime {
        self.message.header().log_time
    }

    /// Which of the stage's wires it came on, as an index into [`Context::inputs`](super::Context::inputs).
    pub fn wire(&self) -> usize {
        self.message.wire()
    }

    /// The message as it came. A clone of it keeps the bytes where they are, without copying them.
    pub fn message(&self) -> &'a Message {
        self.message
    }

    /// What the message says.
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
