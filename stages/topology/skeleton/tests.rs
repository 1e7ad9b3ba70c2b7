//! Skeletons of drawn and of random maps.

use super::thinning::{is_removable, neighbourhood};
use super::*;
use crate::shared::geometry::{Cell, GridGeometry, UNKNOWN, pose};
use crate::shared::test_world::floor_plan::{FloorPlan, drawing, seen};
use proptest::prelude::*;

const RESOLUTION: f64 = 0.05;

/// A grid of `width` cells a row.
fn geometry(width: usize, height: usize) -> GridGeometry {
    GridGeometry { width, height, resolution: RESOLUTION, origin: pose(1.0, -2.0, 0.4) }
}

/// The cells of a drawing: `#` is a wall, a blank unknown, all else free.
fn drawn(rows: &[&str]) -> (GridGeometry, Vec<i8>) {
    let value = |cell: u8| match cell {
        b'#' => 100,
        b' ' => UNKNOWN,
        _ => 0,
    };
    let cells: Vec<i8> = rows.iter().flat_map(|row| row.bytes().map(value)).collect();
    (geometry(rows[0].len(), rows.len()), cells)
}

/// A map of rectangles of free space, given by their corners in cells, in unknown space.
fn rooms(width: usize, height: usize, rooms: &[[usize; 4]]) -> (GridGeometry, Vec<i8>) {
    let mut cells = vec![UNKNOWN; width * height];
    for &[left, low, right, high] in rooms {
        (low..high).for_each(|row| cells[row * width + left..row * width + right].fill(0));
    }
    (geometry(width, height), cells)
}

fn graph((geometry, cells): &(GridGeometry, Vec<i8>), parameters: &SkeletonParameters) -> SkeletonGraph {
    let grid = Grid::new(*geometry, cells).unwrap();
    skeleton_graph(&grid, parameters).map(|(graph, _)| graph).unwrap_or_default()
}

/// The number of connected components of cells, by sides, or by corners too if so asked.
fn pieces(cells: &[u8], stride: usize, value: u8, by_corners: bool) -> usize {
    let mut is_seen = vec![false; cells.len()];
    let mut count = 0;
    for start in (0..cells.len()).filter(|place| cells[*place] == value) {
        if std::mem::replace(&mut is_seen[start], true) {
            continue;
        }
        count += 1;
        let mut open = vec![start];
        while let Some(place) = open.pop() {
            let (row, column) = ((place / stride) as isize, (place % stride) as isize);
            for (dr, dc) in (-1..2).flat_map(|dr| (-1..2).map(move |dc| (dr, dc))) {
                let (r, c) = (row + dr, column + dc);
                let is_inside = r >= 0 && c >= 0 && c < stride as isize && r < (cells.len() / stride) as isize;
                if !is_inside || (dr != 0 && dc != 0 && !by_corners) {
                    continue;
                }
                let next = r as usize * stride + c as usize;
                if cells[next] == value && !std::mem::replace(&mut is_seen[next], true) {
                    open.push(next);
                }
            }
        }
    }
    count
}

/// The skeleton hangs together as the free space does, and no cell of it could be taken away but the ends of lines.
fn check_skeleton(geometry: GridGeometry, cells: &[i8], min_clearance: f64) -> Result<(), TestCaseError> {
    let grid = Grid::new(geometry, cells).unwrap();
    let Some(space) = FreeSpace::of(&grid, 0.0) else { return Ok(()) };
    let distances = DistanceMap::of(space);
    let skeleton = Skeleton::of(&distances, min_clearance);
    let stride = skeleton.window.stride;
    let least = (min_clearance / RESOLUTION).max(1.0) as f32;
    let region: Vec<u8> = distances.distances.iter().map(|distance| u8::from(*distance >= least)).collect();
    prop_assert_eq!(pieces(&skeleton.cells, stride, 1, true), pieces(&region, stride, 1, true), "pieces");
    prop_assert_eq!(pieces(&skeleton.cells, stride, 0, false), pieces(&region, stride, 0, false), "holes");
    for place in skeleton.places.iter().map(|place| *place as usize) {
        let around = neighbourhood(&skeleton.cells, place, stride);
        prop_assert!(around.count_ones() <= 1 || !is_removable(around), "{:?}", skeleton.window.cell(place));
        prop_assert_eq!(region[place], 1);
    }
    let graph = SkeletonGraph::of(&skeleton, &distances);
    let mut groups: Vec<usize> = (0..graph.nodes.len()).collect();
    for [start, end] in graph.paths.iter().map(|path| path.nodes) {
        let (one, other) = (groups[start], groups[end]);
        groups.iter_mut().filter(|group| **group == one).for_each(|group| *group = other);
    }
    groups.sort_unstable();
    groups.dedup();
    prop_assert_eq!(groups.len(), pieces(&skeleton.cells, stride, 1, true), "pieces of the graph");
    // Holes of a cell within a junction of several cells have no way round them.
    let holes = pieces(&skeleton.cells, stride, 0, false) - 1;
    prop_assert!(graph.paths.len() + groups.len() <= graph.nodes.len() + holes, "ways round holes");
    Ok(())
}

