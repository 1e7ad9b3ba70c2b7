//! Inputs of the stages of group mapping, from the rotation to the fused map.

use super::drawing::{FloorPlan, View};
use super::{Case, pair};
use gridweave_runtime::ros::{
    Alignment, Point, RobotFrame, RobotFrames, TopologicalMap, TopologicalNode, TopologicalPath,
};
use gridweave_stages::shared::geometry::{Point2, Pose2, UNKNOWN, pose, row_by_row};
use gridweave_tests::{LogBuilder, TestMap, header};
use nalgebra::{Matrix3, Vector3};

const CELL: f32 = 0.1;

pub(super) fn cases() -> Vec<Case> {
    [radon_aligner(), uncertain_transform(), entropy_fuser(), pgvd_extractor(), edge_matcher()].concat()
}

fn radon_aligner() -> Vec<Case> {
    let case = |name, write| Case::new("radon_aligner", name, write);
    vec![
        case("two_overlapping_maps", maps),
        case("turned_origins_and_resolutions", |log| {
            log.map(1.0, "robot1", &FloorPlan::office().draw(&View { grid_yaw: 0.6, ..left() }));
            log.map(2.0, "robot2", &FloorPlan::office().draw(&View { grid_yaw: -1.1, resolution: 0.08, ..right() }));
        }),
        case("another_building", |log| {
            pair(log, &FloorPlan::office().draw(&left()), &FloorPlan::another_office().draw(&right()))
        }),
        case("nothing_to_align", |log| {
            pair(log, &FloorPlan::office().draw(&left()), &TestMap::filled(100, 80, CELL, 0));
            log.map(3.0, "robot2", &TestMap::filled(100, 80, CELL, UNKNOWN));
            log.map(4.0, "robot2", &TestMap::filled(0, 0, CELL, 0));
            let mut point = TestMap::filled(100, 80, CELL, 0);
            point.cells[40 * 100 + 50] = 100;
            log.map(5.0, "robot2", &point);
            log.map(6.0, "robot2", &TestMap::filled(100, 80, CELL, 100));
            log.map(7.0, "robot2", &TestMap::filled(3, 3, 0.0, 0));
            log.raw(8.0, "/robot2/map", "nav_msgs/msg/OccupancyGrid", &[0, 1, 0, 0, 9]);
        }),
    ]
}

fn uncertain_transform() -> Vec<Case> {
    let case = |name, write| Case::new("uncertain_transform", name, write);
    vec![
        case("walls_far_away_are_blurred_more", |log| {
            maps(log);
            place(log, 3.0, &[("robot1", Pose2::identity(), [0.0; 3]), ("robot2", truth(), [0.05, 0.05, 0.02])]);
        }),
        case("one_point", |log| {
            log.map(1.0, "robot1", &TestMap::filled(1, 1, 1.0, 0));
            let mut point = TestMap::filled(5, 5, 1.0, UNKNOWN);
            point.cells[12] = 100;
            log.map(2.0, "robot2", &point);
            place(log, 3.0, &[("robot1", Pose2::identity(), [0.0; 3]), ("robot2", Pose2::identity(), [1.0, 0.5, 0.0])]);
        }),
        case("absurd_frames", |log| {
            maps(log);
            for (second, x) in [f64::NAN, f64::INFINITY, 1e200].into_iter().enumerate() {
                let second = 3.0 + second as f64;
                let robot1 = ("robot1", Pose2::identity(), [0.0; 3]);
                place(log, second, &[robot1, ("robot2", pose(x, 0.0, 0.0), [0.1; 3])]);
                place(log, second + 0.5, &[robot1, ("robot2", truth(), [x, 0.1, 0.1])]);
            }
            log.map(9.0, "robot1", &TestMap::filled(0, 0, CELL, 0));
        }),
    ]
}

