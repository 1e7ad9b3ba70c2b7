//! Stage kinds: the interface of a stage, and how one is created.

use super::builder::StageBuilder;
use super::json_schema;
use super::node::{Node, Role, RunningSource};
use super::{
    Context, InputPort, Output, OutputEnd, OutputPort, OutputPorts, Outputs, ParameterError, Parameters, StageError,
};
use schemars::Schema;
use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// The keys of a stage's table in a pipeline file that are not parameters.
pub(crate) const RESERVED_KEYS: [&str; 7] = ["kind", "inputs", "topics", "depth", "process", "overflow", "restart"];

type CheckFn = dyn Fn(&toml::Table) -> Result<Vec<ParameterError>, toml::de::Error> + Send + Sync;
type MakeFn = dyn Fn(toml::Table, &Context, OutputPorts) -> Result<Node, StageError> + Send + Sync;
type ResolveFn = dyn Fn(&toml::Table, &Path) -> Result<ResolvedStage, ParameterError> + Send + Sync;

/// A kind of stage: its name, ports and parameters, and how to create one.
#[derive(Clone)]
pub struct StageKind {
    /// The name in `kind = "..."`.
    pub name: &'static str,
    /// What it does, in one or a few sentences.
    pub summary: &'static str,
    /// Its inputs, in the order that breaks ties between messages of one log time. Empty for a source.
    pub inputs: Vec<InputPort>,
    /// Its outputs.
    pub outputs: Vec<OutputPort>,
    /// The definitions of custom message types, by name.
    definitions: BTreeMap<String, String>,
    external: bool,
    live_only: bool,
    schema: Schema,
    check: Arc<CheckFn>,
    make: Arc<MakeFn>,
    resolve: Option<Arc<ResolveFn>>,
}

/// The kind and the parameters of a stage of a dynamic kind, whose ports depend on its parameters.
#[derive(Clone, Debug)]
pub struct ResolvedStage {
    /// The resolved kind, which is never freed.
    pub kind: &'static StageKind,
    /// Parameters that replace the given ones, such as a path made absolute.
    pub parameters: toml::Table,
}

/// A stage without inputs, which produces messages.
pub trait Source: 'static {
    /// Its output ports.
    type Outputs: Outputs;

    /// Sends the next message or the next few, in order of log time over all ports. Returns `false` when there are no
    /// more.
    fn next(&mut self, output: &Output<Self::Outputs>) -> Result<bool, StageError>;

    /// Waits until there is something to send, for at most `longest`; for sources whose messages come from outside of
    /// the run. Called before each [`next`](Self::next) in a live run. It does not count as working time.
    fn wait(&mut self, _longest: Duration) {}

    /// Sends what the source still holds. Called once, when a live run is asked to end.
    ///
    /// # Errors
    /// A link has failed.
    fn finish(&mut self, _output: &Output<Self::Outputs>) -> Result<(), StageError> {
        Ok(())
    }

    /// The share of its work that is done, 0 to 1, if known.
    fn progress(&self) -> Option<f64> {
        None
    }

    /// Handles a failure of the run. It should leave output files usable.
    fn abort(&mut self, _reason: &str) {}
}

impl StageKind {
    /// A builder of a stage kind with parameters `P`, state `S` and outputs `O`. `make` creates the state from the
    /// parameters; inputs and their handlers are added to the builder.
    pub fn stage<P, S, O>(
        name: &'static str,
        summary: &'static str,
        make: impl Fn(P, &Context) -> Result<S, StageError> + Send + Sync + 'static,
    ) -> StageBuilder<P, S, O>
    where
        P: Parameters,
        S: 'static,
        O: Outputs,
    {
        StageBuilder::new(name, summary, O::declare, make)
    }

    /// The same for a kind whose outputs are known only at run time: `declare` declares them.
    pub fn stage_with<P, S, O>(
        name: &'static str,
        summary: &'static str,
        declare: impl Fn(&mut OutputPorts) -> O + Send + Sync + 'static,
        make: impl Fn(P, &Context) -> Result<S, StageError> + Send + Sync + 'static,
    ) -> StageBuilder<P, S, O>
    where
        P: Parameters,
        S: 'static,
        O: 'static,
    {
        StageBuilder::new(name, summary, declare, make)
    }

