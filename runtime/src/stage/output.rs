//! The outputs of a stage: an [`Out`] for each port, in a struct that the stage defines.

use super::{OutputPort, PortType, StageError};
use crate::message::{Blank, Channel, Filled, FixedText, LogTime, MessageFlags, MessageHeader, Write, write_vec};
use crate::ros::{self, GridPrefix, OccupancyGrid, RosMessage};
use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::marker::PhantomData;
use std::ops::Deref;
use std::rc::Rc;

/// The destination of an output port: a link, or a list in a test.
pub trait OutputSink {
    /// Sends an encoded message; its bytes are copied once.
    fn send(&mut self, header: MessageHeader, bytes: &[u8]) -> Result<(), StageError>;

    /// Sends a message of `header.length` bytes that `write` writes: in place, or else into a buffer that is copied.
    fn send_in_place(&mut self, header: MessageHeader, write: &mut Write<'_>) -> Result<(), StageError> {
        self.send(header, &write_vec(Vec::new(), header.length as usize, write)?)
    }
}

/// The output ports of a stage: a struct with an [`Out`] for each, or `()` for none.
///
/// ```
/// use gridweave_runtime::ros::{MapDirection, TFMessage};
/// use gridweave_runtime::stage::{Out, OutputPorts, Outputs};
///
/// struct Directions {
///     direction: Out<MapDirection>,
///     tf: Out<TFMessage>,
/// }
///
/// impl Outputs for Directions {
///     fn declare(ports: &mut OutputPorts) -> Self {
///         Self {
///             direction: ports.output("direction", "the direction of each map's walls"),
///             tf: ports.output_on("/tf", "tf", "the same as transforms"),
///         }
///     }
/// }
/// ```
pub trait Outputs: 'static {
    /// Declares the ports.
    fn declare(ports: &mut OutputPorts) -> Self;
}

impl Outputs for () {
    fn declare(_: &mut OutputPorts) -> Self {}
}

/// Declares the output ports of a stage kind, and connects those of a stage to their links.
#[derive(Default)]
pub struct OutputPorts {
    declared: Vec<OutputPort>,
    ports: Vec<Rc<RefCell<Port>>>,
    state: Rc<OutputState>,
    ends: std::vec::IntoIter<OutputEnd>,
}

/// The connection of an output port of a stage in a pipeline.
#[derive(Default)]
pub struct OutputEnd {
    /// The topic of its messages in a log, with `{robot}` for the robot's name.
    pub topic: String,
    /// Its link; none if nothing reads it.
    pub sink: Option<Box<dyn OutputSink>>,
}

/// The state that all outputs of a stage share.
#[derive(Default)]
struct OutputState {
    log_time: Cell<LogTime>,
    warnings: RefCell<BTreeMap<String, u64>>,
    /// The texts of warnings that have not been logged.
    unlogged: RefCell<Vec<String>>,
    counts: RefCell<BTreeMap<&'static str, u64>>,
}

/// An output port of a running stage, and the number of messages sent on it.
struct Port {
    name: &'static str,
    topic: TopicTemplate,
    sink: Option<Box<dyn OutputSink>>,
    messages: u64,
}

impl OutputPorts {
    /// The ports of a stage in a pipeline, connected to these ends in the order of their declaration.
    pub(super) fn connected_to(ends: Vec<OutputEnd>) -> Self {
        Self { ends: ends.into_iter(), ..Self::default() }
    }

    /// Declares an output whose messages have the topic `/{robot}/{stage}/{name}` or, if they are about no robot in
    /// particular, `/{stage}/{name}`.
    pub fn output<T: RosMessage>(&mut self, name: &'static str, summary: &'static str) -> Out<T> {
        self.add(OutputPort { name, port_type: PortType::of::<T>(), topic: None, side: false, summary })
    }

    /// Declares an output whose messages have the given topic, in which `{robot}` and `{stage}` are replaced by the
    /// names.
    pub fn output_on<T: RosMessage>(
        &mut self,
        topic: &'static str,
        name: &'static str,
        summary: &'static str,
    ) -> Out<T> {
        self.add(OutputPort { name, port_type: PortType::of::<T>(), topic: Some(topic), side: false, summary })
    }

    /// Declares a side output, for diagnostics and other secondary messages: like [`output`](Self::output), but never
    /// the output that is meant where a pipeline names only the stage.
    pub fn side_output<T: RosMessage>(&mut self, name: &'static str, summary: &'static str) -> Out<T> {
        self.add(OutputPort { name, port_type: PortType::of::<T>(), topic: None, side: true, summary })
    }

