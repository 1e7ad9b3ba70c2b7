//! The stage `map_file_sink`.

use super::GridMap;
use super::save::save_or_leave;
use gridweave_runtime::message::Message;
use gridweave_runtime::ros::OccupancyGrid;
use gridweave_runtime::stage::{Context, Output, Parameters, Received, StageError, StageKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The parameters of `map_file_sink`.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct MapFileSinkParameters {
    /// The YAML file to write; the image has the same name with the extension pgm. Existing files are replaced.
    file: PathBuf,
    /// Whether the file is left as `FILE.part` when it is whole: the command renames the files of all stages together.
    /// Set by the command.
    leave_part: bool,
}

impl Parameters for MapFileSinkParameters {}

/// The kind `map_file_sink`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "map_file_sink",
        "Writes the last received map as a map file (YAML and image of nav2's map server), at the end of the run. \
         Writes nothing if no map was received.",
        MapFileSink::new,
    )
    .inputs("map", "the merged map", MapFileSink::receive)
    .finish(MapFileSink::write)
    .build()
}

struct MapFileSink {
    file: PathBuf,
    leave_part: bool,
    last: Option<Message>,
}

impl MapFileSink {
    fn new(parameters: MapFileSinkParameters, _: &Context) -> Result<Self, StageError> {
        let MapFileSinkParameters { file, leave_part } = parameters;
        if file.as_os_str().is_empty() {
            let doing = "write the map file";
            return Err(
                StageError::new(doing, "it has no file").with_help("give --map FILE.yaml or file = \"FILE.yaml\"")
            );
        }
        Ok(Self { file, leave_part, last: None })
    }

    fn receive(&mut self, map: Received<'_, OccupancyGrid<'_>>, _: &Output<()>) -> Result<(), StageError> {
        self.last = Some(map.message().clone());
        Ok(())
    }

    fn write(&mut self, output: &Output<()>) -> Result<(), StageError> {
        let failed = |cause: &dyn std::fmt::Display| StageError::new("write the merged map", cause);
        let Some(message) = &self.last else { return Ok(()) };
        let grid: OccupancyGrid<'_> = message.decode().map_err(|error| failed(&error))?;
        save_or_leave(&self.file, &GridMap::from_message(&grid), self.leave_part).map_err(|error| failed(&error))?;
        output.count("files", 1);
        Ok(())
    }
}
