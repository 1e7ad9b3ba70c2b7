//! Edges of made-up and of drawn maps, and the stage as a whole.

use super::*;
use crate::pgvd_extractor::{PgvdExtractorParameters, topological_map};
use gridweave_runtime::ros::{Point, TopologicalMap, TopologicalNode, TopologicalPath};
use gridweave_stages::shared::geometry::{Grid, Point2, Pose2, pose};
use gridweave_stages::shared::test_world::floor_plan::{DrawnMap, FloorPlan, apart, drawing, seen};
use nalgebra::{UnitComplex, Vector2};
use proptest::prelude::*;

/// Nodes of a made-up place, and paths between them.
const NODES: [(f64, f64); 7] = [(0.0, 0.0), (4.0, 0.5), (4.0, 5.0), (9.0, 0.0), (9.5, 7.0), (1.0, 3.0), (12.0, 2.0)];
const PATHS: [(usize, usize); 6] = [(0, 1), (1, 2), (1, 3), (3, 4), (2, 5), (3, 6)];

/// The map of the building in its own frame: straight paths with the given probabilities.
fn made_up(transform_place_map: &Pose2, probability: impl Fn(usize) -> f64) -> TopologicalMap {
    let place = |node: usize| transform_place_map.inverse() * Point2::new(NODES[node].0, NODES[node].1);
    let node = |number: usize| {
        let at = place(number);
        TopologicalNode { x: at.x, y: at.y, kind: "junction".into(), probability: 1.0 }
    };
    let path = |(number, (start, end)): (usize, &(usize, usize))| {
        let (first, last) = (place(*start), place(*end));
        TopologicalPath {
            start: *start as u32,
            end: *end as u32,
            length: (last - first).norm(),
            probability: probability(number),
            points: [first, last].map(|point| Point { x: point.x, y: point.y, z: 0.0 }).to_vec(),
        }
    };
    TopologicalMap {
        nodes: (0..NODES.len()).map(node).collect(),
        paths: PATHS.iter().enumerate().map(path).collect(),
        ..Default::default()
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn the_translation_between_two_maps_of_one_place_is_found(
        ax in -9.0..9.0, ay in -9.0..9.0, ayaw in -3.0..3.0, bx in -9.0..9.0, by in -9.0..9.0, byaw in -3.0..3.0,
    ) {
        let (a, b) = (pose(ax, ay, ayaw), pose(bx, by, byaw));
        let truth = a.inverse() * b;
        let parameters = EdgeMatcherParameters::default();
        let [a, b] = [a, b].map(|frame| edges(&made_up(&frame, |_| 1.0), parameters.min_length));
        let found = match_edges(&a, &b, &truth.rotation, 1e-4, &parameters).unwrap();
        prop_assert!((found.transform_a_b.translation.vector - truth.translation.vector).norm() < 1e-6);
        prop_assert_eq!(found.edges, [PATHS.len(); 2]);
        prop_assert!(found.second_best < 0.5);
    }

    #[test]
    fn exchanging_the_maps_gives_the_inverse(x in -9.0..9.0, y in -9.0..9.0, yaw in -3.0..3.0) {
        let parameters = EdgeMatcherParameters::default();
        let a = edges(&made_up(&Pose2::identity(), |_| 1.0), 1.0);
        let b = edges(&made_up(&pose(x, y, yaw), |_| 1.0), 1.0);
        let rotation = UnitComplex::new(yaw + 0.01);
        let forth = match_edges(&a, &b, &rotation, 1e-4, &parameters).unwrap().transform_a_b;
        let back = match_edges(&b, &a, &rotation.inverse(), 1e-4, &parameters).unwrap().transform_a_b;
        // Both turn about the same points, by the means of votes that differ a little.
        prop_assert!(((forth * back).translation.vector).norm() < 0.05, "{}", forth * back);
    }
}

#[test]
fn edges_with_other_ends_or_of_another_shape_or_length_are_not_paired() {
    let parameters = EdgeMatcherParameters::default();
    let rotation = UnitComplex::identity();
    let edge = edges(&made_up(&Pose2::identity(), |_| 0.5), 1.0).remove(0);
    let vote = votes(std::slice::from_ref(&edge), std::slice::from_ref(&edge), &rotation, &parameters);
    assert_eq!((vote.len(), vote[0].weight, vote[0].residual), (1, 0.25 * edge.length, 0.0));
    assert_eq!(edge.is_dead_end, [true, false]);
    let count = |other: Edge| votes(std::slice::from_ref(&edge), &[other], &rotation, &parameters).len();
    let reversed = |mut edge: Edge| {
        edge.shape.reverse();
        edge.is_dead_end.reverse();
        edge
    };
    assert_eq!(count(reversed(edge.clone())), 1, "an edge has no direction");
    assert_eq!(count(Edge { is_dead_end: [false, true], ..edge.clone() }), 0, "the dead end is elsewhere");
    assert_eq!(count(Edge { is_dead_end: [false, false], ..edge.clone() }), 0);
    assert_eq!(count(Edge { length: 1.3 * edge.length, ..edge.clone() }), 0);
    let mut deformed = edge.clone();
    deformed.shape[4..12].iter_mut().for_each(|point| point.y += 0.5);
    assert_eq!(count(deformed), 0);
}

#[test]
fn probable_edges_outvote_improbable_ones() {
    // Two translations, each with as many votes.
    let vote = |x: f64, weight: f64| Vote { edges: [0, 0], translation: Vector2::new(x, 0.0), weight, residual: 0.0 };
    let of = |first: f64| {
        let votes = [vote(0.0, first), vote(0.1, first), vote(9.0, 1.0), vote(9.1, 1.0), vote(-40.0, 0.1)];
        Election::of(&votes, 0.3).unwrap()
    };
    let (strong, weak) = (of(2.0), of(0.4));
    assert!((strong.translation.x - 0.05).abs() < 1e-9 && (strong.second_best() - 0.5).abs() < 1e-9, "{strong:?}");
    assert!((weak.translation.x - 9.05).abs() < 1e-9 && (weak.second_best() - 0.4).abs() < 1e-9, "{weak:?}");
    assert!((strong.spread[(0, 0)] - 0.0025).abs() < 1e-9 && strong.spread[(1, 1)] == 0.0);
    assert_eq!((strong.votes.as_slice(), Election::of(&[], 0.3)), (&[0, 1][..], None));
    let nothing = [vote(1.0, 0.0), vote(5.0, 0.0)];
    assert_eq!(Election::of(&nothing, 0.3).unwrap().second_best(), 1.0, "votes without weight decide nothing");
}

#[test]
fn ambiguous_translations_are_refused() {
    let parameters = EdgeMatcherParameters::default();
    let a = edges(&made_up(&Pose2::identity(), |_| 1.0), 1.0);
    let refused = |b: &[Edge], rotation: f64| match_edges(&a, b, &UnitComplex::new(rotation), 0.0, &parameters);
    assert_eq!(refused(&[], 0.0), Err(MatchRefusal::TooFewEdges { found: 0, least: 3 }));
    assert!(matches!(refused(&a, 1.0), Err(MatchRefusal::TooFewEdges { .. })), "turned wrongly");
    // A row of rooms fits by one room's width more or less nearly as well.
    let room = |number: usize| {
        let mut edge = a[0].clone();
        edge.middle.x += 5.0 * number as f64;
        edge
    };
    let row: Vec<Edge> = (0..6).map(room).collect();
    let found = match_edges(&row, &row, &UnitComplex::identity(), 0.0, &parameters);
    assert!(
        matches!(found, Err(MatchRefusal::Ambiguous { percent, .. }) if (percent - 500.0 / 6.0).abs() < 1e-6),
        "{found:?}"
    );
}

#[test]
fn invalid_paths_are_left_out() {
    let good = made_up(&Pose2::identity(), |_| 1.0);
    let count = |change: &dyn Fn(&mut TopologicalPath)| {
        let mut map = good.clone();
        change(&mut map.paths[0]);
        edges(&map, 1.0).len()
    };
    assert_eq!(count(&|_| ()), PATHS.len());
    assert_eq!(count(&|path| path.start = 99), PATHS.len() - 1);
    assert_eq!(count(&|path| path.points.clear()), PATHS.len() - 1);
    assert_eq!(count(&|path| path.points.truncate(1)), PATHS.len() - 1);
    assert_eq!(count(&|path| path.points[0].x = f64::NAN), PATHS.len() - 1);
    assert_eq!(count(&|path| path.points[1] = path.points[0]), PATHS.len() - 1);
    assert_eq!(count(&|path| path.length = 0.5), PATHS.len() - 1);
    assert_eq!(count(&|path| path.length = f64::INFINITY), PATHS.len() - 1);
    assert_eq!(count(&|path| path.probability = 2.0), PATHS.len() - 1);
}

/// The diagram of a drawn map, of a robot.
fn diagram(robot: &str, drawn: &DrawnMap) -> TopologicalMap {
    let grid = Grid::new(drawn.geometry, &drawn.cells).unwrap();
    let diagram = topological_map(&grid, &PgvdExtractorParameters::default());
    TopologicalMap { robot: robot.into(), ..diagram }
}

/// West and east of the office, in frames of their own.
fn offices() -> [DrawnMap; 2] {
    let office = FloorPlan::office();
    let west = office.draw(seen(-0.2, -0.2, 16.2, 12.2), drawing(3.0, 2.0, 0.4));
    [west, office.draw(seen(4.3, -0.2, 20.2, 12.2), drawing(12.0, 6.0, -2.1))]
}

#[test]
fn the_diagrams_of_two_maps_of_one_office_are_matched_to_some_cells() {
    let [west, east] = offices();
    let truth = west.transform_to(&east);
    let [a, b] = [("a", &west), ("b", &east)].map(|(robot, drawn)| edges(&diagram(robot, drawn), 1.0));
    let found = match_edges(&a, &b, &truth.rotation, 1e-4, &EdgeMatcherParameters::default()).unwrap();
    let (metres, _) = apart(&found.transform_a_b, &truth, &east);
    assert!(metres < 0.15, "{metres} m, {found:?}");
    let deviation = found.covariance[(0, 0)].sqrt();
    assert!(found.covariance.symmetric_eigenvalues().iter().all(|variance| *variance > 0.0) && deviation < 0.5);
}
