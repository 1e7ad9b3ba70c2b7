//! What a stage sends through.

use super::StageError;
use crate::message::{Blank, Channel, Filled, FixedText, LogTime, MessageFlags, MessageHeader, Write};
use crate::ros::{self, GridPrefix, RosMessage};
use serde::Serialize;
use std::collections::BTreeMap;

/// Where an output port leads: a link, or a list in a test.
pub trait OutputSink {
    /// Sends a message of which the bytes are there already; they are copied once.
    fn send(&mut self, header: MessageHeader, bytes: &[u8]) -> Result<(), StageError>;

    /// Sends a message of `header.length` bytes that `write` writes in place, each once.
    fn send_in_place(&mut self, header: MessageHeader, write: &mut Write<'_>) -> Result<(), StageError>;
}

/// What a stage sends through while it handles one message.
///
/// Ports are named by their index among the kind's output ports. A port that nothing reads takes messages and drops
/// them.
pub struct Output<'a> {
    ports: &'a mut [Sent],
    log_time: LogTime,
    warnings: &'a mut BTreeMap<String, u64>,
}

/// One output port of a running stage: its topic, its link, and how much went through it.
pub struct Sent {
    sink: Option<Box<dyn OutputSink>>,
    name: &'static str,
    topic: TopicTemplate,
    messages: u64,
}

impl Sent {
    /// A port called `name` whose messages get the topic that `template` makes of their robot, going to `sink`.
    pub fn new(name: &'static str, template: impl Into<String>, sink: Option<Box<dyn OutputSink>>) -> Self {
        Self { sink, name, topic: TopicTemplate::new(template.into()), messages: 0 }
    }

    /// How many messages were sent.
    pub fn messages(&self) -> u64 {
        self.messages
    }
}

/// A topic with a place for the robot's name, and the last name that was put in.
struct TopicTemplate {
    template: String,
    last: Option<(FixedText<32>, FixedText<128>)>,
}

impl TopicTemplate {
    fn new(template: String) -> Self {
        Self { template, last: None }
    }

    /// A message about no robot in particular leaves the robot's part of the path out.
    fn topic(&mut self, robot: FixedText<32>) -> Result<FixedText<128>, StageError> {
        if let Some((last_robot, topic)) = self.last
            && last_robot == robot
        {
            return Ok(topic);
        }
        let topic = match robot.is_empty() {
            true => self.template.replace("/{robot}", ""),
            false => self.template.replace("{robot}", robot.as_str()),
        };
        let topic = FixedText::new(&topic).map_err(|error| StageError::new("name a topic", error))?;
        self.last = Some((robot, topic));
        Ok(topic)
    }
}

impl<'a> Output<'a> {
    /// The output of a stage that handles a message of `log_time`.
    pub fn new(ports: &'a mut [Sent], log_time: LogTime, warnings: &'a mut BTreeMap<String, u64>) -> Self {
        Self { ports, log_time, warnings }
    }

    /// The log time that what is sent will carry, unless it brings its own.
    pub fn log_time(&self) -> LogTime {
        self.log_time
    }

    /// Whether anything reads the port. What nobody reads need not be made.
    pub fn is_read(&self, port: usize) -> bool {
        self.ports.get(port).is_some_and(|port| port.sink.is_some())
    }

    /// Sends a message about `robot` (empty: about none in particular).
    pub fn send<T: RosMessage + Serialize>(&mut self, port: usize, robot: &str, message: &T) -> Result<(), StageError> {
        let bytes = ros::encode(message).map_err(|error| StageError::new(format!("send a {}", T::NAME), error))?;
        self.send_bytes(port, robot, &bytes)
    }

    /// Sends a message about `robot` that is encoded already.
    pub fn send_bytes(&mut self, port: usize, robot: &str, bytes: &[u8]) -> Result<(), StageError> {
        let header = self.header(port, robot, bytes.len())?;
        self.send_encoded(port, header, bytes)
    }

    /// Sends a grid about `robot`, whose cells `fill` writes straight into the memory that the readers will see. A port that
    /// nothing reads does not ask for them.
    pub fn send_grid(
        &mut self,
        port: usize,
        robot: &str,
        prefix: &GridPrefix,
        mut fill: impl for<'b> FnMut(Blank<'b>) -> Result<Filled<'b>, StageError>,
    ) -> Result<(), StageError> {
        let head = prefix.encode().map_err(|error| StageError::new("send a grid", error))?;
        let header = self.header(port, robot, head.len() + prefix.cell_count())?;
        let sent = self.port(port)?;
        sent.messages += 1;
        let Some(sink) = &mut sent.sink else { return Ok(()) };
        sink.send_in_place(header, &mut |blank| blank.copy_then(&head, &mut fill))
    }

    /// Sends a message that is encoded already, with a header of its own: for sources, which bring topics and times.
    pub fn send_encoded(&mut self, port: usize, mut header: MessageHeader, bytes: &[u8]) -> Result<(), StageError> {
        header.flags = MessageFlags::DATA;
        header.length = bytes.len() as u64;
        let sent = self.port(port)?;
        sent.messages += 1;
        match &mut sent.sink {
            Some(sink) => sink.send(header, bytes),
            None => Ok(()),
        }
    }

    /// Announces that the messages of channel `number` that follow on this port were logged on `channel`.
    pub fn announce(&mut self, port: usize, number: u32, channel: &Channel) -> Result<(), StageError> {
        let doing = || format!("announce the channel {}", channel.topic);
        let bytes = channel.encode().map_err(|error| StageError::new(doing(), error))?;
        let topic = FixedText::new(&channel.topic).map_err(|error| StageError::new(doing(), error))?;
        let header = MessageHeader {
            log_time: self.log_time,
            length: bytes.len() as u64,
            flags: MessageFlags::CHANNEL,
            channel: number,
            topic,
            ..Default::default()
        };
        match &mut self.port(port)?.sink {
            Some(sink) => sink.send(header, &bytes),
            None => Ok(()),
        }
    }

    /// Counts something that is wrong with the input and that the stage can live with, such as "readings before the
    /// first pose". The run's summary shows every text with its count.
    pub fn warn(&mut self, what: impl Into<String>) {
        *self.warnings.entry(what.into()).or_default() += 1;
    }

    /// Sets the log time of what a source sends next.
    pub fn set_log_time(&mut self, log_time: LogTime) {
        self.log_time = log_time;
    }

    fn port(&mut self, port: usize) -> Result<&mut Sent, StageError> {
        self.ports.get_mut(port).ok_or_else(|| StageError::new("send", format!("the stage has no output port {port}")))
    }

    fn header(&mut self, port: usize, robot: &str, length: usize) -> Result<MessageHeader, StageError> {
        let log_time = self.log_time;
        let sent = self.port(port)?;
        let robot = FixedText::new(robot)
            .map_err(|error| StageError::new(format!("send on port `{}`: the robot's name", sent.name), error))?;
        Ok(MessageHeader {
            log_time,
            publish_time: log_time.0,
            length: length as u64,
            flags: MessageFlags::DATA,
            robot,
            topic: sent.topic.topic(robot)?,
            ..Default::default()
        })
    }
}