proptest! {
    #[test]
    fn distances_are_those_to_the_nearest_cell_that_is_not_free(
        width in 1usize..24, height in 1usize..24, values in prop::collection::vec(0u8..12, 600),
    ) {
        let cells: Vec<i8> = values.iter().map(|value| if *value == 0 { 100 } else { 0 }).take(width * height).collect();
        let grid = Grid::new(geometry(width, height), &cells).unwrap();
        let Some(space) = FreeSpace::of(&grid, 0.0) else { return Ok(()) };
        let distances = DistanceMap::of(space);
        for (row, column) in (0..height).flat_map(|row| (0..width).map(move |column| (row, column))) {
            let around = (-1..=height as isize).flat_map(|row| (-1..=width as isize).map(move |column| (row, column)));
            let blocked = around.filter(|&(r, c)| {
                let is_inside = r >= 0 && c >= 0 && r < height as isize && c < width as isize;
                !is_inside || cells[r as usize * width + c as usize] != 0
            });
            let squares = blocked.map(|(r, c)| (r - row as isize).pow(2) + (c - column as isize).pow(2));
            let expected = (squares.min().unwrap() as f64).sqrt() * RESOLUTION;
            prop_assert!((distances.distance(Cell { column, row }) - expected).abs() < 1e-6, "({column}, {row})");
        }
    }

    #[test]
    fn a_skeleton_is_one_cell_wide_and_hangs_together_as_the_free_space(
        width in 1usize..40, height in 1usize..40, free in prop::collection::vec((0usize..36, 0usize..36, 1usize..14, 1usize..14), 1..9),
        specks in prop::collection::vec((0usize..40, 0usize..40), 0..12), clearance in 0.0f64..0.2,
    ) {
        let corners = free.iter().map(|&(x, y, w, h)| {
            [x.min(width - 1), y.min(height - 1), (x + w).min(width), (y + h).min(height)]
        });
        let (geometry, mut cells) = rooms(width, height, &corners.collect::<Vec<_>>());
        specks.iter().filter(|(x, y)| *x < width && *y < height).for_each(|(x, y)| cells[y * width + x] = 100);
        check_skeleton(geometry, &cells, clearance)?;
    }

    #[test]
    fn a_skeleton_of_noise_hangs_together_as_the_noise(
        width in 1usize..30, height in 1usize..30, values in prop::collection::vec(prop::bool::weighted(0.7), 900),
    ) {
        let cells: Vec<i8> = values.iter().map(|is_free| if *is_free { 0 } else { 100 }).take(width * height).collect();
        check_skeleton(geometry(width, height), &cells, 0.0)?;
    }
}

#[test]
fn small_holes_are_filled_and_large_ones_stay() {
    let map = drawn(&["##########", "#........#", "#.#...## #", "#......# #", "#........#", "##########"]);
    let free = |max_hole: f64| {
        let space = FreeSpace::of(&Grid::new(map.0, &map.1).unwrap(), max_hole).unwrap();
        space.cells.iter().filter(|cell| **cell == 1).count()
    };
    let cell = RESOLUTION * RESOLUTION;
    assert_eq!(free(0.0), 26);
    assert_eq!(free(1.5 * cell), 27, "the single cell");
    assert_eq!(free(100.0), 27, "what touches the border by a side is no hole");
}

#[test]
fn in_a_hall_wider_than_small_numbers_reach_distances_are_exact() {
    let (width, height) = (500, 460);
    let map = rooms(width, height, &[[0, 0, width, height]]);
    let distances = DistanceMap::of(FreeSpace::of(&Grid::new(map.0, &map.1).unwrap(), 0.0).unwrap());
    for (row, column) in (0..height).flat_map(|row| (0..width).map(move |column| (row, column))) {
        let cells = (column + 1).min(width - column).min(row + 1).min(height - row);
        assert_eq!(distances.distance(Cell { column, row }), cells as f64 * RESOLUTION, "({column}, {row})");
    }
}

