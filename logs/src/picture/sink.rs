//! The stage `picture_sink`.

use super::{MapLayer, Picture, PictureError, Ways, render_map, render_overlay};
use gridweave_runtime::message::Message;
use gridweave_runtime::ros::{OccupancyGrid, RobotFrames, TopologicalMap};
use gridweave_runtime::stage::{Context, Output, Parameters, Received, StageError, StageKind};
use nalgebra::Isometry2;
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// The parameters of `picture_sink`.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct PictureParameters {
    /// The PNG file to write. A file that has this name is replaced.
    file: PathBuf,
}

impl Parameters for PictureParameters {}

/// The kind `picture_sink`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "picture_sink",
        "Draws the robots' maps as they lie in the merged one, each robot's walls in a colour of its own, or the merged map where \
         there are none, and topological maps on them, at the end of the run. Writes nothing if there is no merged map.",
        PictureSink::new,
    )
    .inputs("map", "the merged map, which is about no robot, and the robots' in the same frame", PictureSink::map)
    .optional_inputs("topology", "the robots' topological maps", PictureSink::topology)
    .optional_inputs("frames", "where topological maps lie, which are not bent", PictureSink::frames)
    .finish(PictureSink::write)
    .build()
}

struct PictureSink {
    file: PathBuf,
    /// The last map of each robot, and the merged one under an empty name.
    maps: BTreeMap<String, Message>,
    frames: RobotFrames,
    /// The last topological map of each robot.
    topologies: BTreeMap<String, TopologicalMap>,
}

impl PictureSink {
    fn new(PictureParameters { file }: PictureParameters, context: &Context) -> Result<Self, StageError> {
        if file.as_os_str().is_empty() {
            let doing = format!("draw the picture of stage `{}`", context.stage);
            return Err(
                StageError::new(doing, "it has no file").with_help("give --picture FILE.png or file = \"FILE.png\"")
            );
        }
        Ok(Self { file, maps: BTreeMap::new(), frames: RobotFrames::default(), topologies: BTreeMap::new() })
    }

    fn map(&mut self, map: Received<'_, OccupancyGrid<'_>>, _: &Output<()>) -> Result<(), StageError> {
        self.maps.insert(map.robot().to_owned(), map.message().clone());
        Ok(())
    }

    fn frames(&mut self, frames: Received<'_, RobotFrames>, _: &Output<()>) -> Result<(), StageError> {
        self.frames = frames.into_content();
        Ok(())
    }

    fn topology(&mut self, map: Received<'_, TopologicalMap>, _: &Output<()>) -> Result<(), StageError> {
        self.topologies.insert(map.robot().to_owned(), map.into_content());
        Ok(())
    }

    fn write(&mut self, output: &Output<()>) -> Result<(), StageError> {
        if self.maps.contains_key("") {
            let written = self.draw().and_then(|picture| picture.save_png(&self.file));
            written.map_err(|error| StageError::new("draw the merged map", error))?;
            output.count("files", 1);
        }
        Ok(())
    }

    fn draw(&self) -> Result<Picture, PictureError> {
        let robots: Vec<MapLayer<'_>> =
            self.maps.iter().filter(|(robot, _)| !robot.is_empty()).filter_map(|(_, map)| layer(map)).collect();
        match self.maps.get("").and_then(layer) {
            Some(merged) if robots.is_empty() => render_map(&merged),
            _ => render_overlay(&robots, &self.ways()),
        }
    }

    fn ways(&self) -> Vec<Ways<'_>> {
        let placed = self.frames.frames.iter().filter_map(|frame| {
            let map = self.topologies.get(&frame.robot)?;
            Some(Ways { map, transform_world_map: frame.transform_reference_robot() })
        });
        placed.collect()
    }
}

/// None for a map that cannot be read, which was warned of when it came.
fn layer(message: &Message) -> Option<MapLayer<'_>> {
    let grid: OccupancyGrid<'_> = message.decode().ok()?;
    Some(MapLayer { info: grid.info, cells: grid.cells(), transform_world_map: Isometry2::identity() })
}