    /// Declares a side output whose messages have the given topic, as [`output_on`](Self::output_on) does.
    pub fn side_output_on<T: RosMessage>(
        &mut self,
        topic: &'static str,
        name: &'static str,
        summary: &'static str,
    ) -> Out<T> {
        self.add(OutputPort { name, port_type: PortType::of::<T>(), topic: Some(topic), side: true, summary })
    }

    /// Declares an output for messages of any type, each of a channel that was [announced](Out::announce) before.
    pub fn any_output(&mut self, name: &'static str, summary: &'static str) -> Out<AnyMessage> {
        self.encoded_output(PortType::Any, name, summary)
    }

    /// Declares an output for encoded messages of a type that is known only at run time.
    pub fn encoded_output(
        &mut self,
        port_type: PortType,
        name: &'static str,
        summary: &'static str,
    ) -> Out<AnyMessage> {
        self.add(OutputPort { name, port_type, topic: None, side: false, summary })
    }

    /// The same, with all properties of the port.
    pub fn encoded_port(&mut self, port: OutputPort) -> Out<AnyMessage> {
        self.add(port)
    }

    fn add<T>(&mut self, port: OutputPort) -> Out<T> {
        let OutputEnd { topic, sink } = self.ends.next().unwrap_or_default();
        let topic = TopicTemplate { template: topic, last: None };
        let shared = Rc::new(RefCell::new(Port { name: port.name, topic, sink, messages: 0 }));
        self.declared.push(port);
        self.ports.push(Rc::clone(&shared));
        Out { port: shared, state: Rc::clone(&self.state), message: PhantomData }
    }

    pub(super) fn into_declared(self) -> Vec<OutputPort> {
        self.declared
    }

    pub(super) fn counted(self) -> SentCounts {
        SentCounts { ports: self.ports, state: self.state }
    }

    pub(super) fn bind<O>(&self, outputs: O) -> Output<O> {
        Output { outputs, state: Rc::clone(&self.state) }
    }
}

/// The numbers of messages, warnings and counts of a stage, for the engine.
pub(super) struct SentCounts {
    ports: Vec<Rc<RefCell<Port>>>,
    state: Rc<OutputState>,
}

impl SentCounts {
    pub(super) fn messages(&self) -> impl Iterator<Item = u64> {
        self.ports.iter().map(|port| port.borrow().messages)
    }

    pub(super) fn log_time(&self) -> LogTime {
        self.state.log_time.get()
    }

    pub(super) fn set_log_time(&self, log_time: LogTime) {
        self.state.log_time.set(log_time);
    }

    pub(super) fn warnings(&self) -> BTreeMap<String, u64> {
        self.state.warnings.borrow().clone()
    }

    /// Takes the texts of warnings that have not been logged.
    pub(super) fn take_unlogged(&self) -> Vec<String> {
        self.state.unlogged.take()
    }

    pub(super) fn warning_count(&self) -> u64 {
        self.state.warnings.borrow().values().sum()
    }

    pub(super) fn counts(&self) -> BTreeMap<String, u64> {
        self.state.counts.borrow().iter().map(|(what, count)| ((*what).to_owned(), *count)).collect()
    }
}

/// The outputs `O` of a stage while it handles a message, with their shared log time, warnings and counts. Dereferences
/// to `O`.
pub struct Output<O> {
    outputs: O,
    state: Rc<OutputState>,
}

impl<O> Deref for Output<O> {
    type Target = O;

    fn deref(&self) -> &O {
        &self.outputs
    }
}

impl<O> Output<O> {
    /// The log time of messages that are sent without one of their own: that of the message being handled.
    pub fn log_time(&self) -> LogTime {
        self.state.log_time.get()
    }

    /// Sets the log time of the messages that a source sends next.
    pub fn set_log_time(&self, log_time: LogTime) {
        self.state.log_time.set(log_time);
    }

    /// Counts a warning: a problem with the input that the stage can continue with, such as "readings before the first
    /// pose". The summary of the run shows every text with its count; a live run also logs each text at once.
    pub fn warn(&self, what: impl Into<String>) {
        let what = what.into();
        if !self.state.warnings.borrow().contains_key(&what) {
            self.state.unlogged.borrow_mut().push(what.clone());
        }
        self.warn_logged(what);
    }

    /// Counts a warning that has been logged already.
    pub fn warn_logged(&self, what: impl Into<String>) {
        *self.state.warnings.borrow_mut().entry(what.into()).or_default() += 1;
    }

    /// Counts something that the stage has done, such as "searches". The summary of the run shows it with the stage.
    pub fn count(&self, what: &'static str, more: u64) {
        *self.state.counts.borrow_mut().entry(what).or_default() += more;
    }
}

