//! `map_file_source`: maps of nav2's map server, one file per robot.

mod stage;

#[cfg(test)]
mod tests;

pub(super) use stage::INTERVAL;
pub use stage::MapFileSource;

use crate::map_file::GridMap;
use crate::robots::{Resolutions, problem_of_resolutions};
use gridweave_runtime::ros::OccupancyGrid;
use gridweave_runtime::stage::{Context, Out, OutputPorts, Outputs, ParameterError, Parameters, StageKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::sync::Arc;

/// The parameters of `map_file_source`.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MapFileSourceParameters {
    /// The maps to read: YAML files of nav2's map server, one per robot. A robot is named after its file without the
    /// extension; files with equal names are distinguished by their folders. Set by `--input` on the command line.
    pub files: Vec<PathBuf>,
    /// Whether the thresholds of the files are applied literally. Otherwise the shade 205, which map savers write for
    /// unknown cells, is unknown in trinary files even where `free_thresh` would make it free, as the usual 0.25 does;
    /// and where no cell reaches `occupied_thresh`, the darkest cells are occupied. Set by `--literal-thresholds` on
    /// the command line.
    pub literal_thresholds: bool,
    /// Side of a cell of a robot's map, metres, instead of the resolution in its file. The position of the origin
    /// stays. Set by `--resolution` on the command line.
    pub resolutions: Resolutions,
}

impl Parameters for MapFileSourceParameters {
    fn check_together(&self) -> Vec<ParameterError> {
        let wrong = problem_of_resolutions(&self.resolutions);
        wrong.into_iter().map(|wrong| ParameterError::new("resolutions", wrong)).collect()
    }
}

/// The kind `map_file_source`.
pub fn kind() -> StageKind {
    StageKind::source(
        "map_file_source",
        "Reads map files (YAML and image of nav2's map server), each as the map of a robot. Files have no time: the maps \
         are logged one second apart, the first one second after the epoch, in the order of the robots' names",
        MapFileSource::new,
    )
}

/// The kind `map_file_source` for maps that are in memory, each with the name of its robot, instead of files.
pub fn kind_of_maps(maps: Vec<(String, Arc<GridMap>)>) -> StageKind {
    StageKind::source(
        "map_file_source",
        "Sends maps that a program holds, each as the map of a robot, as from files",
        move |(), context: &Context| Ok(MapFileSource::of_maps(&maps, context)),
    )
}

/// The outputs of `map_file_source`.
pub struct FileMaps(Out<OccupancyGrid<'static>>);

impl Outputs for FileMaps {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self(ports.output("map", "the robots' maps, on the topics of [robots]"))
    }
}
