//! The stage kind of a program.

use super::call::Program;
use super::source::ProgramSource;
use super::stage::{Ports, ProgramStage};
use super::{Interface, Launch};
use crate::stage::{Context, OutputPorts, Parameters, StageKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// The given parameters, which are checked by the schema of the program.
#[derive(Default, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
struct Given(Map<String, Value>);

impl Parameters for Given {}

/// The stage kind `name` with the ports and parameters of `interface`, whose program `launch` starts. Errors call the
/// program `what`. The kind is never freed.
pub fn kind_of(name: &'static str, what: &str, interface: Interface, launch: Launch) -> &'static StageKind {
    let Interface { summary, inputs, outputs, parameters, definitions, text } = interface;
    let names: Vec<&'static str> = inputs.iter().map(|port| port.name).collect();
    let what = what.to_owned();
    let declare =
        move |ports: &mut OutputPorts| Ports(outputs.iter().map(|port| ports.encoded_port(port.clone())).collect());
    let make = move |Given(parameters): Given, context: &Context| {
        let program = Program::start(&launch, context.stall_timeout)?;
        let mut stage = ProgramStage::new(program, names.clone(), what.clone());
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
