//! `map_file_source`: the maps of nav2's map server, a file for each robot.

mod stage;

#[cfg(test)]
mod tests;

pub use stage::MapFileSource;

use gridweave_runtime::ros::OccupancyGrid;
use gridweave_runtime::stage::{Out, OutputPorts, Outputs, Parameters, StageKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The parameters of `map_file_source`.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MapFileSourceParameters {
    /// The maps to read: YAML files of nav2's map server, one for each robot. A robot is called as its file without the
    /// ending; files that are called alike are told apart by the folders that they lie in. `--input` on the command line
    /// stands in for it.
    pub files: Vec<PathBuf>,
    /// Whether the thresholds of the files are taken at their word. Else the shade 205, as which map savers write unknown
    /// cells, is unknown in trinary files even where `free_thresh` would make it free, as the usual 0.25 does; and where no
    /// cell reaches `occupied_thresh`, the darkest are the walls. `--literal-thresholds` on the command line.
    pub literal_thresholds: bool,
}

impl Parameters for MapFileSourceParameters {}

/// The kind `map_file_source`.
pub fn kind() -> StageKind {
    StageKind::source(
        "map_file_source",
        "Reads map files (YAML and image of nav2's map server), each as the map of a robot. Files tell no time: the maps \
         are logged a second after each other, the first a second after the epoch, by the robots' names",
        MapFileSource::new,
    )
}

/// The maps of the files.
pub struct FileMaps(Out<OccupancyGrid<'static>>);

impl Outputs for FileMaps {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self(ports.output("map", "the robots' maps, on the topics of [robots]"))
    }
}
