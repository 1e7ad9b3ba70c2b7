//! Inputs of `topology_extractor` and `topology_matcher`: a map with rooms and doors, and topological maps drawn by
//! hand.

use super::Case;
use super::drawing::{FloorPlan, View};
use super::icp_refiner::{CELL, left};
use gridweave_runtime::ros::{Point, TopologicalMap, TopologicalNode, TopologicalPath};
use gridweave_stages::shared::geometry::{Point2, Pose2, pose};
use gridweave_tests::{LogBuilder, TestMap, header};

pub(super) fn cases() -> Vec<Case> {
    vec![
        Case::new("topology_extractor", "office", |log| {
            let view = View { grid_yaw: 0.4, ..left() };
            log.map(1.0, "robot1", &FloorPlan::office().draw(&view));
        }),
        Case::new("topology_extractor", "empty_map", |log| {
            log.map(1.0, "robot1", &TestMap::filled(100, 80, CELL, -1));
            log.map(2.0, "robot1", &TestMap::filled(0, 0, CELL, 0));
        }),
        Case::new("topology_matcher", "four_on_seven_nodes", four_on_seven),
        Case::new("topology_matcher", "accepted", |log| {
            let nodes = [&SEVEN[..], &[[3.0, 4.0], [9.0, 5.0], [-8.0, 3.0]]].concat();
            let paths = [&SEVEN_PATHS[..], &[[2, 7], [7, 8], [4, 9], [0, 7]]].concat();
            log.message(1.0, "/robot1/topology", &drawn("robot1", &nodes, &paths, &Pose2::identity()));
            // The second robot has not seen all of it.
            let (seen, truth) = (&paths[..9], pose(2.0, -1.0, 0.5));
            log.message(2.0, "/robot2/topology", &drawn("robot2", &nodes, seen, &truth));
        }),
        Case::new("topology_matcher", "icp_svd", |log| {
            log.message(1.0, "/robot1/topology", &drawn("robot1", &SEVEN, &SEVEN_PATHS, &Pose2::identity()));
            log.message(2.0, "/robot2/topology", &drawn("robot2", &SEVEN, &SEVEN_PATHS, &pose(1.0, -0.5, 0.3)));
        }),
        Case::new("mcap_source", "topology", four_on_seven),
    ]
}

/// A corridor with two side rooms that look nearly the same after half a turn, and one more way.
const SEVEN: [[f64; 2]; 7] = [[0.0, 0.0], [6.0, 0.0], [0.0, 3.0], [6.0, -3.1], [-4.0, 0.0], [10.0, 0.0], [-4.0, -7.0]];
const SEVEN_PATHS: [[u32; 2]; 6] = [[0, 1], [0, 2], [1, 3], [0, 4], [1, 5], [4, 6]];

/// Four of the nodes are all that the second robot has seen, from a frame that is turned by 136 degrees.
fn four_on_seven(log: &mut LogBuilder) {
    log.message(1.0, "/robot1/topology", &drawn("robot1", &SEVEN, &SEVEN_PATHS, &Pose2::identity()));
    let four = [SEVEN[2], SEVEN[0], SEVEN[1], SEVEN[3]];
    let truth = pose(2.0, -1.0, 136f64.to_radians());
    log.message(2.0, "/robot2/topology", &drawn("robot2", &four, &[[0, 1], [1, 2], [2, 3]], &truth));
}

/// A topological map with nodes at places of robot1's map, as a robot draws it whose map lies there at
/// `transform_1_robot`.
fn drawn(robot: &str, nodes: &[[f64; 2]], paths: &[[u32; 2]], transform_1_robot: &Pose2) -> TopologicalMap {
    let place = |[x, y]: [f64; 2]| transform_1_robot.inverse_transform_point(&Point2::new(x, y));
    let node =
        |at: &[f64; 2]| TopologicalNode { x: place(*at).x, y: place(*at).y, kind: "end".into(), probability: 1.0 };
    let path = |&[start, end]: &[u32; 2]| {
        let ends = [start, end].map(|node| place(nodes[node as usize]));
        TopologicalPath {
            start,
            end,
            length: (ends[0] - ends[1]).norm(),
            probability: 1.0,
            points: ends.iter().map(|end| Point { x: end.x, y: end.y, z: 0.0 }).collect(),
        }
    };
    TopologicalMap {
        header: header(0.0, format!("{robot}/map")),
        robot: robot.into(),
        nodes: nodes.iter().map(node).collect(),
        paths: paths.iter().map(path).collect(),
    }
}
