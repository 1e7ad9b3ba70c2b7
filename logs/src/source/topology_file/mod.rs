//! `topology_file_source`: topological maps that were drawn by hand, a JSON file for each robot.

mod file;
mod stage;

#[cfg(test)]
mod tests;

pub use file::{TopologyFileError, load};
pub use stage::TopologyFileSource;

use gridweave_runtime::ros::TopologicalMap;
use gridweave_runtime::stage::{Out, OutputPorts, Outputs, Parameters, StageKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The parameters of `topology_file_source`.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TopologyFileSourceParameters {
    /// The topological maps to read: JSON files, one for each robot, as in `{"nodes": [{"x": 0, "y": 0}, {"x": 4, "y": 0}],
    /// "paths": [{"start": 0, "end": 1}]}`, in metres. A node may have a `kind` and a `probability`, and a path a `length`, a
    /// `probability`, and the `points` that it passes through, as in `[[0, 0], [4, 0]]`. A robot is called as its file
    /// without the ending; files that are called alike are told apart by the folders that they lie in.
    pub files: Vec<PathBuf>,
}

impl Parameters for TopologyFileSourceParameters {}

/// The kind `topology_file_source`.
pub fn kind() -> StageKind {
    StageKind::source(
        "topology_file_source",
        "Reads topological maps that were drawn by hand (JSON), each as the map of a robot. Files tell no time: the maps \
         are logged a second after each other, the first a second after the epoch, by the robots' names",
        TopologyFileSource::new,
    )
}

/// The topological maps of the files.
pub struct FileTopologies(Out<TopologicalMap>);

impl Outputs for FileTopologies {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self(ports.output_on("/{robot}/topology", "topology", "the robots' topological maps"))
    }
}
