//! The stage of a program.

use super::call::{CallError, Program};
use super::header::{CallHeader, Reply, Request};
use crate::message::{Message, MessageHeader};
use crate::stage::{AnyMessage, Context, Out, Output, OutputPorts, Outputs, StageError};
use serde_json::{Map, Value, json};

/// A stage whose messages a running program handles.
pub(super) struct ProgramStage {
    pub(super) program: Program,
    /// The names of the inputs.
    inputs: Vec<&'static str>,
    /// The name of the program in errors, such as the name of a module.
    what: String,
}

/// The outputs of the interface.
pub(super) struct Ports(pub(super) Vec<Out<AnyMessage>>);

/// [`kind_of`](super::kind_of) declares the ports of an interface instead.
impl Outputs for Ports {
    fn declare(_: &mut OutputPorts) -> Self {
        Self(Vec::new())
    }
}

impl ProgramStage {
    /// A stage of a program that has been started; errors call it `what`.
    pub(super) fn new(program: Program, inputs: Vec<&'static str>, what: String) -> Self {
        Self { program, inputs, what }
    }

    pub(super) fn start(
        &mut self,
        parameters: Map<String, Value>,
        context: &Context,
        interface: &str,
    ) -> Result<(), StageError> {
        let inputs: Vec<Value> = context
            .inputs
            .iter()
            .map(|wire| json!({ "port": wire.port, "from": wire.from, "type": wire.ros_type, "topic": wire.topic }))
            .collect();
        let start = json!({
            "stage": context.stage, "parameters": parameters, "seed": context.seed, "reference": context.reference,
            "robots": context.robots, "inputs": inputs, "interface": interface,
        });
        let bytes = (&MessageHeader::default(), start.to_string().into_bytes());
        let nothing_yet = |_, _: &CallHeader, _: &[u8]| Ok(());
        let started = self.program.call(Request::Start, (0, 0), (bytes.0, &bytes.1), nothing_yet);
        started.map_err(|error| StageError::new(format!("start {}", self.what), error))
    }

    pub(super) fn receive(&mut self, port: usize, message: &Message, output: &Output<Ports>) -> Result<(), StageError> {
        let name = self.inputs.get(port).copied().unwrap_or_default();
        let doing = |what: &str| {
            let of_robot = if message.robot().is_empty() { String::new() } else { format!(" of {}", message.robot()) };
            format!("take a message{of_robot} on the input `{name}` in {what}")
        };
        let reply = (message.header(), message.bytes());
        let called = self.program.call(Request::Message, (port, message.wire()), reply, |reply, header, bytes| {
            take(output, reply, header, bytes)
        });
        called.map_err(|error| self.failed(error, doing))
    }

    pub(super) fn finish(&mut self, output: &Output<Ports>) -> Result<(), StageError> {
        let nothing = (&MessageHeader::default(), &[][..]);
        let called = self
            .program
            .call(Request::Finish, (0, 0), nothing, |reply, header, bytes| take(output, reply, header, bytes));
        called.map_err(|error| self.failed(error, |what| format!("finish in {what}")))
    }

    pub(super) fn abort(&mut self, reason: &str) {
        let words = (&MessageHeader::default(), reason.as_bytes());
        // The run has failed already.
        let _ = self.program.call(Request::Abort, (0, 0), words, |_, _, _| Ok(()));
    }

    pub(super) fn failed(&self, error: CallError, doing: impl FnOnce(&str) -> String) -> StageError {
        match error {
            CallError::Stage(error) => error,
            error => StageError::new(doing(&self.what), error),
        }
    }
}

/// Forwards a reply of a program.
pub(super) fn take(output: &Output<Ports>, reply: Reply, header: &CallHeader, bytes: &[u8]) -> Result<(), StageError> {
    match reply {
        Reply::Output => match output.0.get(header.port as usize) {
            Some(port) => port.send_bytes(header.message.robot.as_str(), bytes),
            None => Err(StageError::new("send a message", format!("the program has no output {}", header.port))),
        },
        Reply::Warning => {
            output.warn(String::from_utf8_lossy(bytes));
            Ok(())
        }
        Reply::Done | Reply::Failed | Reply::End => Ok(()),
    }
}
