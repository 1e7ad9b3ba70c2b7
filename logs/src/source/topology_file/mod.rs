//! `topology_file_source`: topological maps in JSON files, one file per robot.

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
    /// The topological maps to read: JSON files, one per robot, as in `{"nodes": [{"x": 0, "y": 0}, {"x": 4, "y": 0}],
    /// "paths": [{"start": 0, "end": 1}]}`, in metres. A node may have a `kind` and a `probability`, and a path a
    /// `length`, a `probability`, and the `points` that it passes through, as in `[[0, 0], [4, 0]]`. A robot is named
    /// after its file without the extension; files with equal names are distinguished by their folders.
    pub files: Vec<PathBuf>,
}

impl Parameters for TopologyFileSourceParameters {}

/// The kind `topology_file_source`.
pub fn kind() -> StageKind {
    StageKind::source(
        "topology_file_source",
        "Reads topological maps from JSON files, each as the map of a robot. Files have no time: the maps \
         are logged one second apart, the first one second after the epoch, in the order of the robots' names",
        TopologyFileSource::new,
    )
}

/// The outputs of `topology_file_source`.
pub struct FileTopologies(Out<TopologicalMap>);

impl Outputs for FileTopologies {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self(ports.output_on("/{robot}/topology", "topology", "the robots' topological maps"))
    }
}
