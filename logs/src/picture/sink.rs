//! The stage `picture_sink`.

use super::{MapLayer, Picture, PictureError, render_map, render_overlay};
use gridweave_runtime::message::Message;
use gridweave_runtime::ros::{OccupancyGrid, RobotFrames};
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
        "Draws the robots' last maps where their frames lie, each robot's walls in a colour of its own, or the merged map where \
         there are none, at the end of the run. Bends are not drawn, but in the merged map. Writes nothing if no map has come.",
        PictureSink::new,
    )
    .inputs("map", "the robots' maps, and the merged one, which is about no robot", PictureSink::map)
    .inputs("frames", "where the robots' maps lie", PictureSink::frames)
    .finish(PictureSink::write)
    .build()
}

struct PictureSink {
    file: PathBuf,
    /// The last map of each robot, and the merged one under an empty name.
    maps: BTreeMap<String, Message>,
    frames: RobotFrames,
}

impl PictureSink {
    fn new(PictureParameters { file }: PictureParameters, context: &Context) -> Result<Self, StageError> {
        if file.as_os_str().is_empty() {
            let doing = format!("draw the picture of stage `{}`", context.stage);
            return Err(
                StageError::new(doing, "it has no file").with_help("give --picture FILE.png or file = \"FILE.png\"")
            );
        }
        Ok(Self { file, maps: BTreeMap::new(), frames: RobotFrames::default() })
    }

    fn map(&mut self, map: Received<'_, OccupancyGrid<'_>>, _: &Output<()>) -> Result<(), StageError> {
        self.maps.insert(map.robot().to_owned(), map.message().clone());
        Ok(())
    }

    fn frames(&mut self, frames: Received<'_, RobotFrames>, _: &Output<()>) -> Result<(), StageError> {
        self.frames = frames.into_content();
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
        let placed = self
            .frames
            .frames
            .iter()
            .filter_map(|frame| layer(self.maps.get(&frame.robot)?, frame.transform_reference_robot()));
        let placed: Vec<MapLayer<'_>> = placed.collect();
        match self.maps.get("").and_then(|merged| layer(merged, Isometry2::identity())) {
            Some(merged) if placed.is_empty() => render_map(&merged),
            _ => render_overlay(&placed),
        }
    }
}

/// None for a map that cannot be read, which was warned of when it came.
fn layer(message: &Message, transform_world_map: Isometry2<f64>) -> Option<MapLayer<'_>> {
    let grid: OccupancyGrid<'_> = message.decode().ok()?;
    Some(MapLayer { info: grid.info, cells: grid.cells(), transform_world_map })
}
