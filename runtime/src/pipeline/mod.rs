//! Pipelines: which stages there are, and which output feeds which input.
//!
//! A pipeline is a TOML file:
//!
//! ```toml
//! [pipeline]
//! name = "walls"
//! reference = "robot1"            # whose map frame is the world; the first robot by name if left out
//! seed = 7                        # seeds all randomness; 0 if left out
//! depth = 16                      # how many samples an input may hold before the sender waits
//! batch = true                    # gather small messages in one sample; false sends each at once
//! stall_timeout = 60.0            # a stage that works for so long on one message hangs, seconds; 0 waits for ever
//! memory_limit = 2_000_000_000    # how much memory a process may take, bytes; 0 sets no limit
//!
//! [robots]                        # how topics are told apart; `{robot}` is any one part of a path
//! map = "/{robot}/map"
//!
//! [robots.robot2]                 # what is known of one robot
//! initial = { x = 5.0, y = 3.0, yaw = 1.57, stddev = 1.0, yaw_stddev = 0.2 }  # where its map frame lies, about
//!
//! [stages.log]
//! kind = "mcap_source"
//! files = ["a.mcap"]              # any key that this page does not name is a parameter
//!
//! [stages.lines]
//! kind = "line_extractor"
//! inputs = ["log.map"]            # STAGE.PORT, or STAGE where it has one output only
//! topics = { segments = "/{robot}/walls" }
//! process = "geometry"            # stages of one name share a process; by default each has its own
//!
//! [stages.out]
//! kind = "mcap_sink"
//! inputs = { in = ["log.*", "lines"] }    # by port; `*` is all outputs
//! ```
//!
//! A pipeline with `mode = "live"` in `[pipeline]` takes messages as they arrive, until the user ends it. Its stages may
//! say more:
//!
//! ```toml
//! [stages.robots]
//! kind = "live_source"
//! overflow = { pose = "drop_oldest" }     # what an output does that a reader has no room for; "wait" if left out
//!
//! [stages.lines]
//! kind = "line_extractor"
//! inputs = ["robots.map"]
//! overflow = "drop_oldest"                # of all outputs
//! restart = "on_failure"                  # start it again when it fails; "never" ends the run, and is the default
//! ```
//!
//! In a list of inputs each entry feeds the first input port that is still free and of exactly its type or, failing
//! that, of any type. [`Pipeline::load`] checks all of it and shows everything that is wrong at once.

mod attach;
mod binding;
mod diagnostic;
mod document;
mod drawing;
mod initial_poses;
mod kinds;
mod link_names;
mod live;
mod load;
mod nearest;
mod order;
mod overrides;
mod parameter_schema;
mod parameters;
mod reference;
mod settings;
mod single_stage;
mod stage_section;
mod tag_fields;
#[cfg(test)]
mod test_kinds;
#[cfg(test)]
mod tests;
mod text_layout;
mod topics;
mod values;
mod wiring;
mod write;

pub use diagnostic::PipelineErrors;
pub use kinds::{kind_json, kind_text, kinds_json, kinds_text};
pub use link_names::{named_link, named_links};
pub use live::{Mode, Overflow, Restart};
pub use nearest::{quoted_list, suggest};
pub use overrides::{Overrides, SettingError};
pub use parameter_schema::{ParameterInfo, parameters_of};
pub use settings::{DEFAULT_DEPTH, MAX_DEPTH};
pub use single_stage::SingleStage;
pub use text_layout::{TEXT_WIDTH, fill};

use crate::stage::{Context, InitialPoses, InputWire, RobotTopics, StageKind};
use std::time::Duration;

