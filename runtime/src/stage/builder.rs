//! The builder of a stage kind: its inputs, each with the handler of its messages.

use super::node::{Node, Role, RunningStage};
use super::{Context, InputPort, Output, OutputPorts, Parameters, PortType, Received, StageError, StageKind};
use crate::message::{Channel, Message};
use crate::ros::RosMessage;
use std::sync::Arc;

type Declare<O> = dyn Fn(&mut OutputPorts) -> O + Send + Sync;
type Make<P, S> = dyn Fn(P, &Context) -> Result<S, StageError> + Send + Sync;
type Receive<S, O> = dyn Fn(&mut S, &Message, &Output<O>) -> Result<(), StageError> + Send + Sync;
type Announce<S> = dyn Fn(&mut S, usize, u32, &Channel) -> Result<(), StageError> + Send + Sync;
type Finish<S, O> = dyn Fn(&mut S, &Output<O>) -> Result<(), StageError> + Send + Sync;
type Abort<S> = dyn Fn(&mut S, &str) + Send + Sync;

/// The builder of a stage kind with parameters `P`, state `S` and outputs `O`; see [`StageKind::stage`].
pub struct StageBuilder<P, S, O> {
    name: &'static str,
    summary: &'static str,
    inputs: Vec<InputPort>,
    declare: Box<Declare<O>>,
    make: Box<Make<P, S>>,
    handlers: Handlers<S, O>,
}

/// The handlers of a stage's events.
struct Handlers<S, O> {
    /// The handlers of messages, by input port.
    receive: Vec<Box<Receive<S, O>>>,
    announce: Box<Announce<S>>,
    finish: Box<Finish<S, O>>,
    abort: Box<Abort<S>>,
}

impl<P: Parameters, S: 'static, O: 'static> StageBuilder<P, S, O> {
    pub(super) fn new(
        name: &'static str,
        summary: &'static str,
        declare: impl Fn(&mut OutputPorts) -> O + Send + Sync + 'static,
        make: impl Fn(P, &Context) -> Result<S, StageError> + Send + Sync + 'static,
    ) -> Self {
        let handlers = Handlers {
            receive: Vec::new(),
            announce: Box::new(|_, _, _, _| Ok(())),
            finish: Box::new(|_, _| Ok(())),
            abort: Box::new(|_, _| ()),
        };
        Self { name, summary, inputs: Vec::new(), declare: Box::new(declare), make: Box::new(make), handlers }
    }

    /// Adds an input that must be wired to one output.
    ///
    /// The messages of all inputs are delivered together in order of log time; at equal times in the order of the
    /// kind's input ports (within a port with several wires in the order of the pipeline file), and within one wire as
    /// they were sent. A message that cannot be decoded is skipped with a warning.
    #[must_use]
    pub fn input<T: RosMessage + 'static>(
        self,
        name: &'static str,
        summary: &'static str,
        receive: impl Fn(&mut S, Received<'_, T>, &Output<O>) -> Result<(), StageError> + Send + Sync + 'static,
    ) -> Self {
        let port = InputPort { name, port_type: PortType::of::<T>(), many: false, optional: false, summary };
        self.typed(port, receive)
    }

    /// Adds an input that may be wired to one output.
    #[must_use]
    pub fn optional_input<T: RosMessage + 'static>(
        self,
        name: &'static str,
        summary: &'static str,
        receive: impl Fn(&mut S, Received<'_, T>, &Output<O>) -> Result<(), StageError> + Send + Sync + 'static,
    ) -> Self {
        let port = InputPort { name, port_type: PortType::of::<T>(), many: false, optional: true, summary };
        self.typed(port, receive)
    }

    /// Adds an input that must be wired to one or more outputs.
    #[must_use]
    pub fn inputs<T: RosMessage + 'static>(
        self,
        name: &'static str,
        summary: &'static str,
        receive: impl Fn(&mut S, Received<'_, T>, &Output<O>) -> Result<(), StageError> + Send + Sync + 'static,
    ) -> Self {
        let port = InputPort { name, port_type: PortType::of::<T>(), many: true, optional: false, summary };
        self.typed(port, receive)
    }

    /// Adds an input that may be wired to any number of outputs.
    #[must_use]
    pub fn optional_inputs<T: RosMessage + 'static>(
        self,
        name: &'static str,
        summary: &'static str,
        receive: impl Fn(&mut S, Received<'_, T>, &Output<O>) -> Result<(), StageError> + Send + Sync + 'static,
    ) -> Self {
        let port = InputPort { name, port_type: PortType::of::<T>(), many: true, optional: true, summary };
        self.typed(port, receive)
    }

