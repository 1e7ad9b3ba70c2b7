//! The stage `picture_sink`.

use super::{Cells, FORMATS, MapLayer, Marks, Picture, PictureError, Scene, robot_colour, ways};
use gridweave_runtime::message::Message;
use gridweave_runtime::ros::{OccupancyGrid, RobotFrames, TopologicalMap};
use gridweave_runtime::stage::{Context, Output, Parameters, Received, StageError, StageKind};
use nalgebra::Isometry2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// The parameters of `picture_sink`.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct PictureParameters {
    /// The file to write: PNG, SVG or PDF by its extension. An existing file is replaced.
    file: PathBuf,
    /// Whether the file is left as `FILE.part` when it is whole: the command renames the files of all stages together.
    /// Set by the command.
    leave_part: bool,
}

impl Parameters for PictureParameters {}

/// The kind `picture_sink`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "picture_sink",
        "Draws the robots' maps aligned in the merged frame, with walls in a different colour for each robot, or the merged map where \
         there are none, and topological maps on them, at the end of the run. Writes nothing if there is no merged map.",
        PictureSink::new,
    )
    .inputs("map", "the merged map, without a robot, and the robots' maps in the same frame", PictureSink::map)
    .optional_inputs("topology", "the robots' topological maps", PictureSink::topology)
    .optional_inputs("frames", "the poses of topological maps, which are not deformed", PictureSink::frames)
    .finish(PictureSink::write)
    .build()
}

struct PictureSink {
    file: PathBuf,
    leave_part: bool,
    /// The last map of each robot; the merged map has an empty name.
    maps: BTreeMap<String, Message>,
    frames: RobotFrames,
    /// The last topological map of each robot.
    topologies: BTreeMap<String, TopologicalMap>,
}

impl PictureSink {
    fn new(PictureParameters { file, leave_part }: PictureParameters, _: &Context) -> Result<Self, StageError> {
        if file.as_os_str().is_empty() {
            let doing = "draw the picture";
            return Err(StageError::new(doing, "it has no file")
                .with_help("give --picture FILE.png (or .svg, .pdf) or file = \"FILE.png\""));
        }
        check_format(&file).map_err(|error| StageError::new("draw the merged map", error))?;
        let (maps, topologies) = (BTreeMap::new(), BTreeMap::new());
        Ok(Self { file, leave_part, maps, frames: RobotFrames::default(), topologies })
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
            let written = self.draw().and_then(|picture| picture.save_or_leave(&self.file, self.leave_part));
            written.map_err(|error| StageError::new("draw the merged map", error))?;
            output.count("files", 1);
        }
        Ok(())
    }

    fn draw(&self) -> Result<Picture, PictureError> {
        let of_robots = self.maps.iter().filter(|(robot, _)| !robot.is_empty());
        let robots: Vec<MapLayer<'_>> = of_robots
            .enumerate()
            .filter_map(|(index, (robot, map))| Some(MapLayer { colour: robot_colour(index), ..layer(robot, map)? }))
            .collect();
        let merged = self.maps.get("").and_then(|map| layer("", map));
        match merged {
            Some(merged) if robots.is_empty() => Picture::of(&Scene { maps: &[merged], ..Scene::default() }),
            _ => {
                let marks = self.ways();
                Picture::of(&Scene { maps: &robots, cells: Cells::Coloured, marks: &marks, grid: None })
            }
        }
    }

    fn ways(&self) -> Vec<Marks> {
        let placed = self.frames.frames.iter().filter_map(|frame| {
            let map = self.topologies.get(&frame.robot)?;
            Some(ways(map, &frame.transform_reference_robot()))
        });
        placed.collect()
    }
}

/// Checks the extension of a picture's file name, so that an error is found at the start of a run.
///
/// # Errors
/// The extension is not supported.
pub fn check_format(path: &Path) -> Result<(), PictureError> {
    let is_known = |ending: &OsStr| FORMATS.iter().any(|format| ending.eq_ignore_ascii_case(format));
    if path.extension().is_some_and(is_known) { Ok(()) } else { Err(PictureError::Format(path.to_owned())) }
}

/// `None` for a map that cannot be read; the warning was given when it was received.
fn layer<'a>(name: &'a str, message: &'a Message) -> Option<MapLayer<'a>> {
    let grid: OccupancyGrid<'_> = message.decode().ok()?;
    let (colour, transform_world_map) = (robot_colour(0), Isometry2::identity());
    Some(MapLayer { name, colour, info: grid.info, cells: grid.cells(), transform_world_map })
}
