//! How a kind of stage is put together: its inputs, each with what is done with a message that comes in on it.

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

/// A kind of stage in the making, with parameters `P`, state `S` and outputs `O`; see [`StageKind::stage`].
pub struct StageBuilder<P, S, O> {
    name: &'static str,
    summary: &'static str,
    inputs: Vec<InputPort>,
    declare: Box<Declare<O>>,
    make: Box<Make<P, S>>,
    handlers: Handlers<S, O>,
}

/// What a stage does with what happens to it.
struct Handlers<S, O> {
    /// By input port.
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

    /// An input that must be wired to one output.
    ///
    /// Messages come to all inputs together by log time; at equal times in the order of the kind's input ports (within a port
    /// that takes many in the order of the pipeline file), and within one wire as they were sent. One that cannot be decoded
    /// is left out with a warning.
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

    /// The same, but it may be left unwired.
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

    /// An input that any number of outputs may be wired to, but at least one.
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

    /// The same, but it may be left unwired.
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

    /// An input that any number of outputs of any type may be wired to, but at least one. Its messages come as they are;
    /// [`Message::wire`] tells the outputs apart, and [`Context::inputs`] what they are.
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

    /// An input whose messages come as they are, encoded.
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

    /// What is done when a source announces a channel: the messages with its number that follow on the wire were logged on
    /// it. Only a stage that passes on what it does not know needs it.
    #[must_use]
    pub fn announce(
        mut self,
        announce: impl Fn(&mut S, usize, u32, &Channel) -> Result<(), StageError> + Send + Sync + 'static,
    ) -> Self {
        self.handlers.announce = Box::new(announce);
        self
    }

    /// What is done when all inputs have ended. What is sent then carries the log time that they had come to.
    #[must_use]
    pub fn finish(
        mut self,
        finish: impl Fn(&mut S, &Output<O>) -> Result<(), StageError> + Send + Sync + 'static,
    ) -> Self {
        self.handlers.finish = Box::new(finish);
        self
    }

    /// What is done when the run has failed elsewhere: what was made is left in a state that can be used, and says why it is
    /// not complete.
    #[must_use]
    pub fn abort(mut self, abort: impl Fn(&mut S, &str) + Send + Sync + 'static) -> Self {
        self.handlers.abort = Box::new(abort);
        self
    }

    /// The kind.
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
            None => Err(StageError::new("take a message", format!("the stage has no input port {port}"))),
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
