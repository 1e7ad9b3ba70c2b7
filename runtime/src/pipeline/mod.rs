//! Pipelines: the stages, and the wires from outputs to inputs.
//!
//! A pipeline is a TOML file:
//!
//! ```toml
//! [pipeline]
//! name = "walls"
//! reference = "robot1"            # the robot whose map frame is the world; default: the first by name
//! seed = 7                        # the seed of all randomness; default: 0
//! depth = 16                      # the samples that an input can queue before the sender waits
//! batch = true                    # send small messages in batches; false sends each at once
//! stall_timeout = 60.0            # the maximum time of a stage for one message, seconds; 0: unlimited
//! memory_limit = 2_000_000_000    # the maximum memory of a process, bytes; 0: unlimited
//! same_time_limit = 2_000_000_000 # the maximum memory of an input's messages that all have one log time, bytes
//!
//! [robots]                        # the topics of the robots; `{robot}` matches one part of a path
//! map = "/{robot}/map"
//!
//! [robots.robot2]                 # settings of one robot
//! initial = { x = 5.0, y = 3.0, yaw = 1.57, stddev = 1.0, yaw_stddev = 0.2 }  # the approximate pose of its map frame
//!
//! [stages.log]
//! kind = "mcap_source"
//! files = ["a.mcap"]              # every key that is not in this example is a parameter
//!
//! [stages.lines]
//! kind = "line_extractor"
//! inputs = ["log.map"]            # STAGE.PORT, or STAGE if it has only one output
//! topics = { segments = "/{robot}/walls" }
//! process = "geometry"            # stages with the same name share a process; by default each has its own
//!
//! [stages.out]
//! kind = "mcap_sink"
//! inputs = { in = ["log.*", "lines"] }    # by port; `*` means all outputs
//! ```
//!
//! A pipeline with `mode = "live"` in `[pipeline]` handles messages as they arrive, until the user ends it. Its stages
//! have more settings:
//!
//! ```toml
//! [stages.robots]
//! kind = "live_source"
//! overflow = { pose = "drop_oldest" }     # what an output does without credit of a reader; default: "wait"
//!
//! [stages.lines]
//! kind = "line_extractor"
//! inputs = ["robots.map"]
//! overflow = "drop_oldest"                # for all outputs
//! restart = "on_failure"                  # restart it when it fails; the default "never" ends the run
//! ```
//!
//! In a list of inputs each entry feeds the first free input port of exactly its type or, if there is none, of any
//! type. [`Pipeline::load`] checks the whole file and reports all errors at once.

mod attach;
mod binding;
mod diagnostic;
mod diagrams;
mod document;
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
pub use nearest::{list_in_words, quoted_list, suggest};
pub use overrides::{Overrides, SettingError};
pub use parameter_schema::{ParameterInfo, parameters_of};
pub use settings::{DEFAULT_DEPTH, DEFAULT_SAME_TIME_LIMIT, MAX_DEPTH};
pub use single_stage::SingleStage;
pub use text_layout::{TEXT_WIDTH, wrap_words};

use crate::stage::{Context, InitialPoses, InputWire, RobotTopics, StageKind};
use std::time::Duration;

/// A valid pipeline: the kind of each stage exists, the two ends of each wire exist and have the same type, and there
/// is no cycle.
#[derive(Clone, Debug)]
pub struct Pipeline {
    /// The name of the pipeline.
    pub name: String,
    /// Whether it replays logs or runs live.
    pub mode: Mode,
    /// The robot whose map frame is the world; if none, the first by name at the time when the first two maps are
    /// merged.
    pub reference: Option<String>,
    /// The seed of all randomness.
    pub seed: u64,
    /// Whether small messages are sent in batches. This saves wake-ups; without it each message is sent at once.
    pub batch: bool,
    /// The maximum time of a stage for one message; none if unlimited. A stage that exceeds it hangs, which ends the
    /// run. Only on the engine `processes`, because a thread cannot be killed.
    pub stall_timeout: Option<Duration>,
    /// The maximum private memory of each process on the engine `processes`, bytes; none if unlimited.
    pub memory_limit: Option<u64>,
    /// The maximum memory of an input's pending messages that all have the same log time, bytes. Where an earlier input
    /// may still bring a message of that time, all of them wait, however small the depth.
    pub same_time_limit: u64,
    /// The topic patterns of the robots.
    pub robots: RobotTopics,
    /// The poses of robots' maps that the user knows; if there are any, that of the reference is among them.
    pub initial_poses: InitialPoses,
    /// The stages in topological order, each after those that feed it; ties are broken by name.
    pub stages: Vec<StageSpec>,
}

/// A stage of a pipeline.
#[derive(Clone, Debug)]
pub struct StageSpec {
    /// Its name.
    pub name: String,
    /// Its kind.
    pub kind: StageKind,
    /// The given parameters.
    pub parameters: toml::Table,
    /// Its inputs, by input port and, within a port, in the order of the file. The index in this list breaks ties
    /// between messages with the same log time.
    pub inputs: Vec<Wire>,
    /// The topic of each output port's messages in a log, with `{robot}` for the robot's name.
    pub topics: Vec<String>,
    /// The samples that each of its inputs can queue before the sender waits.
    pub depth: usize,
    /// The process that it runs in, on the engine `processes`. Stages with the same one share it.
    pub process: String,
    /// What each output port does with a message for which a reader has granted no credit. Only for a live pipeline: a
    /// replay waits.
    pub overflow: Vec<Overflow>,
    /// What happens when the stage fails. Only for a live pipeline.
    pub restart: Restart,
}

/// A wire from an output to an input of a stage.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wire {
    /// The input port, as an index among the kind's input ports.
    pub port: usize,
    /// The sending stage, as an index among the pipeline's stages.
    pub from_stage: usize,
    /// The output port of that stage, as an index among its kind's output ports.
    pub from_port: usize,
}

impl Pipeline {
    /// The processes of the stages, in the order of their first stages.
    pub fn processes(&self) -> Vec<String> {
        let mut processes: Vec<String> = Vec::new();
        for stage in &self.stages {
            if !processes.contains(&stage.process) {
                processes.push(stage.process.clone());
            }
        }
        processes
    }

    /// The indexes of the stages of a process.
    pub fn stages_of(&self, process: &str) -> Vec<usize> {
        let placed = self.stages.iter().enumerate().filter(|(_, stage)| stage.process == process);
        placed.map(|(index, _)| index).collect()
    }

    /// The context of the stage with the given index.
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

    /// The description of a wire in the context of the reading stage.
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

/// The seed of a stage: FNV-1a over the pipeline's seed and the stage's name, so that adding a stage does not change
/// the seeds of others.
fn stage_seed(seed: u64, name: &str) -> u64 {
    let bytes = seed.to_le_bytes().into_iter().chain(name.bytes());
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3))
}
