//! A harness that runs a single stage in tests and benches, and collects the messages that it sends.

use super::{Context, Node, OutputEnd, OutputSink, StageError, StageKind};
use crate::message::{FixedText, LogTime, Message, MessageHeader};
use crate::ros::{RosMessage, encode};
use serde::de::DeserializeOwned;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;

/// A harness that runs a single stage. Ports are given by name.
pub struct StageHarness {
    node: Node,
    kind: StageKind,
    sent: Vec<Rc<RefCell<Vec<Message>>>>,
}

struct List(Rc<RefCell<Vec<Message>>>);

impl OutputSink for List {
    fn send(&mut self, header: MessageHeader, bytes: &[u8]) -> Result<(), StageError> {
        self.0.borrow_mut().push(Message::from_vec(header, bytes.to_vec()));
        Ok(())
    }
}

impl StageHarness {
    /// Creates a stage of a kind, with parameters in TOML.
    ///
    /// # Errors
    /// The parameters are wrong, or the stage cannot be created.
    pub fn new(kind: &StageKind, parameters: &str) -> Result<Self, StageError> {
        Self::with_context(kind, parameters, &Context::default())
    }

    /// The same, with information about its pipeline.
    ///
    /// # Errors
    /// The parameters are wrong, or the stage cannot be created.
    pub fn with_context(kind: &StageKind, parameters: &str, context: &Context) -> Result<Self, StageError> {
        let parameters = parameters.parse().map_err(|error| StageError::new("read the parameters", error))?;
        let sent: Vec<Rc<RefCell<Vec<Message>>>> = kind.outputs.iter().map(|_| Rc::default()).collect();
        let ends = kind.outputs.iter().zip(&sent).map(|(port, list)| OutputEnd {
            topic: port.topic.map_or_else(|| format!("/{{robot}}/{}/{}", kind.name, port.name), str::to_owned),
            sink: Some(Box::new(List(Rc::clone(list)))),
        });
        Ok(Self { node: kind.make(parameters, context, ends.collect())?, kind: kind.clone(), sent })
    }

    /// Passes the stage a message about `robot`, logged at `log_time`.
    ///
    /// # Errors
    /// There is no such input, the message cannot be encoded, or the stage fails.
    pub fn give<T: RosMessage>(
        &mut self,
        input: &str,
        robot: &str,
        log_time: LogTime,
        message: &T::Borrowed<'_>,
    ) -> Result<(), StageError> {
        let bytes = encode(message).map_err(|error| StageError::new(format!("encode a {}", T::NAME), error))?;
        self.give_bytes(input, robot, log_time, bytes)
    }

    /// Passes the stage an encoded message.
    ///
    /// # Errors
    /// There is no such input, or the stage fails.
    pub fn give_bytes(
        &mut self,
        input: &str,
        robot: &str,
        log_time: LogTime,
        bytes: Vec<u8>,
    ) -> Result<(), StageError> {
        let robot = FixedText::new(robot).map_err(|error| StageError::new("name the robot", error))?;
        self.give_message(input, Message::from_vec(MessageHeader { log_time, robot, ..Default::default() }, bytes))
    }

    /// Passes the stage an encoded message with the given header.
    ///
    /// # Errors
    /// There is no such input, or the stage fails.
    pub fn give_message(&mut self, input: &str, message: Message) -> Result<(), StageError> {
        let port = self.kind.inputs.iter().position(|port| port.name == input);
        let port =
            port.ok_or_else(|| StageError::new(format!("give a message to `{input}`"), "there is no such input"))?;
        self.node.set_log_time(message.header().log_time);
        self.node.receive(port, &message)
    }

    /// Notifies the stage that its inputs have ended, at `log_time`.
    ///
    /// # Errors
    /// The stage fails.
    pub fn finish(&mut self, log_time: LogTime) -> Result<(), StageError> {
        self.node.set_log_time(log_time);
        self.node.finish()
    }

    /// The stage as used by an engine, for everything except ports.
    pub fn node(&mut self) -> &mut Node {
        &mut self.node
    }

    /// Takes the messages sent on an output since the last call; none for an output that does not exist.
    pub fn take_messages(&mut self, output: &str) -> Vec<Message> {
        let port = self.kind.outputs.iter().position(|port| port.name == output);
        port.map(|port| self.sent[port].take()).unwrap_or_default()
    }

    /// The same, decoded.
    ///
    /// # Errors
    /// A message is not of type `T`.
    pub fn take<T: RosMessage + DeserializeOwned>(&mut self, output: &str) -> Result<Vec<T>, StageError> {
        let messages = self.take_messages(output);
        let decoded = messages.iter().map(|message| message.decode::<T>());
        decoded.collect::<Result<_, _>>().map_err(|error| StageError::new(format!("read a {}", T::NAME), error))
    }

    /// The warnings, each with the number of times.
    pub fn warnings(&self) -> BTreeMap<String, u64> {
        self.node.warnings()
    }

    /// The counts of what the stage has done.
    pub fn counts(&self) -> BTreeMap<String, u64> {
        self.node.counts()
    }
}
