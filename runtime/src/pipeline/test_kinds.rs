//! Small stage kinds for the tests of this module.

use crate::ros::{Alignment, OccupancyGrid, PoseStamped, RosMessage, Segments};
use crate::stage::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

type Grid = OccupancyGrid<'static>;

/// A stage that does nothing.
struct Idle;

impl Source for Idle {
    type Outputs = Logged;

    fn next(&mut self, _output: &Output<Logged>) -> Result<bool, StageError> {
        Ok(false)
    }
}

struct Logged;

impl Outputs for Logged {
    fn declare(ports: &mut OutputPorts) -> Self {
        let _: (Out<Grid>, Out<PoseStamped>) = (ports.output("map", "Maps."), ports.output("pose", "Poses."));
        ports.any_output("other", "All else.");
        Self
    }
}

struct Walls;

impl Outputs for Walls {
    fn declare(ports: &mut OutputPorts) -> Self {
        let _: Out<Segments> = ports.output("segments", "Walls.");
        Self
    }
}

struct Alignments;

impl Outputs for Alignments {
    fn declare(ports: &mut OutputPorts) -> Self {
        let _: Out<Alignment> = ports.output("alignment", "How the maps lie.");
        Self
    }
}

struct Merged;

impl Outputs for Merged {
    fn declare(ports: &mut OutputPorts) -> Self {
        let _: Out<Grid> = ports.output_on("/map", "map", "The merged map.");
        Self
    }
}

fn ignore<T: RosMessage, O>(_: &mut Idle, _: Received<'_, T>, _: &Output<O>) -> Result<(), StageError> {
    Ok(())
}

#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct Files {
    /// The logs to read, in this order.
    files: Vec<String>,
    /// Seconds to leave out at the start.
    start: Option<f64>,
}

impl Parameters for Files {}

#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
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

#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct Lines {
    /// Segments shorter than this are dropped, in metres. The
    /// paper: 30 px.
    #[schemars(extend("exclusiveMinimum" = 0))]
    min_length: f64,
    /// The number of iterations.
    #[schemars(range(min = 1))]
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

impl Parameters for Lines {}

/// Kinds that look like those of the tag pipeline from outside.
pub(super) fn registry() -> Registry {
    Registry::new([
        StageKind::source("mcap_source", "Reads logs.", |_: Files, _: &Context| Ok(Idle)),
        StageKind::stage("line_extractor", "Finds straight walls.", |_: Lines, _| Ok(Idle))
            .input("map", "Maps.", ignore::<Grid, Walls>)
            .build(),
        StageKind::stage("aligner", "Aligns maps by their walls.", |(): (), _| Ok(Idle))
            .input("map", "Maps.", ignore::<Grid, Alignments>)
            .input("segments", "Walls.", ignore::<Segments, _>)
            .optional_input("guess", "A first guess.", ignore::<Alignment, _>)
            .build(),
        StageKind::stage("fuser", "Fuses maps.", |(): (), _| Ok(Idle))
            .input("map", "Maps.", ignore::<Grid, Merged>)
            .inputs("alignment", "How they lie.", ignore::<Alignment, _>)
            .build(),
        StageKind::stage("mcap_sink", "Writes a log.", |_: File, _| Ok(Idle))
            .any_inputs("in", "What to write.", |_, _, _: &Output<()>| Ok(()))
            .build(),
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
