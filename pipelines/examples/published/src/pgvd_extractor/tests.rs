//! Probabilities, and the stage from outside.

use super::*;
use gridweave_runtime::ros::TopologicalMap;
use gridweave_stages::shared::geometry::{Cell, Grid, GridGeometry, Point2, Pose2, UNKNOWN, pose};
use gridweave_stages::shared::test_world::floor_plan::{FloorPlan, drawing, seen};

const WIDTH: usize = 60;

/// A corridor along x of 20 cells between rows of two values.
fn corridor(below: i8, above: i8, free: i8) -> Vec<i8> {
    let value = |index: usize| match index / WIDTH {
        0..=2 => below,
        23.. => above,
        _ => free,
    };
    (0..WIDTH * 26).map(value).collect()
}

fn geometry() -> GridGeometry {
    GridGeometry { width: WIDTH, height: 26, resolution: 0.05, origin: Pose2::identity() }
}

#[test]
fn a_point_is_as_sure_as_its_own_cell_and_the_two_that_define_it() {
    let at_middle = |cells: &[i8]| {
        let grid = Grid::new(geometry(), cells).unwrap();
        point_probability(&grid, Cell { column: 30, row: 12 }, 0.5)
    };
    for (below, above, free, expected) in [
        (100, 100, 0, 1.0),
        (90, 80, 0, 0.72),
        (90, 80, 20, 0.8 * 0.72),
        (UNKNOWN, 80, 0, 0.4),
        (90, UNKNOWN, 0, 0.45),
        (UNKNOWN, UNKNOWN, 10, 0.9 * 0.25),
    ] {
        let found = at_middle(&corridor(below, above, free));
        assert!((found - expected).abs() < 1e-9, "{below} {above} {free}: {found}");
    }
}

#[test]
fn places_that_nothing_defines_and_places_off_the_grid_do_no_harm() {
    let cells = corridor(0, 0, 0);
    let grid = Grid::new(geometry(), &cells).unwrap();
    for cell in [Cell { column: 30, row: 12 }, Cell { column: 0, row: 0 }, Cell { column: usize::MAX, row: 3 }] {
        for clearance in [0.0, 0.3, 1e9, f64::NAN] {
            let found = point_probability(&grid, cell, clearance);
            assert!((0.0..=1.0).contains(&found), "{cell:?} {clearance}: {found}");
        }
    }
}

fn office_diagram(drawn: &gridweave_stages::shared::test_world::floor_plan::DrawnMap) -> TopologicalMap {
    let grid = Grid::new(drawn.geometry, &drawn.cells).unwrap();
    topological_map(&grid, &PgvdExtractorParameters::default())
}

#[test]
fn ways_in_the_midst_of_a_map_are_surer_than_those_along_its_edge() {
    // The map ends in the middle of the corridor and of rooms.
    let drawn = FloorPlan::office().draw(seen(-0.2, -0.2, 14.0, 6.3), drawing(0.0, 0.0, 0.0));
    let diagram = office_diagram(&drawn);
    let near = |x: f64, y: f64| {
        let place = Point2::new(x, y);
        let at = |path: &&gridweave_runtime::ros::TopologicalPath| {
            path.points.iter().any(|point| (Point2::new(point.x, point.y) - place).norm() < 0.35)
        };
        diagram.paths.iter().find(at).map(|path| path.probability)
    };
    // Between the two side walls of the room in the lower left corner, and in the corridor, of which one wall was seen.
    let (room, corridor) = (near(2.25, 2.5).unwrap(), near(8.0, 5.65).unwrap());
    assert!(room > 0.8 && corridor < 0.75 && corridor < room, "{room} {corridor}");
    for path in &diagram.paths {
        let ends = [path.start, path.end].map(|node| &diagram.nodes[node as usize]);
        let (first, last) = (path.points.first().unwrap(), path.points.last().unwrap());
        assert_eq!([(ends[0].x, ends[0].y), (ends[1].x, ends[1].y)], [(first.x, first.y), (last.x, last.y)]);
        assert!((0.0..=1.0).contains(&path.probability));
    }
}

#[test]
fn the_diagram_is_drawn_in_the_frame_of_the_map() {
    let mut view = drawing(3.0, 2.0, 0.4);
    view.grid_yaw = 0.9;
    let (here, there) = (
        FloorPlan::office().draw(seen(-0.2, -0.2, 20.2, 12.2), drawing(0.0, 0.0, 0.0)),
        FloorPlan::office().draw(seen(-0.2, -0.2, 20.2, 12.2), view),
    );
    let (here, there) = (office_diagram(&here), office_diagram(&there));
    let junctions = |map: &TopologicalMap, frame: &Pose2| {
        let of_kind = map.nodes.iter().filter(|node| node.kind == "junction");
        of_kind.map(|node| frame * Point2::new(node.x, node.y)).collect::<Vec<_>>()
    };
    let (here, there) = (junctions(&here, &Pose2::identity()), junctions(&there, &pose(3.0, 2.0, 0.4)));
    let found = here.iter().filter(|one| there.iter().any(|other| (*one - other).norm() < 0.3)).count();
    assert!(here.len() > 5 && 10 * found >= 8 * here.len(), "{found} of {}", here.len());
}
