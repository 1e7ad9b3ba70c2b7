//! Small stage kinds for the tests of this module.

use crate::message::Message;
use crate::stage::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

const GRID: PortType = PortType::Ros("nav_msgs/msg/OccupancyGrid");
const POSE: PortType = PortType::Ros("geometry_msgs/msg/PoseStamped");
const SEGMENTS: PortType = PortType::Ros("gridweave_msgs/msg/Segments");
const ALIGNMENT: PortType = PortType::Ros("gridweave_msgs/msg/Alignment");

/// Stands for every stage: it does nothing.
struct Idle;

impl Stage for Idle {
    fn receive(&mut self, _port: usize, _message: &Message, _output: &mut Output<'_>) -> Result<(), StageError> {
        Ok(())
    }
}

impl Source for Idle {
    fn next(&mut self, _output: &mut Output<'_>) -> Result<bool, StageError> {
        Ok(false)
    }
}

/// No parameters.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct None_ {}

impl Parameters for None_ {}

#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct Files {
    /// The logs to read, in this order.
    files: Vec<String>,
    /// Seconds to leave out at the start.
    start: Option<f64>,
}

impl Parameters for Files {}

#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct File {
    /// The log to write.
    file: String,
}

impl Parameters for File {}

/// How angles are averaged.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Mean {
    /// Over four times the angle, which knows no wrap.
    #[default]
    Circular,
    /// Of two groups of segments.
    Groups,
}

#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct Lines {
    /// Segments shorter than this are dropped, in metres. The
    /// paper: 30 px.
    min_length: f64,
    /// The number of iterations.
    iterations: u32,
    /// How the segments' angles are averaged.
    mean: Mean,
    /// Whether to join segments.
    merge: bool,
    /// Starts that are tried, in radians.
    starts: Vec<f64>,
}

impl Default for Lines {
    fn default() -> Self {
        Self { min_length: 0.6, iterations: 200, mean: Mean::Circular, merge: true, starts: Vec::new() }
    }
}

impl Parameters for Lines {
    fn check(&self) -> Vec<ParameterError> {
        let mut errors = Vec::new();
        if self.min_length.is_nan() || self.min_length <= 0.0 {
            errors.push(ParameterError::new("min_length", "must be above 0 m"));
        }
        if self.iterations == 0 {
            errors.push(ParameterError::new("iterations", "must be at least 1"));
        }
        errors
    }
}

fn stage<P: Parameters>(
    name: &'static str,
    summary: &'static str,
    inputs: Vec<InputPort>,
    outputs: Vec<OutputPort>,
) -> StageKind {
    StageKind::stage(name, summary, inputs, outputs, |_: P, _| Ok(Idle))
}

/// Kinds that look like those of the tag pipeline from outside.
pub(super) fn registry() -> Registry {
    let log = StageKind::source(
        "mcap_source",
        "Reads logs.",
        vec![
            OutputPort::new("map", GRID, "Maps."),
            OutputPort::new("pose", POSE, "Poses."),
            OutputPort::new("other", PortType::Any, "All else."),
        ],
        |_: Files, _| Ok(Idle),
    );
    Registry::new([
        log,
        stage::<Lines>(
            "line_extractor",
            "Finds straight walls.",
            vec![InputPort::one("map", GRID, "Maps.")],
            vec![OutputPort::new("segments", SEGMENTS, "Walls.")],
        ),
        stage::<None_>(
            "aligner",
            "Aligns maps by their walls.",
            vec![
                InputPort::one("map", GRID, "Maps."),
                InputPort::one("segments", SEGMENTS, "Walls."),
                InputPort::one("guess", ALIGNMENT, "A first guess.").or_none(),
            ],
            vec![OutputPort::new("alignment", ALIGNMENT, "How the maps lie.")],
        ),
        stage::<None_>(
            "fuser",
            "Fuses maps.",
            vec![InputPort::one("map", GRID, "Maps."), InputPort::many("alignment", ALIGNMENT, "How they lie.")],
            vec![OutputPort::new("map", GRID, "The merged map.").on_topic("/map")],
        ),
        stage::<File>(
            "mcap_sink",
            "Writes a log.",
            vec![InputPort::many("in", PortType::Any, "What to write.")],
            vec![],
        ),
    ])
}

/// A pipeline without errors.
pub(super) const VALID: &str = r#"# Aligns maps by their walls.
[pipeline]
name = "walls"
reference = "robot1"
seed = 7

[robots]
map = "/{robot}/map"

[stages.log]
kind = "mcap_source"
files = ["a.mcap"]

[stages.lines]
kind = "line_extractor"
inputs = ["log.map"]
min_length = 0.8

[stages.align]
kind = "aligner"
inputs = ["log.map", "lines"]

[stages.fuse]
kind = "fuser"
inputs = { map = "log.map", alignment = ["align.alignment"] }
depth = 4

[stages.out]
kind = "mcap_sink"
inputs = ["log.*", "lines", "align", "fuse.map"]
file = "out.mcap"
"#;
