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

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::message::LogTime;
    use gridweave_runtime::ros::{Header, MapMetaData};
    use gridweave_runtime::stage::{Context, StageHarness};

    #[test]
    fn a_map_gives_its_segments_and_a_bad_one_a_warning() {
        let context = Context { seed: 4, ..Default::default() };
        let mut stage = StageHarness::with_context(&kind(), "", &context).unwrap();
        let cells: Vec<u8> = (0..1500).map(|index| if index / 50 == 12 { 100 } else { 0 }).collect();
        for width in [50, 49, 50] {
            let info = MapMetaData { resolution: 0.05, width, height: 30, ..Default::default() };
            let header = Header { frame_id: "robot7/map".into(), ..Default::default() };
            let map = OccupancyGrid { header, info, data: &cells };
            stage.give::<OccupancyGrid<'_>>("map", "robot7", LogTime(5), &map).unwrap();
        }
        stage.give_bytes("map", "robot7", LogTime(6), vec![0, 1, 0]).unwrap();

        let sent = stage.take_messages("segments");
        assert_eq!(sent.len(), 2);
        assert_eq!(sent[0].bytes(), sent[1].bytes(), "the same map gives the same segments");
        assert_eq!(sent[0].robot(), "robot7");
        let segments: Segments = sent[0].decode().unwrap();
        assert_eq!((segments.robot.as_str(), segments.header.frame_id.as_str()), ("robot7", "robot7/map"));
        assert_eq!(segments.segments.len(), 1);
        assert!((segments.segments[0].y1 - 0.625).abs() < 1e-9);
        assert_eq!(stage.warnings().len(), 2);
    }
}