    /// A kind of source with parameters `P`.
    pub fn source<P, S>(
        name: &'static str,
        summary: &'static str,
        make: impl Fn(P, &Context) -> Result<S, StageError> + Send + Sync + 'static,
    ) -> Self
    where
        P: Parameters,
        S: Source,
    {
        Self::source_with(name, summary, S::Outputs::declare, make)
    }

    /// A kind of source whose outputs are known only at run time: `declare` declares them.
    pub fn source_with<P, S>(
        name: &'static str,
        summary: &'static str,
        declare: impl Fn(&mut OutputPorts) -> S::Outputs + Send + Sync + 'static,
        make: impl Fn(P, &Context) -> Result<S, StageError> + Send + Sync + 'static,
    ) -> Self
    where
        P: Parameters,
        S: Source,
    {
        let mut declared = OutputPorts::default();
        drop(declare(&mut declared));
        let make = move |parameters, context: &Context, mut ports: OutputPorts| {
            let outputs = declare(&mut ports);
            let output = ports.bind(outputs);
            let source = make(parameters, context)?;
            Ok(Node { role: Role::Source(Box::new(Running { source, output })), sent: ports.counted() })
        };
        Self::new::<P>(name, summary, Vec::new(), declared.into_declared(), make)
    }

    /// A kind of external source of a live run: programs outside of the run send on its outputs `O`.
    pub fn external<O: Outputs>(name: &'static str, summary: &'static str) -> Self {
        let mut declared = OutputPorts::default();
        drop(O::declare(&mut declared));
        let make = |(), _: &Context, mut ports: OutputPorts| {
            drop(O::declare(&mut ports));
            Ok(Node { role: Role::External, sent: ports.counted() })
        };
        let kind = Self::new::<()>(name, summary, Vec::new(), declared.into_declared(), make);
        Self { external: true, ..kind }.live_only()
    }

    pub(super) fn new<P: Parameters>(
        name: &'static str,
        summary: &'static str,
        inputs: Vec<InputPort>,
        outputs: Vec<OutputPort>,
        make: impl Fn(P, &Context, OutputPorts) -> Result<Node, StageError> + Send + Sync + 'static,
    ) -> Self {
        Self {
            name,
            summary,
            inputs,
            outputs,
            definitions: BTreeMap::new(),
            external: false,
            resolve: None,
            live_only: false,
            schema: P::schema(),
            check: Arc::new(|table| Ok(P::read(table.clone())?.check())),
            make: Arc::new(move |table, context, ports| {
                let doing = || format!("read the parameters of stage `{}`", context.stage);
                let parameters = P::read(table).map_err(|error| StageError::new(doing(), error.message()))?;
                if let Some(error) = parameters.check().first() {
                    return Err(StageError::new(doing(), error));
                }
                make(parameters, context, ports)
            }),
        }
    }

    /// A kind whose stages differ in ports and parameters, which only the program behind each of them knows: `ask`
    /// finds them out from the parameters that are given and the folder that paths among them begin at. `P` are those
    /// that all have.
    pub fn dynamic<P: Parameters>(
        name: &'static str,
        summary: &'static str,
        resolve: impl Fn(&toml::Table, &Path) -> Result<ResolvedStage, ParameterError> + Send + Sync + 'static,
    ) -> Self {
        let resolve: Arc<ResolveFn> = Arc::new(resolve);
        let resolve_now = Arc::clone(&resolve);
        let make = move |mut table: toml::Table, context: &Context, ports| {
            let failed = |error| StageError::new(format!("make stage `{}`", context.stage), error);
            let ResolvedStage { kind, parameters } = resolve_now(&table, Path::new("")).map_err(failed)?;
            table.extend(parameters);
            (kind.make)(table, context, ports)
        };
        Self {
            name,
            summary,
            inputs: Vec::new(),
            outputs: Vec::new(),
            definitions: BTreeMap::new(),
            external: false,
            live_only: false,
            schema: P::schema(),
            check: Arc::new(|table| Ok(P::read(table.clone())?.check())),
            make: Arc::new(make),
            resolve: Some(resolve),
        }
    }

