//! The map placer as a stage.

use super::PlacedMap;
use crate::merge::grid_fuser::KnownArea;
use crate::shared::placement::{Placed, Placement};
use crate::shared::robot_maps::{RobotMap, RobotMaps};
use gridweave_runtime::ros::{Header, MapDeformation, OccupancyGrid, RobotFrames};
use gridweave_runtime::stage::{Context, Out, Output, OutputPorts, Outputs, Received, StageError, StageKind};

/// The kind `map_placer`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "map_placer",
        "Draws each placed robot's last map where it lies in the merged one, through its bend and its frame, at the end.",
        |(), _: &Context| Ok(MapPlacer::default()),
    )
    .inputs("map", "the robots' maps", MapPlacer::receive_map)
    .optional_inputs("deformation", "how the maps are bent", MapPlacer::receive_deformation)
    .inputs("frames", "where the maps lie", MapPlacer::receive_frames)
    .finish(MapPlacer::finish)
    .build()
}

struct PlacedMaps {
    map: Out<OccupancyGrid<'static>>,
}

impl Outputs for PlacedMaps {
    fn declare(ports: &mut OutputPorts) -> Self {
        let summary = "each placed robot's map as it lies in the merged one, in the frame `world`";
        Self { map: ports.output_on("/{robot}/merged_map", "map", summary) }
    }
}

#[derive(Default)]
struct MapPlacer {
    maps: RobotMaps<KnownArea>,
    placement: Placement,
}

impl MapPlacer {
    fn receive_map(
        &mut self,
        map: Received<'_, OccupancyGrid<'_>>,
        output: &Output<PlacedMaps>,
    ) -> Result<(), StageError> {
        self.maps.keep(&map, output, KnownArea::of);
        Ok(())
    }

    fn receive_deformation(
        &mut self,
        deformation: Received<'_, MapDeformation>,
        output: &Output<PlacedMaps>,
    ) -> Result<(), StageError> {
        self.placement.keep_deformation(&deformation, output);
        Ok(())
    }

    fn receive_frames(&mut self, frames: Received<'_, RobotFrames>, _: &Output<PlacedMaps>) -> Result<(), StageError> {
        self.placement.frames = frames.into_content();
        Ok(())
    }

    fn finish(&mut self, output: &Output<PlacedMaps>) -> Result<(), StageError> {
        if !output.map.is_read() {
            return Ok(());
        }
        for (robot, placed) in self.placement.placed() {
            if let Some(map) = self.maps.get(robot) {
                draw(robot, map, &placed, output)?;
            }
        }
        Ok(())
    }
}

/// Sends a map as it lies in the world. One that lies too far away for numbers, of which the grid fuser warns, is left out.
fn draw(
    robot: &str,
    map: &RobotMap<KnownArea>,
    placed: &Placed<'_>,
    output: &Output<PlacedMaps>,
) -> Result<(), StageError> {
    let Some(map) = PlacedMap::new(map.grid(), &map.own, placed) else { return Ok(()) };
    let prefix = map.geometry().prefix(Header::new(output.log_time(), RobotFrames::WORLD));
    output.map.send_grid(robot, &prefix, |blank| {
        let mut filled = blank.fill_with(0);
        map.draw(filled.cells_mut());
        Ok(filled)
    })
}
