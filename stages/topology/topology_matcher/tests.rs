//! Topological maps that are drawn by hand, and random ones.

use super::*;
use crate::shared::geometry::{Point2, Pose2, pose, turn_difference};
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{Alignment, TopologicalMap, TopologicalNode, TopologicalPath};
use gridweave_runtime::stage::StageHarness;
use proptest::prelude::*;
use std::f64::consts::TAU;

/// Seven nodes: a long corridor with four arms that look the same after half a turn, and a loose one.
fn seven() -> Topology {
    let nodes = [(0.0, 0.0), (6.0, 0.0), (0.0, 3.0), (6.0, -3.0), (-4.0, 0.0), (10.0, 0.0), (-4.0, -7.0)];
    let paths = [[0, 1], [0, 2], [1, 3], [0, 4], [1, 5], [4, 6]];
    Topology { nodes: nodes.map(|(x, y)| Point2::new(x, y)).into(), paths: paths.into() }
}

/// Four nodes of those, seen from a frame that is turned: nodes 2, 0, 1 and 3.
fn four(transform_seven_four: &Pose2) -> Topology {
    let inverse = transform_seven_four.inverse();
    let nodes = [2, 0, 1, 3].map(|node| inverse * seven().nodes[node]);
    Topology { nodes: nodes.into(), paths: vec![[0, 1], [1, 2], [2, 3]] }
}

fn degrees(matched_pose: &MatchedPose) -> f64 {
    turn_difference(matched_pose.transform_a_b.rotation.angle(), 0.0, TAU).to_degrees().rem_euclid(360.0)
}

#[test]
fn a_pose_is_not_refined_without_refine() {
    let truth = pose(2.0, -1.0, 136.7f64.to_radians());
    let parameters = TopologyMatcherParameters { refine: false, ..Default::default() };
    let found = exhaustive(&seven(), &four(&truth), &parameters).unwrap();
    let turn = degrees(&found.poses[0]);
    assert!((turn / 2.0 - (turn / 2.0).round()).abs() < 1e-9, "{turn}");
    let exact = exhaustive(&seven(), &four(&truth), &TopologyMatcherParameters::default()).unwrap();
    assert!(exact.poses[..2].iter().any(|matched_pose| (degrees(matched_pose) - 136.7).abs() < 1e-6));
}

#[test]
fn icp_converges_to_the_pose_near_its_start() {
    let truth = pose(2.0, -1.0, 0.5);
    let b = Topology { nodes: seven().nodes.iter().map(|node| truth.inverse() * node).collect(), ..seven() };
    let run = icp_svd_from(&seven(), &b, pose(0.0, 0.0, 0.0), &TopologyMatcherParameters::default());
    assert!(run.converged);
    assert!((run.transform_a_b.inverse() * truth).translation.vector.norm() < 1e-6, "{run:?}");
    assert!(run.errors.windows(2).all(|errors| errors[1] <= errors[0] + 1e-9), "{:?}", run.errors);
    assert_eq!(run.errors.len(), 5, "{:?}", run.errors);
}

#[test]
fn one_start_is_misled_by_half_a_turn_and_several_are_not() {
    let truth = pose(3.0, 1.0, 2.4);
    let b = Topology { nodes: seven().nodes.iter().map(|node| truth.inverse() * node).collect(), ..seven() };
    let error = |starts: usize| {
        let (runs, poses) = icp_svd(&seven(), &b, &TopologyMatcherParameters { starts, ..Default::default() });
        assert_eq!(runs.len(), starts);
        poses
            .first()
            .map_or(f64::MAX, |matched_pose| (matched_pose.transform_a_b.inverse() * truth).rotation.angle().abs())
    };
    assert!(error(1) > 0.5);
    assert!(error(12) < 1e-6);
}

#[test]
fn a_run_is_broken_off_at_the_limit() {
    let parameters = TopologyMatcherParameters { max_iterations: 2, tau: 0.0, ..Default::default() };
    let run = icp_svd_from(&seven(), &four(&pose(0.0, 0.0, 1.0)), Pose2::identity(), &parameters);
    assert_eq!((run.errors.len(), run.converged), (2, false));
}

