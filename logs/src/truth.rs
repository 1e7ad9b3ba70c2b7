//! The ground truth of a simulated log, as a JSON file for the evaluation of merges.

use crate::file::replace_or_leave;
use gridweave_runtime::ros::SimulationTruth;
use gridweave_runtime::stage::{Context, Output, Parameters, Received, StageError, StageKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::path::PathBuf;

/// The parameters of `truth_sink`.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct TruthParameters {
    /// The JSON file to write. An existing file is replaced.
    file: PathBuf,
    /// Whether the file is left as `FILE.part` when it is whole: the command renames the files of all stages together.
    /// Set by the command.
    leave_part: bool,
}

impl Parameters for TruthParameters {}

/// The kind `truth_sink`.
pub fn kind() -> StageKind {
    StageKind::stage("truth_sink", "Writes the ground truth of a simulated world to a JSON file.", TruthSink::new)
        .input("truth", "the ground truth", TruthSink::write)
        .build()
}

struct TruthSink {
    file: PathBuf,
    leave_part: bool,
}

impl TruthSink {
    fn new(TruthParameters { file, leave_part }: TruthParameters, _: &Context) -> Result<Self, StageError> {
        if file.as_os_str().is_empty() {
            let doing = "write the truth";
            return Err(StageError::new(doing, "it has no file").with_help("give --truth FILE or file = \"FILE\""));
        }
        Ok(Self { file, leave_part })
    }

    fn write(&mut self, truth: Received<'_, SimulationTruth>, _: &Output<()>) -> Result<(), StageError> {
        let failed =
            |cause: &dyn std::fmt::Display| StageError::new(format!("write the truth {}", self.file.display()), cause);
        let text = serde_json::to_string_pretty(&to_json(&truth)).map_err(|error| failed(&error))? + "\n";
        replace_or_leave(&[(&self.file, text.as_bytes())], self.leave_part).map_err(|error| failed(&error))
    }
}

/// `resolution`, `frames` (robot to x, y, yaw), `tags` (id to x, y), `note`, `centres` (robot to x, y) and `common` (x
/// and y in the second robot's map, and in the first's).
fn to_json(truth: &SimulationTruth) -> Value {
    fn object<T>(entries: &[T], entry: impl Fn(&T) -> (&String, Value)) -> Value {
        entries.iter().map(entry).map(|(name, value)| (name.clone(), value)).collect::<Map<_, _>>().into()
    }
    json!({
        "resolution": truth.resolution,
        "frames": object(&truth.frames, |one| (&one.robot, json!({ "x": one.x, "y": one.y, "yaw": one.yaw }))),
        "tags": object(&truth.tags, |tag| (&tag.tag_id, json!([tag.x, tag.y]))),
        "note": "frames: pose of each robot's map frame in robot1's map frame, metres and radians; tags in robot1's \
                 map frame; centres: middle of each robot's last map, in its own map frame (errors are taken there); \
                 common: places that the first two robots by name have both driven through, x and y in the map frame of the \
                 second and then of the first, as their maps show them",
        "centres": object(&truth.frames, |one| (&one.robot, json!(one.centre))),
        "common": truth.common.iter().map(|place| [place.second, place.first].concat()).collect::<Vec<_>>(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::message::LogTime;
    use gridweave_runtime::ros::{CommonPlace, TrueFrame, TrueTag};
    use gridweave_runtime::stage::StageHarness;

    #[test]
    fn the_file_has_the_format_of_a_truth_file() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("truth.json");
        let mut sink = StageHarness::new(&kind(), &format!("file = {file:?}")).unwrap();
        let truth = SimulationTruth {
            resolution: 0.05,
            frames: vec![TrueFrame { robot: "robot2".into(), x: 1.0, y: 2.0, yaw: 0.5, centre: [5.0, 6.0] }],
            tags: vec![TrueTag { tag_id: "tag00".into(), x: 3.0, y: 4.0 }],
            common: vec![CommonPlace { first: [1.0, 2.0], second: [3.0, 4.0] }],
            ..Default::default()
        };
        sink.give::<SimulationTruth>("truth", "", LogTime(1), &truth).unwrap();
        let json: Value = serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap();
        assert_eq!(json["resolution"], 0.05);
        assert_eq!(json["frames"]["robot2"], json!({ "x": 1.0, "y": 2.0, "yaw": 0.5 }));
        assert_eq!(json["tags"]["tag00"], json!([3.0, 4.0]));
        assert_eq!(json["centres"]["robot2"], json!([5.0, 6.0]));
        assert_eq!(json["common"], json!([[3.0, 4.0, 1.0, 2.0]]));
        assert!(json["note"].is_string());
    }
}
