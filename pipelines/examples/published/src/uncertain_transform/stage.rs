//! The stage: keeps each robot's last map, and transforms it into the world when it or its frame has changed.

use super::{UncertainTransformParameters, transform};
use gridweave_runtime::ros::{Header, OccupancyGrid, RobotFrame, RobotFrames};
use gridweave_runtime::stage::{Out, Output, OutputPorts, Outputs, Received, StageError};
use gridweave_stages::merge::grid_fuser::layout::CellLattice;
use gridweave_stages::merge::grid_fuser::{KnownArea, PlacedGrid};
use gridweave_stages::shared::geometry::Point2;
use gridweave_stages::shared::robot_maps::RobotMaps;
use nalgebra::Matrix3;
use std::collections::BTreeMap;

/// Outputs of the stage.
pub(super) struct TransformedMaps {
    map: Out<OccupancyGrid<'static>>,
}

impl Outputs for TransformedMaps {
    fn declare(ports: &mut OutputPorts) -> Self {
        let summary = "The maps of placed robots in the frame `world`, on the cells of one lattice, blurred by the covariance of their \
                       frames. A map is sent again when it, its frame or the lattice has changed.";
        Self { map: ports.output("map", summary) }
    }
}

/// Transforms the maps of robots into the world.
pub(super) struct UncertainTransform {
    parameters: UncertainTransformParameters,
    maps: RobotMaps<KnownArea>,
    frames: RobotFrames,
    /// Number, frame and lattice of each robot's map that was sent.
    sent: BTreeMap<String, (u64, RobotFrame, (Point2, f64))>,
}

impl UncertainTransform {
    pub(super) fn new(parameters: UncertainTransformParameters) -> Self {
        Self { parameters, maps: RobotMaps::default(), frames: RobotFrames::default(), sent: BTreeMap::new() }
    }

    pub(super) fn receive_map(
        &mut self,
        map: Received<'_, OccupancyGrid<'_>>,
        output: &Output<TransformedMaps>,
    ) -> Result<(), StageError> {
        let is_same = self.maps.get(map.robot()).is_some_and(|before| before.is_same(&map));
        if !is_same && self.maps.keep(&map, output, KnownArea::of) { self.update(output) } else { Ok(()) }
    }

    pub(super) fn receive_frames(
        &mut self,
        frames: Received<'_, RobotFrames>,
        output: &Output<TransformedMaps>,
    ) -> Result<(), StageError> {
        self.frames = frames.into_content();
        self.update(output)
    }

    /// Sends the maps of which anything has changed, by robot.
    fn update(&mut self, output: &Output<TransformedMaps>) -> Result<(), StageError> {
        let Some(lattice) = self.lattice() else { return Ok(()) };
        for frame in &self.frames.frames {
            let Some(map) = self.maps.get(&frame.robot) else { continue };
            let state = (map.number, frame.clone(), (lattice.anchor, lattice.resolution));
            if self.sent.get(&frame.robot) == Some(&state) {
                continue;
            }
            self.sent.insert(frame.robot.clone(), state);
            let placed = PlacedGrid::rigid(map.grid(), frame.transform_reference_robot());
            let covariance = Matrix3::from_row_slice(&frame.covariance);
            match transform(&placed, &map.own, &covariance, &lattice, &self.parameters) {
                Ok(Some(transformed)) => {
                    let header = Header::new(output.log_time(), RobotFrames::WORLD);
                    let prefix = transformed.geometry.prefix(header);
                    output.map.send_grid(&frame.robot, &prefix, |blank| blank.copy_cells(&transformed.cells))?;
                }
                Ok(None) => {}
                Err(problem) => {
                    output.warn(format!("the map of {} was not transformed into the world: {problem}", frame.robot));
                }
            }
        }
        Ok(())
    }

    /// The lattice of the reference robot's map, if that is there.
    fn lattice(&self) -> Option<CellLattice> {
        let reference = &self.frames.reference;
        let frame = self.frames.frames.iter().find(|frame| frame.robot == *reference)?;
        let geometry = self.maps.get(reference)?.grid().geometry;
        let corner = frame.transform_reference_robot() * geometry.origin;
        let UncertainTransformParameters { resolution, max_extent, max_cells, .. } = self.parameters;
        Some(CellLattice {
            anchor: Point2::from(corner.translation.vector),
            resolution: resolution.unwrap_or(geometry.resolution),
            max_extent,
            max_cells,
        })
    }
}