    /// Whether each stage of the kind has ports and parameters of its own, which it must be asked for.
    pub fn is_dynamic(&self) -> bool {
        self.resolve.is_some()
    }

    /// What the stage with the given parameters is, where each has ports and parameters of its own; paths among them
    /// begin at `folder`. None for every other kind.
    ///
    /// # Errors
    /// The parameters do not lead to a stage.
    pub fn resolve(&self, parameters: &toml::Table, folder: &Path) -> Option<Result<ResolvedStage, ParameterError>> {
        self.resolve.as_ref().map(|resolve| resolve(parameters, folder))
    }

    /// The same kind with parameters that are described and checked by a JSON schema.
    #[must_use]
    pub fn with_schema(self, schema: Schema) -> Self {
        let described = schema.clone();
        Self { schema, check: Arc::new(move |table| json_schema::check(&described, table)), ..self }
    }

    /// The same kind with the definitions of the custom message types of its ports: texts in the format `ros2msg`, by
    /// name, as log formats store them.
    #[must_use]
    pub fn with_definitions(self, definitions: BTreeMap<String, String>) -> Self {
        Self { definitions, ..self }
    }

    /// The definition of a message type, if the kind has one.
    pub fn definition(&self, ros_type: &str) -> Option<&str> {
        self.definitions.get(ros_type).map(String::as_str)
    }

    /// The same kind for live pipelines only: a source that waits for messages from outside, and has no end.
    #[must_use]
    pub fn live_only(self) -> Self {
        Self { live_only: true, ..self }
    }

    /// Whether it is for live pipelines only.
    pub fn is_live_only(&self) -> bool {
        self.live_only
    }

    /// Whether it is an external source: programs outside of the run send its messages.
    pub fn is_external(&self) -> bool {
        self.external
    }

    /// The JSON schema of the parameters: names, types, defaults and the doc comments of the code.
    pub fn parameter_schema(&self) -> &Schema {
        &self.schema
    }

    /// The parameters whose names are reserved keys of a stage's table in a pipeline file, by name.
    pub(crate) fn shadowed_parameters(&self) -> impl Iterator<Item = &str> {
        let properties = self.schema.get("properties").and_then(serde_json::Value::as_object);
        let mut names: Vec<&str> = properties.into_iter().flat_map(|all| all.keys().map(String::as_str)).collect();
        names.retain(|name| RESERVED_KEYS.contains(name));
        names.sort_unstable();
        names.into_iter()
    }

    /// Checks parameters, all of which are optional, and returns every value that is out of its range.
    ///
    /// # Errors
    /// A parameter has the wrong type.
    pub fn check_parameters(&self, table: &toml::Table) -> Result<Vec<ParameterError>, toml::de::Error> {
        (self.check)(table)
    }

    /// Creates a stage of this kind. Its output ports are connected to `ends` in order; further ports are not
    /// connected.
    ///
    /// # Errors
    /// The parameters are wrong, or the stage cannot be created.
    pub fn make(&self, parameters: toml::Table, context: &Context, ends: Vec<OutputEnd>) -> Result<Node, StageError> {
        (self.make)(parameters, context, OutputPorts::connected_to(ends))
    }
}

impl fmt::Debug for StageKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("StageKind").field("name", &self.name).finish_non_exhaustive()
    }
}

struct Running<S: Source> {
    source: S,
    output: Output<S::Outputs>,
}

impl<S: Source> RunningSource for Running<S> {
    fn next(&mut self) -> Result<bool, StageError> {
        self.source.next(&self.output)
    }

    fn wait(&mut self, longest: Duration) {
        self.source.wait(longest);
    }

    fn finish(&mut self) -> Result<(), StageError> {
        self.source.finish(&self.output)
    }

    fn progress(&self) -> Option<f64> {
        self.source.progress()
    }

    fn abort(&mut self, reason: &str) {
        self.source.abort(reason);
    }
}
