//! The stage `line_extractor`.

use super::{LineExtractorParameters, extract_segments};
use crate::geometry::Grid;
use gridweave_runtime::message::Message;
use gridweave_runtime::ros::{OccupancyGrid, Segments};
use gridweave_runtime::stage::{InputPort, Output, OutputPort, PortType, Stage, StageError, StageKind};

const SEGMENTS: usize = 0;

/// The stage kind `line_extractor`: a map in, its straight walls out.
pub fn kind() -> StageKind {
    StageKind::stage(
        "line_extractor",
        "Finds the straight walls of every map, by RANSAC over its occupied cells",
        vec![InputPort::one("map", PortType::of::<OccupancyGrid<'_>>(), "Occupancy grids")],
        vec![OutputPort::new("segments", PortType::of::<Segments>(), "The straight walls of each map")],
        |parameters: LineExtractorParameters, context| Ok(LineExtractor { parameters, seed: context.seed }),
    )
}

struct LineExtractor {
    parameters: LineExtractorParameters,
    seed: u64,
}

impl Stage for LineExtractor {
    fn receive(&mut self, _port: usize, message: &Message, output: &mut Output<'_>) -> Result<(), StageError> {
        let map: OccupancyGrid<'_> = match message.decode() {
            Ok(map) => map,
            Err(error) => {
                output.warn(format!("a map of {} was left out: {error}", message.robot()));
                return Ok(());
            }
        };
        let grid = match Grid::from_message(&map) {
            Ok(grid) => grid,
            Err(error) => {
                output.warn(format!("a map of {} was left out: {error}", message.robot()));
                return Ok(());
            }
        };
        // Every map is searched with the same seed: the same map gives the same walls whatever came before it.
        let segments = extract_segments(&grid, &self.parameters, self.seed);
        let robot = message.robot().to_owned();
        output.send(SEGMENTS, message.robot(), &Segments { header: map.header.clone(), robot, segments })
    }
}
