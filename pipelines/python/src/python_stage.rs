//! Stages that are Python objects of this interpreter.
//!
//! The object has the methods `start(request)`, `receive(port, robot, log_time, topic, wire, data)`, `advance()`,
//! `finish()` and `abort(reason)`, as the program of a stage in a process has them: `gridweave/in_process.py`. Each
//! returns what the stage sends meanwhile: a list of (output, robot, log time, bytes), a list of warnings, and whether
//! a source has ended.

use crate::errors::RequestError;
use gridweave_runtime::message::{LogTime, Message};
use gridweave_runtime::program::Interface;
use gridweave_runtime::stage::{
    AnyMessage, Context, Out, Output, OutputPorts, Outputs, Parameters, Source, StageError, StageKind,
};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyTuple};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::sync::Arc;

/// The given parameters, which are checked by the schema of the stage.
#[derive(Default, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
struct Given(Map<String, Value>);

impl Parameters for Given {}

struct Ports(Vec<Out<AnyMessage>>);

/// [`kind`] declares the ports of an interface instead.
impl Outputs for Ports {
    fn declare(_: &mut OutputPorts) -> Self {
        Self(Vec::new())
    }
}

/// What a call of the object returns.
type Sent = (Vec<(usize, String, u64, Vec<u8>)>, Vec<String>, bool);

/// The kind of stage `name` with the ports and parameters of `interface`, of which `make` makes an object. It is never
/// freed.
pub(crate) fn kind(name: String, interface: &str, make: Py<PyAny>) -> PyResult<StageKind> {
    let wrong = |problem| RequestError::new_err(format!("the stage `{name}` is wrong: {problem}"));
    let Interface { summary, inputs, outputs, parameters, definitions, .. } =
        Interface::read(interface).map_err(wrong)?;
    let name: &'static str = name.leak();
    let (make, is_source) = (Arc::new(make), inputs.is_empty());
    let declare =
        move |ports: &mut OutputPorts| Ports(outputs.iter().map(|port| ports.encoded_port(port.clone())).collect());
    let begin = move |Given(parameters): Given, context: &Context| PythonStage::start(name, &make, parameters, context);
    let kind = if is_source {
        StageKind::source_with(name, summary, declare, begin)
    } else {
        let mut builder = StageKind::stage_with(name, summary, declare, begin);
        for (index, port) in inputs.into_iter().enumerate() {
            builder = builder.encoded_input(port, move |stage: &mut PythonStage, message, output| {
                stage.receive(index, message, output)
            });
        }
        builder
            .finish(|stage: &mut PythonStage, output| {
                stage.call("finish", output, |py| Ok(PyTuple::empty(py))).map(drop)
            })
            .abort(PythonStage::abort)
            .build()
    };
    Ok(kind.with_schema(parameters).with_definitions(definitions))
}

/// A stage that is a Python object.
struct PythonStage {
    name: &'static str,
    object: Py<PyAny>,
}

impl PythonStage {
    fn start(
        name: &'static str,
        make: &Py<PyAny>,
        parameters: Map<String, Value>,
        context: &Context,
    ) -> Result<Self, StageError> {
        let wires = context
            .inputs
            .iter()
            .map(|wire| json!({ "port": wire.port, "from": wire.from, "type": wire.ros_type, "topic": wire.topic }));
        let request = json!({
            "stage": context.stage, "parameters": parameters, "seed": context.seed, "reference": context.reference,
            "robots": context.robots, "inputs": wires.collect::<Vec<_>>(),
        });
        let made = Python::attach(|py| make.call1(py, (request.to_string(),)).map_err(|error| text_of(py, &error)));
        let object = made.map_err(|text| StageError::new(format!("start the stage `{name}` in Python"), text))?;
        Ok(Self { name, object })
    }

    fn receive(&mut self, port: usize, message: &Message, output: &Output<Ports>) -> Result<(), StageError> {
        let (header, wire) = (message.header(), message.wire());
        let (robot, topic) = (header.robot.as_str(), header.topic.as_str());
        let called = self.call("receive", output, |py| {
            (port, robot, header.log_time.0, topic, wire, PyBytes::new(py, message.bytes())).into_pyobject(py)
        });
        called.map(drop)
    }

    fn abort(&mut self, reason: &str) {
        // The run has failed already.
        Python::attach(|py| drop(self.object.call_method1(py, "abort", (reason,))));
    }

    /// Calls a method, and forwards what it sends. Returns whether a source has ended.
    fn call(
        &self,
        method: &str,
        output: &Output<Ports>,
        arguments: impl for<'py> FnOnce(Python<'py>) -> PyResult<Bound<'py, PyTuple>>,
    ) -> Result<bool, StageError> {
        let called: Result<Sent, String> = Python::attach(|py| {
            let call = || self.object.bind(py).call_method1(method, arguments(py)?)?.extract();
            call().map_err(|error: PyErr| text_of(py, &error))
        });
        let (sent, warnings, has_ended) = called
            .map_err(|text| StageError::new(format!("call `{method}` of the stage `{}` in Python", self.name), text))?;
        warnings.into_iter().for_each(|warning| output.warn(warning));
        for (port, robot, log_time, bytes) in sent {
            let Some(port) = output.0.get(port) else { continue };
            // Of a source; messages of other stages have the log time of the message that is handled.
            if log_time > output.log_time().0 {
                output.set_log_time(LogTime(log_time));
            }
            port.send_bytes(&robot, &bytes)?;
        }
        Ok(has_ended)
    }
}

impl Source for PythonStage {
    type Outputs = Ports;

    fn next(&mut self, output: &Output<Ports>) -> Result<bool, StageError> {
        self.call("advance", output, |py| Ok(PyTuple::empty(py))).map(|has_ended| !has_ended)
    }

    fn abort(&mut self, reason: &str) {
        Self::abort(self, reason);
    }
}

/// An exception with its traceback.
fn text_of(py: Python<'_>, error: &PyErr) -> String {
    let traceback = error.traceback(py).and_then(|traceback| traceback.format().ok()).unwrap_or_default();
    format!("{error}\n{}", traceback.trim_end())
}
