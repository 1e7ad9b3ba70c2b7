//! A log as a merge writes it, small and made up.

use super::{LogBuilder, TestMap};
use gridweave_runtime::ros::{
    Alignment, DeformationNode, Header, MapDeformation, MapDirection, OccupancyGrid, Path, Point, Pose, PoseStamped,
    RobotFrame, RobotFrames, Segment, Segments, TagEstimate, TagEstimates, TopologicalMap, TopologicalNode,
    TopologicalPath, UnmergedRobot, Verdict, Verdicts,
};
use nalgebra::{Isometry2, Vector2};
use tempfile::TempDir;

/// A robot whose name is markup.
pub(crate) const MARKUP: &str = "<script>alert(1)<&'\"";

fn map(topic: &str, seconds: f64, map: &TestMap, log: &mut LogBuilder) {
    let data: Vec<u8> = map.cells.iter().map(|cell| cell.cast_unsigned()).collect();
    log.message(seconds, topic, &OccupancyGrid { header: Header::default(), info: map.info, data: &data });
}

fn frame(robot: &str, x: f64, y: f64, yaw: f64) -> RobotFrame {
    let covariance = [0.01, 0.0, 0.0, 0.0, 0.02, 0.0, 0.0, 0.0, 1e-4];
    RobotFrame { robot: robot.into(), frame_id: format!("{robot}/map"), x, y, yaw, covariance }
}

/// A folder with the log `merged.mcap`: `robot1` and `robot2` are merged after ten seconds, a robot of a strange name is
/// not.
pub(crate) fn merged_folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    let room = TestMap::room();
    let mut log = LogBuilder::new(&folder.path().join("merged.mcap"));
    for robot in ["robot1", "robot2", MARKUP] {
        log.map(0.0, robot, &room).pose(0.0, robot, 1.0, 1.0).pose(1.0, robot, 2.0, 1.5);
    }
    let unmerged = |robot: &str| UnmergedRobot { robot: robot.into(), reason: format!("{MARKUP} has no place") };
    let before = RobotFrames {
        reference: "robot1".into(),
        frames: vec![frame("robot1", 0.0, 0.0, 0.0)],
        unmerged: vec![unmerged("robot2"), unmerged(MARKUP)],
        ..Default::default()
    };
    log.message(5.0, "/robot_frames", &before);
    map("/map", 5.0, &room, &mut log);
    let frames = vec![frame("robot1", 0.0, 0.0, 0.0), frame("robot2", 2.0, 0.5, 0.3)];
    let after = RobotFrames { frames, unmerged: vec![unmerged(MARKUP)], ..before };
    let wall = Segment { x1: 0.0, y1: 0.0, x2: 3.0, y2: 0.0, reliability: 0.9, inliers: 30 };
    let tag = TagEstimate {
        tag_id: MARKUP.into(),
        x: 1.0,
        y: 1.0,
        covariance: [0.04, 0.01, 0.01, 0.02],
        certainty: 0.8,
        readings: 12,
    };
    for robot in ["robot1", "robot2"] {
        let of_robot = || robot.to_owned();
        let segments = Segments { robot: of_robot(), segments: vec![wall], ..Default::default() };
        log.message(10.0, &format!("/{robot}/lines/segments"), &segments);
        let direction = MapDirection { robot: of_robot(), direction: 0.1, valid: true, ..Default::default() };
        log.message(10.0, &format!("/{robot}/quadrants/direction"), &direction);
        let tags = TagEstimates { robot: of_robot(), tags: vec![tag.clone()], ..Default::default() };
        log.message(10.0, &format!("/{robot}/tags/estimates"), &tags);
        let corners = [(0.0, 0.0), (4.0, 0.0), (0.0, 4.0), (4.0, 4.0)];
        let node = |(x, y)| DeformationNode { x, y, dx: 0.05, dy: 0.02, ..Default::default() };
        let nodes = corners.map(node).to_vec();
        let deformation = MapDeformation { robot: of_robot(), spacing: 4.0, nodes, ..Default::default() };
        log.message(10.0, &format!("/{robot}/elastic/deformation"), &deformation);
        let pose =
            |x: f64| PoseStamped { pose: Pose::from(Isometry2::new(Vector2::new(x, 1.0), 0.0)), ..Default::default() };
        let path = Path { poses: vec![pose(1.0), pose(2.0)], ..Default::default() };
        log.message(10.0, &format!("/{robot}/merged_path"), &path);
        let node = |x| TopologicalNode { x, y: 1.0, kind: "door".into(), probability: 1.0 };
        let points = [1.0, 2.0].map(|x| Point { x, y: 1.0, z: 0.0 }).to_vec();
        let way = TopologicalPath { start: 0, end: 1, length: 1.0, probability: 1.0, points };
        let nodes = vec![node(1.0), node(2.0)];
        let ways = TopologicalMap { robot: of_robot(), nodes, paths: vec![way], ..Default::default() };
        log.message(10.0, &format!("/{robot}/topology"), &ways);
    }
    let place = |x: f64, rank, accepted| Alignment {
        a: "robot1".into(),
        b: "robot2".into(),
        has_transform: true,
        x,
        y: 0.5,
        yaw: 0.3,
        score: if accepted { 0.999 } else { 0.2 },
        method: "maps+icp".into(),
        accepted,
        rank,
        hypotheses: 2,
        reason: format!("because of {MARKUP}"),
        ..Default::default()
    };
    log.message(10.0, "/icp/alignment", &place(2.0, 0, true)).message(10.0, "/icp/alignment", &place(-1.0, 1, false));
    let verdict = Verdict { alignment: place(2.0, 0, true), checked: true };
    log.message(10.0, "/verdicts", &Verdicts { verdicts: vec![verdict], ..Default::default() });
    log.message(10.0, "/robot_frames", &after);
    map("/map", 10.0, &room, &mut log);
    map("/map_conflicts", 10.0, &room, &mut log);
    log.finish();
    folder
}