fn entropy_fuser() -> Vec<Case> {
    let case = |name, write| Case::new("entropy_fuser", name, write);
    vec![
        case("agreement_and_contradiction", |log| {
            log.map(1.0, "robot1", &row_of(&[0, 0, 0, 100, 100, 30, 70, 50, -1, 70]));
            log.map(1.0, "robot2", &row_of(&[0, 100, 40, 100, 20, 70, 80, 60, 30, -1]));
            log.map(1.0, "robot3", &row_of(&[0, 0, 40, 0, 20, 70, 20, 90, 30, -1]));
            let all = ["robot1", "robot2", "robot3"].map(|robot| (robot, Pose2::identity(), [0.0; 3]));
            place(log, 1.0, &all[..2]);
            place(log, 2.0, &all);
        }),
        case("another_lattice", |log| {
            pair(log, &row_of(&[0, 100]), &row_of(&[100, 0]).at(0.5, 0.0, 0.0));
            log.map(3.0, "robot3", &row_of(&[100, 0]).at(1.0, -1.0, 0.0));
            let all = ["robot1", "robot2", "robot3"].map(|robot| (robot, Pose2::identity(), [0.0; 3]));
            place(log, 3.0, &all);
        }),
        case("when_it_is_sent", |log| {
            let both = ["robot1", "robot2"].map(|robot| (robot, Pose2::identity(), [0.0; 3]));
            log.map(1.0, "robot1", &row_of(&[0, 100])).map(1.0, "robot2", &row_of(&[-1, 100]));
            place(log, 1.0, &both);
            place(log, 2.0, &both);
            log.map(3.0, "robot2", &row_of(&[0, 100]));
            log.map(4.0, "robot2", &row_of(&[0, 0]));
            place(log, 5.0, &both[..1]);
            log.map(6.0, "robot1", &row_of(&[20, 80]));
        }),
    ]
}

fn pgvd_extractor() -> Vec<Case> {
    let case = |name, write| Case::new("pgvd_extractor", name, write);
    vec![
        case("office", |log| {
            log.map(1.0, "robot1", &FloorPlan::office().draw(&left()));
        }),
        case("corridor_of_two_walls", |log| {
            let corridor = FloorPlan::new(&[[0.0, 0.5, 30.0, 0.5], [0.0, 2.5, 30.0, 2.5]]);
            log.map(1.0, "robot1", &corridor.draw(&View::of([0.0, 0.4], [12.0, 2.6], CELL)));
            // The same as one who has seen one wall of it knows it.
            log.map(2.0, "robot1", &corridor.draw(&View::of([0.0, 0.4], [12.0, 2.2], CELL)));
        }),
        case("empty_map", |log| {
            log.map(1.0, "robot1", &TestMap::filled(100, 80, CELL, UNKNOWN));
            log.map(2.0, "robot1", &TestMap::filled(0, 0, CELL, 0));
            log.map(3.0, "robot1", &TestMap::filled(100, 80, CELL, 100));
            log.map(4.0, "robot1", &TestMap::filled(3, 3, 0.0, 0));
        }),
    ]
}

fn edge_matcher() -> Vec<Case> {
    let case = |name, write| Case::new("edge_matcher", name, write);
    vec![
        case("translation_by_votes", |log| {
            log.message(1.0, "/robot1/pgvd/topological_map", &graph("robot1", &Pose2::identity()));
            log.message(1.0, "/robot2/pgvd/topological_map", &graph("robot2", &truth()));
            rotation(log, 1.0, truth().rotation.angle());
        }),
        case("turned_wrongly", |log| {
            log.message(1.0, "/robot1/pgvd/topological_map", &graph("robot1", &Pose2::identity()));
            log.message(1.0, "/robot2/pgvd/topological_map", &graph("robot2", &truth()));
            rotation(log, 1.0, truth().rotation.angle() + std::f64::consts::FRAC_PI_2);
        }),
        case("no_map_of_one", |log| {
            log.message(1.0, "/robot1/pgvd/topological_map", &graph("robot1", &Pose2::identity()));
            rotation(log, 2.0, 0.0);
            rotation(log, 3.0, f64::NAN);
        }),
    ]
}

/// What robot1 sees of the office; its map frame is the building's.
fn left() -> View {
    View::of([-0.2, -0.2], [11.0, 10.2], CELL)
}

