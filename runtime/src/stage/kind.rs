//! Stage kinds: what a stage looks like from outside, and how one is made.

use super::{Context, ParameterError, Parameters, Source, Stage, StageError};
use crate::ros::RosMessage;
use schemars::Schema;
use std::fmt;
use std::sync::Arc;

/// The type of the messages of a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PortType {
    /// One ROS 2 type, by name.
    Ros(&'static str),
    /// Any: each message's channel says what it is.
    Any,
}

impl PortType {
    /// The port type of `T`.
    pub const fn of<T: RosMessage>() -> Self {
        Self::Ros(T::NAME)
    }
}

impl fmt::Display for PortType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Ros(name) => name,
            Self::Any => "any",
        })
    }
}

/// An input of a stage kind.
#[derive(Clone, Debug)]
pub struct InputPort {
    /// Its name.
    pub name: &'static str,
    /// The type it takes.
    pub port_type: PortType,
    /// Whether any number of outputs may be wired to it; otherwise it is one.
    pub many: bool,
    /// Whether it may be left unwired.
    pub optional: bool,
    /// What it is for.
    pub summary: &'static str,
}

impl InputPort {
    /// An input that must be wired to one output.
    pub const fn one(name: &'static str, port_type: PortType, summary: &'static str) -> Self {
        Self { name, port_type, many: false, optional: false, summary }
    }

    /// An input that any number of outputs may be wired to, but at least one.
    pub const fn many(name: &'static str, port_type: PortType, summary: &'static str) -> Self {
        Self { name, port_type, many: true, optional: false, summary }
    }

    /// The same input, which may be left unwired.
    #[must_use]
    pub const fn or_none(mut self) -> Self {
        self.optional = true;
        self
    }
}

/// An output of a stage kind.
#[derive(Clone, Debug)]
pub struct OutputPort {
    /// Its name.
    pub name: &'static str,
    /// The type it gives.
    pub port_type: PortType,
    /// The topic that its messages get in a log, where it is not `/{robot}/{stage}/{port}`; `{robot}` and `{stage}`
    /// are put in.
    pub topic: Option<&'static str>,
    /// What it carries.
    pub summary: &'static str,
}

impl OutputPort {
    /// An output whose messages get the topic `/{robot}/{stage}/{port}` or, if they are about no robot in particular,
    /// `/{stage}/{port}`.
    pub const fn new(name: &'static str, port_type: PortType, summary: &'static str) -> Self {
        Self { name, port_type, topic: None, summary }
    }

    /// The same output, with a topic of its own.
    #[must_use]
    pub const fn on_topic(mut self, topic: &'static str) -> Self {
        self.topic = Some(topic);
        self
    }
}

/// A stage, ready to run.
pub enum Node {
    /// It has inputs.
    Stage(Box<dyn Stage>),
    /// It has none.
    Source(Box<dyn Source>),
    /// It has none, and its messages come from outside of the run.
    External,
}

type CheckFn = dyn Fn(&toml::Table) -> Result<Vec<ParameterError>, toml::de::Error> + Send + Sync;
type MakeFn = dyn Fn(toml::Table, &Context) -> Result<Node, StageError> + Send + Sync;

/// A kind of stage: its name, ports and parameters, and how to make one.
#[derive(Clone)]
pub struct StageKind {
    /// The name in `kind = "..."`.
    pub name: &'static str,
    /// What it does, in a sentence or a few.
    pub summary: &'static str,
    /// Its inputs, in the order that breaks ties between messages of one log time. Empty for a source.
    pub inputs: Vec<InputPort>,
    /// Its outputs.
    pub outputs: Vec<OutputPort>,
    external: bool,
    schema: Schema,
    check: Arc<CheckFn>,
    make: Arc<MakeFn>,
}

impl StageKind {
    /// A kind of stage with parameters `P`.
    pub fn stage<P, S>(
        name: &'static str,
        summary: &'static str,
        inputs: Vec<InputPort>,
        outputs: Vec<OutputPort>,
        make: impl Fn(P, &Context) -> Result<S, StageError> + Send + Sync + 'static,
    ) -> Self
    where
        P: Parameters,
        S: Stage + 'static,
    {
        Self::with::<P>(name, summary, inputs, outputs, move |parameters, context| {
            Ok(Node::Stage(Box::new(make(parameters, context)?)))
        })
    }

    /// A kind of source with parameters `P`.
    pub fn source<P, S>(
        name: &'static str,
        summary: &'static str,
        outputs: Vec<OutputPort>,
        make: impl Fn(P, &Context) -> Result<S, StageError> + Send + Sync + 'static,
    ) -> Self
    where
        P: Parameters,
        S: Source + 'static,
    {
        Self::with::<P>(name, summary, Vec::new(), outputs, move |parameters, context| {
            Ok(Node::Source(Box::new(make(parameters, context)?)))
        })
    }

    /// A kind of source whose messages come from outside of a live run: from programs that send on its outputs.
    pub fn external<P: Parameters>(name: &'static str, summary: &'static str, outputs: Vec<OutputPort>) -> Self {
        let kind = Self::with::<P>(name, summary, Vec::new(), outputs, |_, _| Ok(Node::External));
        Self { external: true, ..kind }
    }

    /// Whether its messages come from outside of the run.
    pub fn is_external(&self) -> bool {
        self.external
    }

    fn with<P: Parameters>(
        name: &'static str,
        summary: &'static str,
        inputs: Vec<InputPort>,
        outputs: Vec<OutputPort>,
        make: impl Fn(P, &Context) -> Result<Node, StageError> + Send + Sync + 'static,
    ) -> Self {
        Self {
            name,
            summary,
            inputs,
            outputs,
            external: false,
            schema: schemars::schema_for!(P),
            check: Arc::new(|table| Ok(P::deserialize(table.clone())?.check())),
            make: Arc::new(move |table, context| {
                let doing = || format!("read the parameters of stage `{}`", context.stage);
                let parameters = P::deserialize(table).map_err(|error| StageError::new(doing(), error.message()))?;
                if let Some(error) = parameters.check().first() {
                    return Err(StageError::new(doing(), error));
                }
                make(parameters, context)
            }),
        }
    }

    /// The JSON schema of the parameters: names, types, defaults and the doc comments of the code.
    pub fn parameter_schema(&self) -> &Schema {
        &self.schema
    }

    /// Checks parameters, any of which may be left out: an error if they do not have the right types, and otherwise
    /// every value that is out of its range.
    pub fn check_parameters(&self, table: &toml::Table) -> Result<Vec<ParameterError>, toml::de::Error> {
        (self.check)(table)
    }

    /// Makes a stage of this kind.
    pub fn make(&self, parameters: toml::Table, context: &Context) -> Result<Node, StageError> {
        (self.make)(parameters, context)
    }
}

impl fmt::Debug for StageKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("StageKind").field("name", &self.name).finish_non_exhaustive()
    }
}
