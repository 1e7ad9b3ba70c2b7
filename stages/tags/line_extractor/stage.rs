//! The stage `line_extractor`.

use super::{LineExtractorParameters, extract_segments};
use crate::shared::geometry::Grid;
use gridweave_runtime::ros::{OccupancyGrid, Segments};
use gridweave_runtime::stage::{Out, Output, OutputPorts, Outputs, Received, StageError, StageKind};

/// The stage kind `line_extractor`: a map in, its straight walls out.
pub fn kind() -> StageKind {
    StageKind::stage(
        "line_extractor",
        "Finds the straight walls of every map, by RANSAC over its occupied cells",
        |parameters: LineExtractorParameters, context| Ok(LineExtractor { parameters, seed: context.seed }),
    )
    .input("map", "Occupancy grids", LineExtractor::receive_map)
    .build()
}

struct LineExtractor {
    parameters: LineExtractorParameters,
    seed: u64,
}

struct Walls {
    segments: Out<Segments>,
}

impl Outputs for Walls {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self { segments: ports.output("segments", "The straight walls of each map") }
    }
}

impl LineExtractor {
    fn receive_map(&mut self, map: Received<'_, OccupancyGrid<'_>>, output: &Output<Walls>) -> Result<(), StageError> {
        let robot = map.robot();
        let grid = match Grid::from_message(&map) {
            Ok(grid) => grid,
            Err(error) => {
                output.warn(format!("a map of {robot} was left out: {error}"));
                return Ok(());
            }
        };
        // Every map is searched with the same seed: the same map gives the same walls whatever came before it.
        let segments = extract_segments(&grid, &self.parameters, self.seed);
        let header = map.into_content().header;
        output.segments.send(robot, &Segments { header, robot: robot.to_owned(), segments })
    }
}