/// What robot2 sees, in its own map frame.
fn right() -> View {
    View { transform_building_map: truth(), ..View::of([2.0, -0.2], [14.2, 10.2], CELL) }
}

/// `T_1_2`.
fn truth() -> Pose2 {
    pose(8.0, 3.0, 2.0)
}

fn maps(log: &mut LogBuilder) {
    pair(log, &FloorPlan::office().draw(&left()), &FloorPlan::office().draw(&right()));
}

/// One row of cells of one metre.
fn row_of(cells: &[i8]) -> TestMap {
    TestMap { cells: cells.to_vec(), ..TestMap::filled(cells.len() as u32, 1, 1.0, 0) }
}

/// Poses of robots in the map of robot1, with the standard deviations of x, y and yaw.
fn place(log: &mut LogBuilder, seconds: f64, placed: &[(&str, Pose2, [f64; 3])]) {
    let frame = |(robot, transform, deviations): &(&str, Pose2, [f64; 3])| RobotFrame {
        robot: (*robot).into(),
        frame_id: format!("{robot}/map"),
        x: transform.translation.x,
        y: transform.translation.y,
        yaw: transform.rotation.angle(),
        covariance: diagonal(*deviations),
    };
    let frames = RobotFrames {
        header: header(seconds, RobotFrames::WORLD),
        reference: "robot1".into(),
        frames: placed.iter().map(frame).collect(),
        ..Default::default()
    };
    log.message(seconds, "/robot_frames", &frames);
}

fn diagonal(deviations: [f64; 3]) -> [f64; 9] {
    row_by_row(&Matrix3::from_diagonal(&Vector3::from(deviations.map(|deviation| deviation * deviation))))
}

/// The ways of a place with rooms at a corridor, as a robot draws them whose map frame lies there at that pose.
fn graph(robot: &str, transform_place_map: &Pose2) -> TopologicalMap {
    const NODES: [(f64, f64); 8] =
        [(0.0, 5.0), (3.0, 5.0), (3.0, 1.0), (7.5, 5.0), (7.5, 9.0), (9.0, 5.0), (9.0, 1.5), (13.0, 5.0)];
    const PATHS: [(usize, usize); 7] = [(0, 1), (1, 2), (1, 3), (3, 4), (3, 5), (5, 6), (5, 7)];
    let place = |node: usize| transform_place_map.inverse() * Point2::new(NODES[node].0, NODES[node].1);
    let node = |number: usize| {
        let (at, ways) =
            (place(number), PATHS.iter().filter(|(start, end)| *start == number || *end == number).count());
        let kind = if ways > 1 { "junction" } else { "end" };
        TopologicalNode { x: at.x, y: at.y, kind: kind.into(), probability: 0.9 }
    };
    let path = |(start, end): &(usize, usize)| {
        let (first, last) = (place(*start), place(*end));
        TopologicalPath {
            start: *start as u32,
            end: *end as u32,
            length: (last - first).norm(),
            probability: 0.9,
            points: [first, last].map(|point| Point { x: point.x, y: point.y, z: 0.0 }).to_vec(),
        }
    };
    TopologicalMap {
        header: header(1.0, format!("{robot}/map")),
        robot: robot.into(),
        nodes: (0..NODES.len()).map(node).collect(),
        paths: PATHS.iter().map(path).collect(),
    }
}

/// An alignment of which the rotation alone is right.
fn rotation(log: &mut LogBuilder, seconds: f64, yaw: f64) {
    let alignment = Alignment {
        header: header(seconds, "robot1/map"),
        a: "robot1".into(),
        b: "robot2".into(),
        source: "maps".into(),
        has_transform: true,
        x: 100.0,
        y: -100.0,
        yaw,
        covariance: diagonal([1.0, 1.0, 0.01]),
        score: 0.9,
        method: "radon".into(),
        accepted: true,
        reason: "the directions of the walls".into(),
        ..Default::default()
    };
    log.message(seconds, "/radon/alignment", &alignment);
}
