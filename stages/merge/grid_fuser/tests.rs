//! The stage as a whole: messages in, messages out.

use super::kind;
use gridweave_runtime::message::{LogTime, Message, MessageHeader};
use gridweave_runtime::ros::{
    DeformationNode, MapDeformation, MapMetaData, OccupancyGrid, Pose, RobotFrame, RobotFrames, UnmergedRobot, encode,
};
use gridweave_runtime::stage::{Context, OutputEnd, OutputSink, StageError, StageHarness};
use std::cell::RefCell;
use std::rc::Rc;

const TIME: LogTime = LogTime(7_000_000_001);

/// Width, height and cells.
type Fused = (u32, u32, Vec<i8>);

struct Run(StageHarness);

impl Run {
    fn new(parameters: &str) -> Self {
        Self(StageHarness::new(&kind(), parameters).unwrap())
    }

    /// Sends a map and returns the fused maps that follow.
    fn map(&mut self, robot: &str, x: f64, cells: &[i8]) -> Vec<Fused> {
        self.0.give_bytes("map", robot, TIME, map(x, cells)).unwrap();
        self.fused()
    }

    /// The same for frames.
    fn frames(&mut self, placed: &[(&str, f64)]) -> Vec<Fused> {
        self.0.give::<RobotFrames>("frames", "", TIME, &frames(placed)).unwrap();
        self.fused()
    }

    /// The same for a deformation that displaces the map of a robot by `dx` metres about x = 0 and by nothing from x
    /// = 8 on.
    fn deform(&mut self, robot: &str, dx: f64) -> Vec<Fused> {
        let node = |x: f64, dx: f64| [0.0, 8.0].map(|y| DeformationNode { x, y, dx, ..Default::default() });
        let nodes = [node(0.0, dx), node(8.0, 0.0), node(16.0, 0.0)].concat();
        let deformation = MapDeformation { robot: robot.into(), spacing: 8.0, nodes, ..Default::default() };
        self.0.give::<MapDeformation>("deformation", robot, TIME, &deformation).unwrap();
        self.fused()
    }

    fn finish(&mut self) -> Vec<Fused> {
        self.0.finish(LogTime(9)).unwrap();
        self.fused()
    }

    fn fused(&mut self) -> Vec<Fused> {
        let read = |message: &Message| {
            let grid: OccupancyGrid<'_> = message.decode().unwrap();
            assert_eq!((message.header().topic.as_str(), grid.header.frame_id.as_str()), ("/map", "world"));
            (grid.info.width, grid.info.height, grid.cells().to_vec())
        };
        self.0.take_messages("map").iter().map(read).collect()
    }
}

/// A row of cells of one metre, its corner at x.
fn map(x: f64, cells: &[i8]) -> Vec<u8> {
    let origin = Pose::from(crate::shared::geometry::pose(x, 0.0, 0.0));
    let info = MapMetaData { resolution: 1.0, width: cells.len() as u32, height: 1, origin, ..Default::default() };
    let data: Vec<u8> = cells.iter().map(|cell| *cell as u8).collect();
    encode(&OccupancyGrid { info, data: &data, ..Default::default() }).unwrap()
}

fn frames(placed: &[(&str, f64)]) -> RobotFrames {
    let frame = |&(robot, x): &(&str, f64)| RobotFrame { robot: robot.into(), x, ..Default::default() };
    let unmerged = vec![UnmergedRobot { robot: "robot9".into(), reason: "no alignment".into() }];
    let frames = placed.iter().map(frame).collect();
    RobotFrames { reference: "robot1".into(), frames, unmerged, ..Default::default() }
}

#[test]
fn a_map_is_fused_with_its_deformation_by_both_warps() {
    for warp in ["inverse", "forward"] {
        let mut run = Run::new(&format!("warp = \"{warp}\""));
        run.map("robot1", 0.0, &[100, 0, 0, 0, 0, 0, 0, 0, 0, 100, 0]);
        let straight = run.frames(&[("robot1", 0.0)]);
        assert_eq!(straight[0].2, [100, 0, 0, 0, 0, 0, 0, 0, 0, 100, 0]);
        assert!(run.deform("robot1", 2.4).is_empty(), "it waits for its frames");
        // The left end is displaced to the right by two cells and the rest follows: the wall beyond the deformation
        // stays.
        let deformed = run.frames(&[("robot1", 0.0)]);
        assert_eq!(deformed[0].2.iter().filter(|cell| **cell == 100).count(), 2, "{deformed:?}");
        assert_eq!((deformed[0].0, deformed[0].2[0], deformed[0].2[7]), (9, 100, 100), "{warp}: {deformed:?}");
        assert!(run.deform("robot1", 2.4).is_empty() && run.finish().is_empty(), "nothing has changed");
    }
}

#[test]
fn a_deformation_without_frames_is_applied_at_the_end_and_an_invalid_one_is_left_out() {
    let mut run = Run::new("");
    run.map("robot1", 0.0, &[100, 0, 0]);
    run.frames(&[("robot1", 0.0)]);
    run.deform("robot1", f64::NAN);
    assert_eq!((run.0.warnings().len(), run.finish().len()), (1, 0));
    let mut run = Run::new("");
    run.map("robot1", 0.0, &[100, 0, 0]);
    run.frames(&[("robot1", 0.0)]);
    run.deform("robot1", 1.0);
    assert_eq!(run.finish().len(), 1);
}

#[test]
fn a_frame_without_a_map_changes_nothing_until_the_map_comes() {
    let mut run = Run::new("");
    run.map("robot1", 0.0, &[0]);
    run.frames(&[("robot1", 0.0)]);
    assert!(run.frames(&[("robot1", 0.0), ("robot2", 1.0)]).is_empty());
    assert_eq!(run.map("robot2", 0.0, &[100]), [(2, 1, vec![0, 100])]);
}

#[derive(Clone, Default)]
struct List(Rc<RefCell<Vec<Vec<u8>>>>);

impl OutputSink for List {
    fn send(&mut self, _: MessageHeader, bytes: &[u8]) -> Result<(), StageError> {
        self.0.borrow_mut().push(bytes.to_vec());
        Ok(())
    }
}

#[test]
fn an_output_is_the_same_if_nothing_else_is_read() {
    let sent = |is_read: [bool; 3]| {
        let lists = [0; 3].map(|_| List::default());
        let ends = lists.iter().zip(is_read).map(|(list, is_read)| OutputEnd {
            sink: is_read.then(|| Box::new(list.clone()) as Box<dyn OutputSink>),
            ..Default::default()
        });
        let mut node = kind().make(toml::Table::new(), &Context::default(), ends.collect()).unwrap();
        let bytes = encode(&frames(&[("", 0.0)])).unwrap();
        for (port, bytes) in [(0, map(0.0, &[0, 100])), (2, bytes)] {
            node.receive(port, &Message::from_vec(MessageHeader::default(), bytes)).unwrap();
        }
        lists.map(|list| list.0.take())
    };
    let all = sent([true; 3]);
    assert!(all.iter().all(|messages| messages.len() == 1));
    for (port, messages) in all.iter().enumerate() {
        assert_eq!(&sent(std::array::from_fn(|other| other == port))[port], messages);
    }
}
