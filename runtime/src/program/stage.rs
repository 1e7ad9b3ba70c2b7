//! The stage of a program.

use super::call::{CallError, Program};
use super::header::{CallHeader, Reply, Request};
use super::source::ProgramSource;
use super::{Interface, Launch};
use crate::message::{Message, MessageHeader};
use crate::stage::{AnyMessage, Context, Out, Output, OutputPorts, Outputs, Parameters, StageError, StageKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

/// The given parameters, which are checked by the schema of the program.
#[derive(Default, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
struct Given(Map<String, Value>);

impl Parameters for Given {}

/// A stage whose messages a running program handles.
pub(super) struct ProgramStage {
    pub(super) program: Program,
    /// The names of the inputs.
    inputs: Vec<&'static str>,
    /// The name of the program in errors, such as the name of a module.
    what: String,
}

/// The outputs of the interface.
pub(super) struct Ports(Vec<Out<AnyMessage>>);

/// [`kind_of`] declares the ports of an interface instead.
impl Outputs for Ports {
    fn declare(_: &mut OutputPorts) -> Self {
        Self(Vec::new())
    }
}

/// The stage kind `name` with the ports and parameters of `interface`, whose program `launch` starts. Errors call the program
/// `what`. The kind is never freed.
pub fn kind_of(name: &'static str, what: &str, interface: Interface, launch: Launch) -> &'static StageKind {
    let Interface { summary, inputs, outputs, parameters, definitions, text } = interface;
    let names: Vec<&'static str> = inputs.iter().map(|port| port.name).collect();
    let what = what.to_owned();
    let declare =
        move |ports: &mut OutputPorts| Ports(outputs.iter().map(|port| ports.encoded_port(port.clone())).collect());
    let make = move |Given(parameters): Given, context: &Context| {
        let program = Program::start(&launch, context.stall_timeout)?;
        let mut stage = ProgramStage { program, inputs: names.clone(), what: what.clone() };
        stage.start(parameters, context, &text)?;
        Ok(stage)
    };
    let kind = match inputs.is_empty() {
        true => StageKind::source_with(name, summary, declare, move |given, context: &Context| {
            make(given, context).map(ProgramSource::new)
        }),
        false => {
            let mut builder = StageKind::stage_with(name, summary, declare, make);
            for (index, port) in inputs.into_iter().enumerate() {
                builder = builder.encoded_input(port, move |stage: &mut ProgramStage, message, output| {
                    stage.receive(index, message, output)
                });
            }
            builder.finish(ProgramStage::finish).abort(ProgramStage::abort).build()
        }
    };
    Box::leak(Box::new(kind.with_schema(parameters).with_definitions(definitions)))
}

impl ProgramStage {
    fn start(&mut self, parameters: Map<String, Value>, context: &Context, interface: &str) -> Result<(), StageError> {
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

    fn receive(&mut self, port: usize, message: &Message, output: &Output<Ports>) -> Result<(), StageError> {
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

    fn finish(&mut self, output: &Output<Ports>) -> Result<(), StageError> {
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