/// The message type of a port for messages of any type.
#[derive(Clone, Copy, Debug)]
pub struct AnyMessage;

/// An output port of a stage, for messages of type `T`. A port without readers drops its messages.
pub struct Out<T> {
    port: Rc<RefCell<Port>>,
    state: Rc<OutputState>,
    message: PhantomData<fn(T)>,
}

impl<T: RosMessage> Out<T> {
    /// Sends a message about `robot` (empty: about none in particular).
    ///
    /// # Errors
    /// The message cannot be encoded, the robot's name is too long, or the link has failed.
    pub fn send(&self, robot: &str, message: &T::Borrowed<'_>) -> Result<(), StageError> {
        let bytes = ros::encode(message).map_err(|error| StageError::new(format!("send a {}", T::NAME), error))?;
        self.send_bytes(robot, &bytes)
    }
}

impl Out<OccupancyGrid<'static>> {
    /// Sends a grid about `robot`, whose cells `fill` writes directly to the memory that the readers see. `fill` is not
    /// called if the port has no readers.
    ///
    /// # Errors
    /// The grid is too large for the message, the robot's name too long, `fill` fails, or the link has failed.
    pub fn send_grid(
        &self,
        robot: &str,
        prefix: &GridPrefix,
        mut fill: impl for<'b> FnMut(Blank<'b>) -> Result<Filled<'b>, StageError>,
    ) -> Result<(), StageError> {
        let head = prefix.encode().map_err(|error| StageError::new("send a grid", error))?;
        let header = self.header(robot, head.len() + prefix.cell_count())?;
        let port = &mut *self.port.borrow_mut();
        port.messages += 1;
        let Some(sink) = &mut port.sink else { return Ok(()) };
        sink.send_in_place(header, &mut |blank| blank.copy_then(&head, &mut fill))
    }
}

impl<T> Out<T> {
    /// Whether the port has readers. Without readers a message need not be computed.
    pub fn is_read(&self) -> bool {
        self.port.borrow().sink.is_some()
    }

    /// Sends an encoded message about `robot`.
    ///
    /// # Errors
    /// The robot's name is too long, or the link has failed.
    pub fn send_bytes(&self, robot: &str, bytes: &[u8]) -> Result<(), StageError> {
        let header = self.header(robot, bytes.len())?;
        self.send_encoded(header, bytes)
    }

    /// Sends an encoded message with the given header, for sources, whose messages have topics and times.
    ///
    /// # Errors
    /// The link has failed.
    pub fn send_encoded(&self, mut header: MessageHeader, bytes: &[u8]) -> Result<(), StageError> {
        header.flags = MessageFlags::DATA;
        header.length = bytes.len() as u64;
        let port = &mut *self.port.borrow_mut();
        port.messages += 1;
        match &mut port.sink {
            Some(sink) => sink.send(header, bytes),
            None => Ok(()),
        }
    }

    /// Announces that the messages of channel `number` that follow on this port were logged on `channel`.
    ///
    /// # Errors
    /// The channel's topic is too long, or the link has failed.
    pub fn announce(&self, number: u32, channel: &Channel) -> Result<(), StageError> {
        let doing = || format!("announce the channel {}", channel.topic);
        let bytes = channel.encode().map_err(|error| StageError::new(doing(), error))?;
        let topic = FixedText::new(&channel.topic).map_err(|error| StageError::new(doing(), error))?;
        let header = MessageHeader {
            log_time: self.state.log_time.get(),
            length: bytes.len() as u64,
            flags: MessageFlags::CHANNEL,
            channel: number,
            topic,
            ..Default::default()
        };
        match &mut self.port.borrow_mut().sink {
            Some(sink) => sink.send(header, &bytes),
            None => Ok(()),
        }
    }

    fn header(&self, robot: &str, length: usize) -> Result<MessageHeader, StageError> {
        let log_time = self.state.log_time.get();
        let mut port = self.port.borrow_mut();
        let robot = FixedText::new(robot)
            .map_err(|error| StageError::new(format!("send on port `{}`: the robot's name", port.name), error))?;
        Ok(MessageHeader {
            log_time,
            publish_time: log_time.0,
            length: length as u64,
            flags: MessageFlags::DATA,
            robot,
            topic: port.topic.topic(robot)?,
            ..Default::default()
        })
    }
}

/// A topic with the placeholder `{robot}`, and the last robot and topic as a cache.
struct TopicTemplate {
    template: String,
    last: Option<(FixedText<64>, FixedText<128>)>,
}

impl TopicTemplate {
    /// The topic for a robot. For a message about no robot in particular, the robot's part of the path is omitted.
    fn topic(&mut self, robot: FixedText<64>) -> Result<FixedText<128>, StageError> {
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