    /// Adds an input that must be wired to one or more outputs of any type. Its messages are delivered encoded;
    /// [`Message::wire`] is the output that one comes from, an index into [`Context::inputs`].
    #[must_use]
    pub fn any_inputs(
        self,
        name: &'static str,
        summary: &'static str,
        receive: impl Fn(&mut S, &Message, &Output<O>) -> Result<(), StageError> + Send + Sync + 'static,
    ) -> Self {
        let port = InputPort { name, port_type: PortType::Any, many: true, optional: false, summary };
        self.encoded_input(port, receive)
    }

    /// Adds an input whose messages are delivered encoded.
    #[must_use]
    pub fn encoded_input(
        mut self,
        port: InputPort,
        receive: impl Fn(&mut S, &Message, &Output<O>) -> Result<(), StageError> + Send + Sync + 'static,
    ) -> Self {
        self.inputs.push(port);
        self.handlers.receive.push(Box::new(receive));
        self
    }

    /// Sets the handler for a channel that a source announces: the messages with its number that follow on the wire
    /// were logged on it. Only needed by a stage that forwards messages of unknown types.
    #[must_use]
    pub fn announce(
        mut self,
        announce: impl Fn(&mut S, usize, u32, &Channel) -> Result<(), StageError> + Send + Sync + 'static,
    ) -> Self {
        self.handlers.announce = Box::new(announce);
        self
    }

    /// Sets the handler for the end of all inputs. Messages that it sends carry the log time of the end.
    #[must_use]
    pub fn finish(
        mut self,
        finish: impl Fn(&mut S, &Output<O>) -> Result<(), StageError> + Send + Sync + 'static,
    ) -> Self {
        self.handlers.finish = Box::new(finish);
        self
    }

    /// Sets the handler for a failure of the run elsewhere. It should leave output files usable, with the reason why
    /// they are not complete.
    #[must_use]
    pub fn abort(mut self, abort: impl Fn(&mut S, &str) + Send + Sync + 'static) -> Self {
        self.handlers.abort = Box::new(abort);
        self
    }

    /// Builds the kind.
    pub fn build(self) -> StageKind {
        let Self { name, summary, inputs, declare, make, handlers } = self;
        let mut declared = OutputPorts::default();
        drop(declare(&mut declared));
        let handlers = Arc::new(handlers);
        let make = move |parameters: P, context: &Context, mut ports: OutputPorts| {
            let outputs = declare(&mut ports);
            let output = ports.bind(outputs);
            let state = make(parameters, context)?;
            let running = Running { state, output, handlers: Arc::clone(&handlers) };
            Ok(Node { role: Role::Stage(Box::new(running)), sent: ports.counted() })
        };
        StageKind::new::<P>(name, summary, inputs, declared.into_declared(), make)
    }

    fn typed<T: RosMessage + 'static>(
        self,
        port: InputPort,
        receive: impl Fn(&mut S, Received<'_, T>, &Output<O>) -> Result<(), StageError> + Send + Sync + 'static,
    ) -> Self {
        let name = port.name;
        self.encoded_input(port, move |state, message, output| match message.decode::<T::Borrowed<'_>>() {
            Ok(content) => receive(state, Received::new(message, content), output),
            Err(error) => {
                output.warn(format!("messages on the input `{name}` that cannot be read are left out: {error}"));
                Ok(())
            }
        })
    }
}

struct Running<S, O> {
    state: S,
    output: Output<O>,
    handlers: Arc<Handlers<S, O>>,
}

impl<S, O> RunningStage for Running<S, O> {
    fn receive(&mut self, port: usize, message: &Message) -> Result<(), StageError> {
        match self.handlers.receive.get(port) {
            Some(receive) => receive(&mut self.state, message, &self.output),
            None => Err(StageError::new("receive a message", format!("the stage has no input port {port}"))),
        }
    }

    fn announce(&mut self, wire: usize, number: u32, channel: &Channel) -> Result<(), StageError> {
        (self.handlers.announce)(&mut self.state, wire, number, channel)
    }

    fn finish(&mut self) -> Result<(), StageError> {
        (self.handlers.finish)(&mut self.state, &self.output)
    }

    fn abort(&mut self, reason: &str) {
        (self.handlers.abort)(&mut self.state, reason);
    }
}
