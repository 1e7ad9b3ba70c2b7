//! What a stage sends through: an [`Out`] for each port, in a struct of the stage's own.

use super::{OutputPort, PortType, StageError};
use crate::message::{Blank, Channel, Filled, FixedText, LogTime, MessageFlags, MessageHeader, Write};
use crate::ros::{self, GridPrefix, OccupancyGrid, RosMessage};
use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::marker::PhantomData;
use std::ops::Deref;
use std::rc::Rc;

/// Where an output port leads: a link, or a list in a test.
pub trait OutputSink {
    /// Sends a message of which the bytes are there already; they are copied once.
    fn send(&mut self, header: MessageHeader, bytes: &[u8]) -> Result<(), StageError>;

    /// Sends a message of `header.length` bytes that `write` writes in place, each once.
    fn send_in_place(&mut self, header: MessageHeader, write: &mut Write<'_>) -> Result<(), StageError>;
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
    /// Names the ports.
    fn declare(ports: &mut OutputPorts) -> Self;
}

impl Outputs for () {
    fn declare(_: &mut OutputPorts) -> Self {}
}

/// Names the output ports of a stage kind, and ties those of a stage to their links.
#[derive(Default)]
pub struct OutputPorts {
    declared: Vec<OutputPort>,
    ports: Vec<Rc<RefCell<Port>>>,
    state: Rc<OutputState>,
    ends: std::vec::IntoIter<OutputEnd>,
}

/// Where an output port of a stage in a pipeline leads.
#[derive(Default)]
pub struct OutputEnd {
    /// The topic of its messages in a log, with `{robot}` for the robot's name.
    pub topic: String,
    /// Its link; none if nothing reads it.
    pub sink: Option<Box<dyn OutputSink>>,
}

/// What all outputs of a stage have in common.
#[derive(Default)]
struct OutputState {
    log_time: Cell<LogTime>,
    warnings: RefCell<BTreeMap<String, u64>>,
    counts: RefCell<BTreeMap<&'static str, u64>>,
}

/// One output port of a running stage, and how much went through it.
struct Port {
    name: &'static str,
    topic: TopicTemplate,
    sink: Option<Box<dyn OutputSink>>,
    messages: u64,
}

impl OutputPorts {
    /// The ports of a stage in a pipeline, which lead to these ends in the order in which they are declared.
    pub(super) fn connected_to(ends: Vec<OutputEnd>) -> Self {
        Self { ends: ends.into_iter(), ..Self::default() }
    }

    /// An output whose messages get the topic `/{robot}/{stage}/{name}` or, if they are about no robot in particular,
    /// `/{stage}/{name}`.
    pub fn output<T: RosMessage>(&mut self, name: &'static str, summary: &'static str) -> Out<T> {
        self.add(OutputPort { name, port_type: PortType::of::<T>(), topic: None, side: false, summary })
    }

    /// An output whose messages have a topic of their own, with `{robot}` and `{stage}` for the names of these.
    pub fn output_on<T: RosMessage>(
        &mut self,
        topic: &'static str,
        name: &'static str,
        summary: &'static str,
    ) -> Out<T> {
        self.add(OutputPort { name, port_type: PortType::of::<T>(), topic: Some(topic), side: false, summary })
    }

    /// The same as [`output`](Self::output), for what is beside what the stage is for, such as what it went by: where a
    /// pipeline names the stage alone, this output is not meant.
    pub fn side_output<T: RosMessage>(&mut self, name: &'static str, summary: &'static str) -> Out<T> {
        self.add(OutputPort { name, port_type: PortType::of::<T>(), topic: None, side: true, summary })
    }

    /// An output for messages of any type, each of a channel that is [announced](Out::announce) before it.
    pub fn any_output(&mut self, name: &'static str, summary: &'static str) -> Out<AnyMessage> {
        self.encoded_output(PortType::Any, name, summary)
    }

    /// An output of a type that is known only when the program runs, for messages that are encoded already.
    pub fn encoded_output(
        &mut self,
        port_type: PortType,
        name: &'static str,
        summary: &'static str,
    ) -> Out<AnyMessage> {
        self.add(OutputPort { name, port_type, topic: None, side: false, summary })
    }

    /// The same, with all that is said of the port.
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

/// What a stage has sent and warned of, as the engine sees it.
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

    pub(super) fn warning_count(&self) -> u64 {
        self.state.warnings.borrow().values().sum()
    }

    pub(super) fn counts(&self) -> BTreeMap<String, u64> {
        self.state.counts.borrow().iter().map(|(what, count)| ((*what).to_owned(), *count)).collect()
    }
}

/// What a stage sends through while it handles a message: its outputs `O`, for which it stands, and what they have in common.
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
    /// The log time that what is sent will carry, unless it brings its own: that of the message that is handled.
    pub fn log_time(&self) -> LogTime {
        self.state.log_time.get()
    }

    /// Sets the log time of what a source sends next.
    pub fn set_log_time(&self, log_time: LogTime) {
        self.state.log_time.set(log_time);
    }

    /// Counts something that is wrong with the input and that the stage can live with, such as "readings before the
    /// first pose". The run's summary shows every text with its count.
    pub fn warn(&self, what: impl Into<String>) {
        *self.state.warnings.borrow_mut().entry(what.into()).or_default() += 1;
    }

    /// Counts something that the stage has done, such as "searches". The run's summary shows it with the stage.
    pub fn count(&self, what: &'static str, more: u64) {
        *self.state.counts.borrow_mut().entry(what).or_default() += more;
    }
}

/// Stands for a message of any type where a port takes or gives such.
#[derive(Clone, Copy, Debug)]
pub struct AnyMessage;

/// An output port of a stage, for messages of type `T`. A port that nothing reads takes messages and drops them.
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
    /// Sends a grid about `robot`, whose cells `fill` writes straight into the memory that the readers will see. A port that
    /// nothing reads does not ask for them.
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
    /// Whether anything reads the port. What nobody reads need not be made.
    pub fn is_read(&self) -> bool {
        self.port.borrow().sink.is_some()
    }

    /// Sends a message about `robot` that is encoded already.
    ///
    /// # Errors
    /// The robot's name is too long, or the link has failed.
    pub fn send_bytes(&self, robot: &str, bytes: &[u8]) -> Result<(), StageError> {
        let header = self.header(robot, bytes.len())?;
        self.send_encoded(header, bytes)
    }

    /// Sends a message that is encoded already, with a header of its own: for sources, which bring topics and times.
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

/// A topic with a place for the robot's name, and the last name that was put in.
struct TopicTemplate {
    template: String,
    last: Option<(FixedText<64>, FixedText<128>)>,
}

impl TopicTemplate {
    /// A message about no robot in particular leaves the robot's part of the path out.
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