#[test]
fn a_corridor_is_one_way_from_end_to_end() {
    let graph = graph(&rooms(220, 40, &[[10, 10, 210, 30]]), &SkeletonParameters::default());
    assert_eq!(graph.nodes.len(), 2);
    assert!(graph.nodes.iter().all(|node| node.kind == NodeKind::End && (node.clearance - 0.5).abs() < 0.06));
    let [path] = &graph.paths[..] else { panic!("{:?}", graph.paths) };
    assert!((path.length - 9.0).abs() < 0.2, "{}", path.length);
    assert!(path.cells.iter().all(|cell| cell.row.abs_diff(20) <= 1));
}

#[test]
fn a_square_room_is_a_place_without_ways() {
    let graph = graph(&rooms(140, 140, &[[10, 10, 130, 130]]), &SkeletonParameters::default());
    assert_eq!((graph.nodes.len(), graph.paths.len()), (1, 0));
    assert_eq!(graph.nodes[0].kind, NodeKind::End);
    assert!((graph.nodes[0].clearance - 3.0).abs() < 0.1);
}

#[test]
fn corridors_that_cross_meet_at_a_junction() {
    let cross = rooms(220, 220, &[[10, 100, 210, 120], [100, 10, 120, 210]]);
    let graph = graph(&cross, &SkeletonParameters::default());
    assert_eq!(graph.paths.len(), 4, "{:?}", graph.nodes);
    let junctions = graph.nodes.iter().filter(|node| node.kind == NodeKind::Junction);
    let junctions: Vec<_> = junctions.map(|node| node.cell).collect();
    assert_eq!(junctions.len(), 1);
    assert!(junctions[0].row.abs_diff(110) < 2 && junctions[0].column.abs_diff(110) < 2, "{junctions:?}");
}

#[test]
fn a_closed_corridor_is_a_loop() {
    let mut round = rooms(220, 220, &[[10, 10, 210, 210]]);
    for row in 30..190 {
        round.1[row * 220 + 30..row * 220 + 190].fill(100);
    }
    let graph = graph(&round, &SkeletonParameters::default());
    assert_eq!((graph.nodes.len(), graph.paths.len()), (1, 1));
    assert_eq!(graph.nodes[0].kind, NodeKind::Loop);
    assert_eq!(graph.paths[0].nodes, [0, 0]);
    assert!((graph.paths[0].length - 36.0).abs() < 1.0, "{}", graph.paths[0].length);
}

#[test]
fn an_office_has_the_same_junctions_however_it_is_turned() {
    let found = |yaw: f64| {
        let map = FloorPlan::office().draw(seen(-0.5, -0.5, 20.5, 12.5), drawing(3.0, 4.0, yaw));
        let grid = Grid::new(map.geometry, &map.cells).unwrap();
        let parameters = SkeletonParameters { min_clearance: 0.35, ..Default::default() };
        let (graph, _) = skeleton_graph(&grid, &parameters).unwrap();
        let junctions = graph.nodes.iter().filter(|node| node.kind == NodeKind::Junction);
        let places = junctions.map(|node| map.transform_world_map * map.geometry.centre(node.cell));
        places.collect::<Vec<_>>()
    };
    let junctions = found(0.0);
    assert_eq!(junctions.len(), 7, "one in front of each door but two, and one at the slanted wall");
    for yaw in [0.3, 0.8, 1.2, 2.0] {
        let turned = found(yaw);
        let far = |place: &&crate::shared::geometry::Point2| {
            junctions.iter().all(|junction| (junction - **place).norm() > 0.2)
        };
        assert_eq!(turned.iter().filter(far).count(), 0, "{yaw}: {turned:?}");
        assert!(turned.len() >= 6, "{yaw}: {turned:?}");
    }
}

#[test]
fn nothing_comes_of_maps_without_free_space() {
    for cells in [vec![], vec![UNKNOWN; 12], vec![100; 12], vec![0; 1]] {
        let geometry = geometry(cells.len(), 1);
        assert!(skeleton_graph(&Grid::new(geometry, &cells).unwrap(), &SkeletonParameters::default()).is_none());
    }
}
