//! Topological maps of drawn offices.

use super::*;
use crate::shared::geometry::{Grid, GridGeometry, Point2, UNKNOWN, pose};
use crate::shared::test_world::floor_plan::{FloorPlan, drawing, seen};

fn office(yaw: f64) -> (ExtractedTopology, Vec<Point2>) {
    let map = FloorPlan::office().draw(seen(-0.5, -0.5, 20.5, 12.5), drawing(3.0, 4.0, yaw));
    let topology = extract(&Grid::new(map.geometry, &map.cells).unwrap(), &TopologyExtractorParameters::default());
    let doors = topology.nodes.iter().filter(|node| node.kind == "door");
    let doors = doors.map(|node| map.transform_world_map * Point2::new(node.x, node.y)).collect();
    (topology, doors)
}

#[test]
fn the_doors_of_an_office_are_found_however_it_is_turned() {
    // The middles of the gaps in the walls along the corridor, but for one that is too wide for a door.
    let gaps = [(2.5, 5.0), (7.05, 5.0), (12.6, 5.0), (4.8, 7.0), (9.5, 7.0), (15.9, 7.0)];
    for yaw in [0.0, 0.4, 1.1] {
        let (_, doors) = office(yaw);
        let is_found = |gap: &(f64, f64)| doors.iter().any(|door| (door - Point2::new(gap.0, gap.1)).norm() < 0.2);
        let missing: Vec<_> = gaps.iter().filter(|gap| !is_found(gap)).collect();
        assert!(missing.is_empty(), "{yaw}: {missing:?} not among {doors:?}");
    }
}

#[test]
fn paths_connect_nodes() {
    let (topology, _) = office(0.4);
    assert!(topology.paths.len() > 15, "{}", topology.paths.len());
    for path in &topology.paths {
        let [start, end] = [path.start, path.end].map(|node| &topology.nodes[node as usize]);
        let (first, last) = (path.points[0], path.points[path.points.len() - 1]);
        assert_eq!([(start.x, start.y), (end.x, end.y)], [(first.x, first.y), (last.x, last.y)]);
        let straight = (first.x - last.x).hypot(first.y - last.y);
        assert!(path.length >= straight - 1e-9 && path.probability == 1.0);
    }
}

#[test]
fn a_door_is_narrow_and_wide_before_and_behind() {
    let way = [1.0, 0.9, 0.5, 0.5, 0.5, 0.9, 1.0, 1.0];
    assert_eq!(doors(&way, 1.2, 1.4), [3]);
    assert!(doors(&way, 0.9, 1.4).is_empty(), "it is wider than a door");
    assert!(doors(&way, 1.2, 2.5).is_empty(), "the way is not so much wider");
    assert!(doors(&way[2..], 1.2, 1.4).is_empty(), "it is not wide before it");
    assert!(doors(&way[..5], 1.2, 1.4).is_empty(), "it is not wide behind it");
    assert_eq!(doors(&[1.0, 0.4, 1.0, 0.5, 0.4, 2.0], 1.2, 1.4), [1, 4]);
    assert!(doors(&[], 1.2, 1.4).is_empty());
}

#[test]
fn a_way_is_drawn_by_the_points_that_it_turns_at() {
    let points: Vec<Point2> =
        [(0.0, 0.0), (1.0, 0.01), (2.0, 0.0), (2.0, 1.0), (2.0, 2.0)].map(|(x, y)| Point2::new(x, y)).into();
    assert_eq!(simplify(&points, 0.05), [points[0], points[2], points[4]]);
    assert_eq!(simplify(&points, 0.001).len(), 4);
    assert_eq!(simplify(&points[..1], 0.1), points[..1]);
    assert!(simplify(&[], 0.1).is_empty());
    let round = [points[0], points[3], points[0]];
    assert_eq!(simplify(&round, 0.1), round);
}

#[test]
fn small_pieces_are_left_out() {
    let geometry = GridGeometry { width: 100, height: 20, resolution: 0.05, origin: pose(0.0, 0.0, 0.0) };
    let mut cells = vec![UNKNOWN; 2000];
    for row in 2..18 {
        cells[row * 100 + 2..row * 100 + 70].fill(0);
        cells[row * 100 + 80..row * 100 + 96].fill(0);
    }
    let nodes = |min_piece: f64| {
        let parameters = TopologyExtractorParameters { min_piece, ..Default::default() };
        extract(&Grid::new(geometry, &cells).unwrap(), &parameters).nodes.len()
    };
    assert_eq!((nodes(0.5), nodes(2.0), nodes(10.0)), (3, 2, 0));
}
