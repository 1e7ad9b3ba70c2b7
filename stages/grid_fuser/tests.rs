//! The stage from outside.

use super::kind;
use gridweave_runtime::message::{FixedText, LogTime, Message, MessageHeader};
use gridweave_runtime::ros::{MapMetaData, OccupancyGrid, Pose, RobotFrame, RobotFrames, UnmergedRobot, encode};
use gridweave_runtime::stage::{CollectedOutputs, Context, Node, Stage};

fn stage(parameters: &str) -> Box<dyn Stage> {
    match kind().make(toml::from_str(parameters).unwrap(), &Context::default()).unwrap() {
        Node::Stage(stage) => stage,
        Node::Source(_) | Node::External => panic!("a stage was expected"),
    }
}

struct Run {
    stage: Box<dyn Stage>,
    outputs: CollectedOutputs,
}

impl Run {
    fn new(parameters: &str) -> Self {
        Self { stage: stage(parameters), outputs: CollectedOutputs::new(&kind()) }
    }

    /// Feeds a message and gives the fused maps that it caused: width, height and cells.
    fn feed(&mut self, port: usize, robot: &str, bytes: Vec<u8>) -> Vec<(u32, u32, Vec<i8>)> {
        let header = MessageHeader { robot: FixedText::new(robot).unwrap(), ..Default::default() };
        let mut output = self.outputs.output(LogTime(7_000_000_001));
        self.stage.receive(port, &Message::from_vec(header, bytes), &mut output).unwrap();
        self.fused()
    }

    fn finish(&mut self) -> Vec<(u32, u32, Vec<i8>)> {
        self.stage.finish(&mut self.outputs.output(LogTime(9))).unwrap();
        self.fused()
    }

    /// What was sent on `conflicts`, and the report.
    fn conflicts(&mut self) -> (Vec<Vec<i8>>, serde_json::Value) {
        let read = |message: &Message| {
            assert_eq!(message.header().topic.as_str(), "/map_conflicts");
            message.decode::<OccupancyGrid<'_>>().unwrap().cells().to_vec()
        };
        (self.outputs.take(1).iter().map(read).collect(), self.stage.report().unwrap_or_default())
    }

    fn fused(&mut self) -> Vec<(u32, u32, Vec<i8>)> {
        let read = |message: &Message| {
            let grid: OccupancyGrid<'_> = message.decode().unwrap();
            assert_eq!((message.header().topic.as_str(), grid.header.frame_id.as_str()), ("/map", "world"));
            (grid.info.width, grid.info.height, grid.cells().to_vec())
        };
        self.outputs.take(0).iter().map(read).collect()
    }
}

/// A row of cells of one metre, its corner at x.
fn map(x: f64, cells: &[i8]) -> Vec<u8> {
    let origin = Pose::from(crate::geometry::pose(x, 0.0, 0.0));
    let info = MapMetaData { resolution: 1.0, width: cells.len() as u32, height: 1, origin, ..Default::default() };
    let data: Vec<u8> = cells.iter().map(|cell| *cell as u8).collect();
    encode(&OccupancyGrid { info, data: &data, ..Default::default() }).unwrap()
}

fn frames(placed: &[(&str, f64)]) -> Vec<u8> {
    let frame = |&(robot, x): &(&str, f64)| RobotFrame { robot: robot.into(), x, ..Default::default() };
    let unmerged = vec![UnmergedRobot { robot: "robot9".into(), reason: "no alignment".into() }];
    let frames = placed.iter().map(frame).collect();
    encode(&RobotFrames { reference: "robot1".into(), frames, unmerged, ..Default::default() }).unwrap()
}

#[test]
fn maps_are_fused_once_their_robots_are_placed() {
    let mut run = Run::new("");
    assert!(run.feed(0, "robot1", map(0.0, &[0, 100, -1])).is_empty(), "nothing is placed");
    assert_eq!(run.feed(1, "", frames(&[("robot1", 0.0)])), [(2, 1, vec![0, 100])]);
    assert!(run.feed(0, "robot2", map(0.0, &[50, 60])).is_empty(), "robot2 is not placed");
    let fused = run.feed(1, "", frames(&[("robot1", 0.0), ("robot2", 3.0)]));
    assert_eq!(fused, [(5, 1, vec![0, 100, -1, 50, 60])]);
    assert_eq!(run.feed(0, "robot2", map(0.0, &[70])), [(4, 1, vec![0, 100, -1, 70])]);
    assert!(run.finish().is_empty(), "the last state is out");
}

#[test]
fn frames_that_hardly_change_wait_for_the_end() {
    let mut run = Run::new("");
    run.feed(0, "robot1", map(0.0, &[0]));
    run.feed(0, "robot2", map(0.0, &[100]));
    assert_eq!(run.feed(1, "", frames(&[("robot1", 0.0), ("robot2", 1.0)])).len(), 1);
    assert!(run.feed(1, "", frames(&[("robot1", 0.0), ("robot2", 1.0)])).is_empty());
    assert!(run.feed(1, "", frames(&[("robot1", 0.0), ("robot2", 1.01)])).is_empty());
    assert_eq!(run.feed(1, "", frames(&[("robot1", 0.0), ("robot2", 1.03)])).len(), 1);
    assert!(run.feed(1, "", frames(&[("robot1", 0.0), ("robot2", 1.04)])).is_empty());
    assert_eq!(run.finish().len(), 1);
}