/// A pipeline that has passed every check: each stage's kind exists, each wire's ends exist and agree in type, and
/// there is no cycle.
#[derive(Clone, Debug)]
pub struct Pipeline {
    /// Its name.
    pub name: String,
    /// Whether it replays logs or runs live.
    pub mode: Mode,
    /// The robot whose map frame is the world; if none is given, the first by name when the first two are merged.
    pub reference: Option<String>,
    /// Seeds all randomness.
    pub seed: u64,
    /// Whether small messages are gathered and sent together. It saves wake-ups where many are sent at a time; without
    /// it each is on its way at once.
    pub batch: bool,
    /// A stage that works for longer on one message hangs, which ends the run: on the engine `processes`, as a thread
    /// cannot be ended. None waits for ever.
    pub stall_timeout: Option<Duration>,
    /// How much memory each process may take for itself on the engine `processes`, bytes; none sets no limit.
    pub memory_limit: Option<u64>,
    /// How topics are told apart.
    pub robots: RobotTopics,
    /// Where the user knows the maps of robots to lie; where there are any, that of the reference among them.
    pub initial_poses: InitialPoses,
    /// The stages, each behind those that feed it; among those that could be next, by name.
    pub stages: Vec<StageSpec>,
}

/// One stage of a pipeline.
#[derive(Clone, Debug)]
pub struct StageSpec {
    /// Its name.
    pub name: String,
    /// Its kind.
    pub kind: StageKind,
    /// Its parameters, those of them that are given.
    pub parameters: toml::Table,
    /// Its inputs, by input port and, within a port that takes many, in the order of the file. The place in this list
    /// breaks ties between messages of one log time.
    pub inputs: Vec<Wire>,
    /// For every output port of the kind: the topic of its messages in a log, with `{robot}` for the robot's name.
    pub topics: Vec<String>,
    /// How many samples each of its inputs may hold before the sender waits.
    pub depth: usize,
    /// The process that it runs in, on the engine `processes`. Stages that name the same one share it.
    pub process: String,
    /// For every output port of the kind: what becomes of a message for which a reader has no room. A live pipeline
    /// only: a replay waits.
    pub overflow: Vec<Overflow>,
    /// What becomes of the run when the stage fails. A live pipeline only.
    pub restart: Restart,
}

/// What feeds one input of a stage.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wire {
    /// The input port, as an index among the kind's input ports.
    pub port: usize,
    /// The stage that it comes from, as an index among the pipeline's stages.
    pub from_stage: usize,
    /// The output port of that stage, as an index among its kind's output ports.
    pub from_port: usize,
}

impl Pipeline {
    /// The processes that the stages are placed in, in the order of their first stages.
    pub fn processes(&self) -> Vec<String> {
        let mut processes: Vec<String> = Vec::new();
        for stage in &self.stages {
            if !processes.contains(&stage.process) {
                processes.push(stage.process.clone());
            }
        }
        processes
    }

    /// The indexes of the stages that are placed in a process.
    pub fn stages_of(&self, process: &str) -> Vec<usize> {
        let placed = self.stages.iter().enumerate().filter(|(_, stage)| stage.process == process);
        placed.map(|(index, _)| index).collect()
    }

    /// What the stage with the given index is told when it is made.
    pub fn context(&self, stage: usize) -> Context {
        let spec = &self.stages[stage];
        Context {
            stage: spec.name.clone(),
            seed: stage_seed(self.seed, &spec.name),
            reference: self.reference.clone(),
            robots: self.robots.clone(),
            initial_poses: self.initial_poses.clone(),
            inputs: spec.inputs.iter().map(|wire| self.input_wire(spec, wire)).collect(),
            stall_timeout: self.stall_timeout,
            statistics: None,
            links: None,
        }
    }

    /// What a stage is told of a wire to it.
    fn input_wire(&self, spec: &StageSpec, wire: &Wire) -> InputWire {
        let from = &self.stages[wire.from_stage];
        let topic = match from.kind.inputs.is_empty() {
            true => String::new(),
            false => from.topics.get(wire.from_port).cloned().unwrap_or_default(),
        };
        let output = &from.kind.outputs[wire.from_port];
        let ros_type = output.port_type.name().to_owned();
        let port = spec.kind.inputs[wire.port].name;
        let definition = from.kind.definition(&ros_type).unwrap_or_default().to_owned();
        InputWire { port, from: from.name.clone(), output: output.name, ros_type, definition, topic }
    }
}

/// The seed of a stage: FNV-1a over the pipeline's seed and the stage's name, so that adding a stage changes no other.
fn stage_seed(seed: u64, name: &str) -> u64 {
    let bytes = seed.to_le_bytes().into_iter().chain(name.bytes());
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3))
}
