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
        "Transforms each placed robot's last map into the merged frame, by its deformation and its frame, at the end.",
        |(), _: &Context| Ok(MapPlacer::default()),
    )
    .inputs("map", "the robots' maps", MapPlacer::receive_map)
    .optional_inputs("deformation", "the deformations of the maps", MapPlacer::receive_deformation)
    .inputs("frames", "the poses of the maps", MapPlacer::receive_frames)
    .finish(MapPlacer::finish)
    .build()
}

struct PlacedMaps {
    map: Out<OccupancyGrid<'static>>,
}

impl Outputs for PlacedMaps {
    fn declare(ports: &mut OutputPorts) -> Self {
        let summary = "each placed robot's map, transformed to the frame `world`";
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

/// Sends a transformed map. One that is too far away, of which the grid fuser warns, is left out.
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