#[test]
fn a_robot_that_is_no_longer_placed_leaves_the_map() {
    let mut run = Run::new("");
    run.feed(0, "robot1", map(0.0, &[0]));
    run.feed(0, "robot2", map(0.0, &[100]));
    run.feed(1, "", frames(&[("robot1", 0.0), ("robot2", 1.0)]));
    assert_eq!(run.feed(1, "", frames(&[("robot1", 0.0)])), [(1, 1, vec![0])]);
}

#[test]
fn a_frame_without_a_map_changes_nothing_until_the_map_comes() {
    let mut run = Run::new("");
    run.feed(0, "robot1", map(0.0, &[0]));
    run.feed(1, "", frames(&[("robot1", 0.0)]));
    assert!(run.feed(1, "", frames(&[("robot1", 0.0), ("robot2", 1.0)])).is_empty());
    assert_eq!(run.feed(0, "robot2", map(0.0, &[100])), [(2, 1, vec![0, 100])]);
}

#[test]
fn absurd_frames_and_broken_maps_are_warned_of_and_left_out() {
    let mut run = Run::new("");
    run.feed(0, "robot1", map(0.0, &[0]));
    run.feed(0, "robot2", map(0.0, &[100]));
    for x in [f64::NAN, f64::INFINITY, -5e4, 1e308] {
        assert_eq!(run.feed(1, "", frames(&[("robot1", 0.0), ("robot2", x)])), [(1, 1, vec![0])]);
    }
    assert_eq!(run.outputs.warnings().values().sum::<u64>(), 4);
    assert!(run.feed(0, "robot1", map(f64::NAN, &[0])).is_empty());
    assert!(run.feed(0, "robot1", vec![1, 2, 3]).is_empty());
    assert!(run.feed(1, "", vec![0, 1]).is_empty());
    assert_eq!(run.outputs.warnings().values().sum::<u64>(), 7);
}

#[test]
fn both_warps_give_the_same_where_nothing_is_turned() {
    for parameters in ["warp = 'inverse'", "warp = 'forward'"] {
        let mut run = Run::new(parameters);
        run.feed(0, "robot1", map(-0.5, &[0, 70, -1, 20]));
        run.feed(0, "robot2", map(0.0, &[100, -1, 30]));
        let fused = run.feed(1, "", frames(&[("robot1", 0.0), ("robot2", 0.5)]));
        assert_eq!(fused, [(4, 1, vec![0, 100, -1, 0])], "{parameters}");
    }
}

#[test]
fn conflicts_lie_on_the_cells_of_the_fused_map_and_their_area_is_reported() {
    for parameters in ["warp = 'inverse'", "warp = 'forward'"] {
        let mut run = Run::new(parameters);
        run.feed(0, "robot1", map(0.0, &[0, 100, 100, -1, 0]));
        run.feed(0, "robot2", map(0.0, &[0, 0, 100, 0, 30]));
        run.feed(1, "", frames(&[("robot1", 0.0)]));
        let (sent, report) = run.conflicts();
        assert_eq!(sent, [[-1; 5]]);
        assert_eq!(
            (report["known_to_one_m2"].as_f64(), report["known_to_several_m2"].as_f64()),
            (Some(4.0), Some(0.0))
        );
        run.feed(1, "", frames(&[("robot1", 0.0), ("robot2", 1.0)]));
        let (sent, report) = run.conflicts();
        assert_eq!(sent, [[-1, 100, 100, -1, 0, -1]], "{parameters}");
        let expected = serde_json::json!({
            "known_to_one_m2": 3.0, "known_to_several_m2": 3.0, "in_conflict_m2": 2.0, "conflict_share": 2.0 / 3.0,
        });
        assert_eq!(report, expected);
    }
}

#[test]
fn nothing_is_reported_of_a_map_that_is_not_made() {
    let mut run = Run::new("");
    run.feed(0, "robot1", map(0.0, &[-1]));
    run.feed(1, "", frames(&[("robot1", 0.0)]));
    assert_eq!(run.conflicts(), (Vec::new(), serde_json::Value::Null));
}

#[test]
fn the_resolution_can_be_given() {
    let mut run = Run::new("resolution = 0.5");
    run.feed(0, "robot1", map(0.0, &[0, 100]));
    let fused = run.feed(1, "", frames(&[("robot1", 0.0)]));
    assert_eq!(fused, [(4, 2, vec![0, 0, 100, 100, 0, 0, 100, 100])]);
}

#[test]
fn empty_maps_give_no_map() {
    let mut run = Run::new("");
    assert!(run.finish().is_empty());
    run.feed(0, "robot1", map(0.0, &[-1, -1]));
    run.feed(0, "robot2", map(0.0, &[]));
    assert!(run.feed(1, "", frames(&[("robot1", 0.0), ("robot2", 0.5)])).is_empty());
    assert!(run.outputs.warnings().is_empty());
}

#[test]
fn parameters_out_of_range_are_reported() {
    let bad = "resolution = 0.0\nmax_probability = 1.0\nmin_probability = 0.0\nmin_move = -1.0\nmin_turn = nan\n\
               max_extent = inf\nmax_cells = 0";
    assert_eq!(kind().check_parameters(&toml::from_str(bad).unwrap()).unwrap().len(), 7);
    assert!(kind().check_parameters(&toml::Table::new()).unwrap().is_empty());
}
