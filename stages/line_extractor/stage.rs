//! The stage `line_extractor`.

use super::{LineExtractorParameters, extract_segments};
use crate::geometry::read_map;
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
        let (header, grid) = match read_map(message) {
            Ok(map) => map,
            Err(error) => {
                output.warn(format!("a map of {} was left out: {error}", message.robot()));
                return Ok(());
            }
        };
        // Every map is searched with the same seed: the same map gives the same walls whatever came before it.
        let segments = extract_segments(&grid, &self.parameters, self.seed);
        let robot = message.robot().to_owned();
        output.send(SEGMENTS, message.robot(), &Segments { header, robot, segments })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::message::{FixedText, LogTime, MessageHeader};
    use gridweave_runtime::ros::{Header, MapMetaData, encode};
    use gridweave_runtime::stage::{CollectedOutputs, Context, Node};

    fn message(width: u32, cells: &[u8]) -> Message {
        let info = MapMetaData { resolution: 0.05, width, height: 30, ..Default::default() };
        let header = Header { frame_id: "robot7/map".into(), ..Default::default() };
        let map = OccupancyGrid { header, info, data: cells };
        let header = MessageHeader { robot: FixedText::new("robot7").unwrap(), ..Default::default() };
        Message::from_vec(header, encode(&map).unwrap())
    }

    #[test]
    fn a_map_gives_its_segments_and_a_bad_one_a_warning() {
        let kind = kind();
        let context = Context { seed: 4, ..Default::default() };
        let Node::Stage(mut stage) = kind.make(Default::default(), &context).unwrap() else { panic!("a stage") };
        let mut outputs = CollectedOutputs::new(&kind);
        let cells: Vec<u8> = (0..1500).map(|index| if index / 50 == 12 { 100 } else { 0 }).collect();
        for message in [message(50, &cells), message(49, &cells), message(50, &cells)] {
            stage.receive(0, &message, &mut outputs.output(LogTime(5))).unwrap();
        }
        let broken = Message::from_vec(MessageHeader::default(), vec![0, 1, 0]);
        stage.receive(0, &broken, &mut outputs.output(LogTime(6))).unwrap();

        let sent = outputs.take(SEGMENTS);
        assert_eq!(sent.len(), 2);
        assert_eq!(sent[0].bytes(), sent[1].bytes(), "the same map gives the same segments");
        assert_eq!(sent[0].robot(), "robot7");
        let segments: Segments = sent[0].decode().unwrap();
        assert_eq!((segments.robot.as_str(), segments.header.frame_id.as_str()), ("robot7", "robot7/map"));
        assert_eq!(segments.segments.len(), 1);
        assert!((segments.segments[0].y1 - 0.625).abs() < 1e-9);
        assert_eq!(outputs.warnings().len(), 2);
    }
}