/// Maps with 7 nodes in a hall of 30 m, and a path from each to the next.
fn random_map() -> impl Strategy<Value = Topology> {
    let paths: Vec<[usize; 2]> = (0..6).map(|node| [node, node + 1]).collect();
    prop::collection::vec((-15.0..15.0, -15.0..15.0), 7).prop_map(move |nodes| Topology {
        nodes: nodes.into_iter().map(|(x, y)| Point2::new(x, y)).collect(),
        paths: paths.clone(),
    })
}

/// Every node of b on every node of a, at every turn, counted by equation 2.
fn all_trials(a: &Topology, b: &Topology, parameters: &TopologyMatcherParameters) -> Vec<MatchedPose> {
    let turns = (0..181).map(|turn| nalgebra::UnitComplex::new(turn as f64 * parameters.turn_step));
    let poses = turns.flat_map(|rotation| {
        let pairs = a.nodes.iter().flat_map(|node_a| b.nodes.iter().map(move |node_b| (node_a, node_b)));
        pairs
            .map(move |(node_a, node_b)| Pose2::from_parts((node_a.coords - rotation * node_b.coords).into(), rotation))
    });
    let found = poses.filter_map(|transform_a_b| MatchedPose::at(a, b, transform_a_b, parameters));
    found.collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]
    #[test]
    fn the_best_poses_are_those_of_all_trials(a in random_map(), b in random_map()) {
        let parameters = TopologyMatcherParameters { refine: false, tolerance: 1.5, ..Default::default() };
        let found = exhaustive(&a, &b, &parameters).unwrap();
        let similarities: Vec<usize> = found.poses.iter().map(|matched_pose| matched_pose.similarity).collect();
        let trials = all_trials(&a, &b, &parameters);
        let expected = distinct(trials, parameters.max_hypotheses, &b, &parameters);
        prop_assert_eq!(similarities, expected.iter().map(|trial| trial.similarity).collect::<Vec<_>>());
    }

    #[test]
    fn exchanged_maps_have_the_inverse_pose(a in random_map(), x in -9.0..9.0, y in -9.0..9.0, yaw in -3.0..3.0) {
        let truth = pose(x, y, yaw);
        let b = Topology { nodes: a.nodes.iter().map(|node| truth.inverse() * node).collect(), ..a.clone() };
        let parameters = TopologyMatcherParameters::default();
        let [forth, back] = [(&a, &b), (&b, &a)].map(|(one, other)| exhaustive(one, other, &parameters).unwrap());
        let identity = forth.poses[0].transform_a_b * back.poses[0].transform_a_b;
        prop_assert!(identity.translation.vector.norm() < 1e-6 && identity.rotation.angle().abs() < 1e-6);
        prop_assert!((forth.poses[0].transform_a_b.inverse() * truth).translation.vector.norm() < 1e-6);
    }
}

#[test]
fn the_covariance_is_that_of_nodes_that_err() {
    use nalgebra::{Matrix3, Vector3};
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    let noise = Normal::new(0.0, 0.1).unwrap();
    let parameters = TopologyMatcherParameters { node_stddev: 0.1, ..Default::default() };
    let mut erring = |of: &Topology| Topology {
        nodes: of.nodes.iter().map(|p| p + nalgebra::Vector2::from_fn(|_, _| noise.sample(&mut random))).collect(),
        ..of.clone()
    };
    let (mut seen, mut said, runs) = (Matrix3::zeros(), Matrix3::zeros(), 1500);
    for _ in 0..runs {
        let (a, b) = (erring(&seven()), erring(&seven()));
        let matched_pose = MatchedPose::at(&a, &b, Pose2::identity(), &parameters).unwrap();
        let off = matched_pose.transform_a_b;
        let error = Vector3::new(off.translation.x, off.translation.y, off.rotation.angle());
        seen += error * error.transpose() / f64::from(runs);
        said += matched_pose.covariance / f64::from(runs);
    }
    for index in 0..3 {
        let ratio = said[(index, index)] / seen[(index, index)];
        assert!((0.8..1.6).contains(&ratio), "{index}: {ratio}");
    }
}

fn message(robot: &str, topology: &Topology) -> TopologicalMap {
    let node = |point: &Point2| TopologicalNode { x: point.x, y: point.y, kind: "end".into(), probability: 1.0 };
    let path = |ends: &[usize; 2]| TopologicalPath { start: ends[0] as u32, end: ends[1] as u32, ..Default::default() };
    TopologicalMap {
        robot: robot.into(),
        nodes: topology.nodes.iter().map(node).collect(),
        paths: topology.paths.iter().map(path).collect(),
        ..Default::default()
    }
}

/// What the stage sends for maps that come one after the other.
fn sent(parameters: &str, maps: &[(&str, TopologicalMap)]) -> (Vec<Alignment>, Vec<Alignment>, usize) {
    let mut stage = StageHarness::new(&kind(), parameters).unwrap();
    for (robot, map) in maps {
        stage.give::<TopologicalMap>("topology", robot, LogTime(1), map).unwrap();
    }
    (stage.take("alignment").unwrap(), stage.take("hypotheses").unwrap(), stage.warnings().len())
}

#[test]
fn a_refusal_names_what_is_missing() {
    let b = message("robot2", &four(&pose(0.0, 0.0, 1.0)));
    let (alignments, hypotheses, _) = sent("", &[("robot1", message("robot1", &seven())), ("robot2", b.clone())]);
    assert!(!alignments[0].accepted && alignments[0].reason.contains("min_paths"), "{}", alignments[0].reason);
    assert!(hypotheses.len() >= 2);
    let (alignments, _, _) = sent("min_paths = 3", &[("robot1", message("robot1", &seven())), ("robot2", b)]);
    assert!(!alignments[0].accepted && alignments[0].reason.contains("max_runner_up"), "{}", alignments[0].reason);
    let empty = message("robot2", &Topology::default());
    let (alignments, hypotheses, _) = sent("", &[("robot1", message("robot1", &seven())), ("robot2", empty)]);
    assert!(!alignments[0].accepted && !alignments[0].has_transform && hypotheses.is_empty());
    let large = message("robot2", &Topology { nodes: vec![Point2::origin(); 401], paths: Vec::new() });
    let (alignments, _, _) = sent("", &[("robot1", message("robot1", &seven())), ("robot2", large)]);
    assert!(alignments[0].reason.contains("max_nodes"));
}

#[test]
fn maps_whose_paths_lie_within_the_tolerance_of_each_other_are_refused() {
    // Ten nodes at either end of a corridor, and paths from each to some of the other end.
    let nodes = (0..20).map(|node| Point2::new(9.0 * f64::from(node / 10), 0.01 * f64::from(node % 10)));
    let paths = (0..60).map(|path| [path % 10, 10 + (path / 10 + path) % 10]);
    let dense = Topology { nodes: nodes.collect(), paths: paths.collect() };
    let maps = ["robot1", "robot2"].map(|robot| (robot, message(robot, &dense)));
    let (alignments, hypotheses, _) = sent("max_nodes = 20", &maps);
    assert!(alignments[0].reason.contains("a smaller tolerance") && hypotheses.is_empty(), "{}", alignments[0].reason);
    let (alignments, ..) = sent("max_nodes = 20\ntolerance = 0.001", &maps);
    assert!(!alignments[0].reason.contains("tolerance"), "{}", alignments[0].reason);
}

#[test]
fn wrong_maps_are_left_out_and_the_same_map_is_matched_once() {
    let mut no_number = message("robot2", &seven());
    no_number.nodes[1].x = f64::NAN;
    let mut no_node = message("robot2", &seven());
    no_node.paths[2].end = 7;
    let same = message("robot2", &seven());
    let one = ("robot1", message("robot1", &seven()));
    let (alignments, _, warnings) =
        sent("", &[one, ("robot2", no_number), ("robot2", no_node), ("robot2", same.clone()), ("robot2", same)]);
    assert_eq!((alignments.len(), warnings), (1, 2));
}
