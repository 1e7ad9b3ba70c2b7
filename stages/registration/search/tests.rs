//! Maps with known relative poses, aligned.

use super::{MapAlignerParameters, MapAlignment, MapAlignments, NamedMap, SearchRefusal, align_maps};
use crate::shared::geometry::{Grid, GridGeometry, Point2, Pose2, UNKNOWN, is_occupied, pose};
use crate::shared::test_world::floor_plan::{Drawing, DrawnMap, FloorPlan, apart, drawing, seen};
use nalgebra::Vector3;
use std::f64::consts::TAU;

fn align_grids(a: Grid<'_>, b: Grid<'_>, parameters: &MapAlignerParameters) -> Result<MapAlignments, SearchRefusal> {
    align_maps(&NamedMap { robot: "robot1", grid: a }, &NamedMap { robot: "robot2", grid: b }, parameters)
}

fn hypotheses(a: &DrawnMap, b: &DrawnMap) -> Result<MapAlignments, SearchRefusal> {
    align_grids(a.view().grid, b.view().grid, &MapAlignerParameters::default())
}

/// The best hypothesis.
fn align(a: &DrawnMap, b: &DrawnMap) -> Result<MapAlignment, SearchRefusal> {
    Ok(hypotheses(a, b)?.hypotheses[0].clone())
}

#[track_caller]
fn assert_right(a: &DrawnMap, b: &DrawnMap) {
    let found = align(a, b).unwrap();
    let truth = a.transform_to(b);
    let (metres, radians) = apart(&found.transform_a_b, &truth, b);
    assert!(metres < 0.15 && radians.to_degrees() < 0.8, "{metres} m, {} degrees: {found:?}", radians.to_degrees());

    // The covariance is consistent, wherever the origins of the frames are.
    let offset = found.transform_a_b.translation.vector - truth.translation.vector;
    let turn = truth.rotation.angle_to(&found.transform_a_b.rotation);
    let error = Vector3::new(offset.x, offset.y, turn);
    let deviations = error.dot(&(found.covariance.try_inverse().unwrap() * error)).sqrt();
    assert!(deviations < 3.0, "{deviations} standard deviations");
}

/// A building of 20 x 12 m that is not self-similar: an L, rooms of all sizes, and slanted walls.
pub(crate) fn angular_office() -> FloorPlan {
    FloorPlan::new(&[
        [0.0, 0.0, 20.0, 0.0],
        [20.0, 0.0, 20.0, 8.0],
        [20.0, 8.0, 11.0, 8.0],
        [11.0, 8.0, 11.0, 12.0],
        [11.0, 12.0, 0.0, 12.0],
        [0.0, 12.0, 0.0, 0.0],
        [0.0, 3.4, 3.0, 3.4],
        [4.2, 3.4, 9.0, 3.4],
        [5.5, 0.0, 5.5, 3.4],
        [9.0, 1.2, 9.0, 6.1],
        [9.0, 6.1, 13.0, 4.5],
        [14.2, 4.0, 17.0, 2.9],
        [14.5, 8.0, 14.5, 5.6],
        [17.0, 0.0, 17.0, 2.9],
        [2.6, 5.8, 2.6, 12.0],
        [2.6, 7.9, 6.0, 7.9],
        [7.1, 7.9, 8.3, 9.9],
        [12.0, 1.3, 13.5, 2.2],
    ])
}

/// A building of 70 x 22 m: rooms of all widths on both sides of a corridor.
fn long_building() -> FloorPlan {
    let mut walls =
        vec![[0.0, 0.0, 70.0, 0.0], [70.0, 0.0, 70.0, 22.0], [70.0, 22.0, 0.0, 22.0], [0.0, 22.0, 0.0, 0.0]];
    for (side, (corridor, outside)) in [(9.0, 0.0), (11.5, 22.0)].into_iter().enumerate() {
        let mut x = 0.0;
        for number in 0..40 {
            // Between 2.5 and 7.5 m, in no order that repeats.
            let width = 2.5 + f64::from((number * 37 + side as i32 * 23) % 51) / 10.0;
            let end = f64::min(x + width, 70.0);
            walls.push([x + 1.0, corridor, end, corridor]);
            walls.push([end, corridor, end, outside]);
            x = end;
        }
    }
    FloorPlan::new(&walls)
}

fn all() -> crate::shared::test_world::floor_plan::Seen {
    seen(-0.2, -0.2, 20.2, 12.2)
}

/// A grid of one value.
fn filled(width: usize, height: usize, value: i8) -> (GridGeometry, Vec<i8>) {
    let geometry = GridGeometry { width, height, resolution: 0.05, origin: pose(1.0, 2.0, 0.3) };
    (geometry, vec![value; width * height])
}

#[test]
fn long_deformed_maps_are_found() {
    let plan = long_building();
    let whole = seen(-0.2, -0.2, 70.2, 22.2);
    // Turned by half a step of the search in narrow cells.
    for (most, yaw) in [(0.0, 0.0175), (0.7, 0.0175), (0.7, 1.0)] {
        let drawn = Drawing { resolution: 0.1, ..drawing(0.0, 0.0, 0.0) };
        let a = plan.draw(whole, drawn);
        let b = plan.draw(whole, Drawing { transform_world_map: pose(5.0, 3.0, yaw), ..drawn }).deformed(most);
        let found = align(&a, &b).unwrap();
        let (metres, radians) = apart(&found.transform_a_b, &a.transform_to(&b), &b);
        assert!(metres < 1.5 && radians < 0.06, "deformed by {most}: {metres} m, {radians} rad: {found:?}");
    }
}

#[test]
fn maps_that_share_a_part_are_aligned_at_any_angle() {
    let office = angular_office();
    let a = office.draw(seen(-0.2, -0.2, 15.0, 12.2), drawing(3.0, 2.0, 0.4));
    for yaw in [0.0, 0.61, 1.571, 2.345, -2.9, -0.777] {
        let b = office.draw(seen(4.0, -0.2, 20.2, 12.2), drawing(12.0, 6.0, yaw));
        assert_right(&a, &b);
    }
}

#[test]
fn frames_far_away_turned_grids_and_other_resolutions_change_nothing() {
    let office = angular_office();
    let a = office.draw(all(), Drawing { grid_yaw: 0.9, resolution: 0.1, ..drawing(-300.0, 90.0, 2.0) });
    let b = office.draw(all(), Drawing { grid_yaw: -2.0, resolution: 0.04, ..drawing(70.0, 500.0, -1.3) });
    assert_right(&a, &b);
}

#[test]
fn the_other_order_gives_the_inverse() {
    let office = angular_office();
    let a = office.draw(seen(-0.2, -0.2, 15.0, 12.2), drawing(3.0, 2.0, 0.4));
    let b = office.draw(seen(4.0, -0.2, 20.2, 12.2), drawing(12.0, 6.0, -2.1));
    let (forth, back) = (align(&a, &b).unwrap(), align(&b, &a).unwrap());
    let (metres, radians) = apart(&forth.transform_a_b, &back.transform_a_b.inverse(), &b);
    assert!(metres < 0.15 && radians.to_degrees() < 0.8, "{metres} m, {} degrees", radians.to_degrees());
}

/// A wall along a circle about (10, 6), from east round to the left, as short straight walls.
fn round_wall(radius: f64, share: f64) -> Vec<[f64; 4]> {
    let corner = |i: i32| pose(10.0, 6.0, TAU * share * f64::from(i) / 60.0) * Point2::new(radius, 0.0);
    (0..60).map(|i| [corner(i).x, corner(i).y, corner(i + 1).x, corner(i + 1).y]).collect()
}

#[test]
fn a_round_hall_fits_at_every_angle_and_a_corridor_at_both_ways_round() {
    let corridor = FloorPlan::corridor();
    for place in [FloorPlan::new(&round_wall(5.5, 1.0)), corridor] {
        let part = seen(-0.2, -1.2, 20.2, 12.2);
        let (a, b) = (place.draw(part, drawing(3.0, 2.0, 0.4)), place.draw(part, drawing(12.0, 6.0, -2.1)));
        let found = hypotheses(&a, &b).unwrap();
        assert!(found.second_best_share > 0.9 && found.hypotheses[1].share > 0.9, "{found:?}");
    }
}

#[test]
fn a_curved_wall_with_a_mark_is_aligned() {
    let mut walls = round_wall(5.5, 0.9);
    walls.extend([
        [10.0, 6.0, 14.0, 6.5],
        [8.0, 3.0, 8.0, 8.0],
        [6.0, 7.0, 8.0, 8.0],
        [11.0, 8.0, 13.0, 9.5],
        [10.0, 2.0, 11.5, 4.0],
    ]);
    let place = FloorPlan::new(&walls);
    let (a, b) = (place.draw(all(), drawing(3.0, 2.0, 0.4)), place.draw(all(), drawing(12.0, 6.0, -2.1)));
    assert_right(&a, &b);
}

#[test]
fn maps_of_other_buildings_and_mirrored_ones_fit_nowhere_better_than_elsewhere() {
    let office = FloorPlan::office();
    let a = office.draw(all(), drawing(3.0, 2.0, 0.4));
    for other in [FloorPlan::another_office(), office.mirrored(6.0)] {
        let b = other.draw(all(), drawing(12.0, 6.0, -2.1));
        match hypotheses(&a, &b) {
            Ok(found) => assert!(found.second_best_share > 0.6, "{found:?}"),
            Err(refusal) => assert!(matches!(refusal, SearchRefusal::TooLittleInCommon { .. }), "{refusal}"),
        }
    }
}

#[test]
fn a_map_with_walls_and_no_free_space_is_refused_with_that_reason() {
    let office = FloorPlan::office().draw(all(), drawing(3.0, 2.0, 0.4));
    let grid = office.view().grid;
    let walls: Vec<i8> = grid.cells.iter().map(|value| if is_occupied(*value) { *value } else { UNKNOWN }).collect();
    let walls = Grid::new(grid.geometry, &walls).unwrap();
    for (a, b, robot) in [(walls, grid, "robot1"), (grid, walls, "robot2")] {
        let refusal = align_grids(a, b, &MapAlignerParameters::default()).unwrap_err();
        assert_eq!(refusal, SearchRefusal::NoFreeSpace { robot: robot.into() });
    }
}

#[test]
fn a_map_that_is_too_long_is_refused_and_unknown_cells_do_not_count() {
    let office = FloorPlan::office().draw(all(), drawing(3.0, 2.0, 0.4));
    let parameters = MapAlignerParameters { max_extent: 30.0, ..Default::default() };
    let (geometry, mut cells) = filled(1000, 20, UNKNOWN);
    cells[..10].fill(100);
    cells[10] = 0;
    let aligned = |cells: &[i8]| align_grids(office.view().grid, Grid::new(geometry, cells).unwrap(), &parameters);
    assert!(matches!(aligned(&cells), Err(SearchRefusal::TooLittleInCommon { .. } | SearchRefusal::NoFit)));
    cells[999] = 0;
    assert_eq!(aligned(&cells), Err(SearchRefusal::TooLarge { robot: "robot2".into(), most: 30.0 }));
}

#[test]
fn an_unknown_margin_changes_nothing() {
    let office = angular_office();
    let a = office.draw(seen(-0.2, -0.2, 15.0, 12.2), drawing(3.0, 2.0, 0.4));
    let b = office.draw(seen(4.0, -0.2, 20.2, 12.2), drawing(12.0, 6.0, -2.1));
    let (width, height) = (b.geometry.width + 500, b.geometry.height + 300);
    let mut cells = vec![UNKNOWN; width * height];
    for (row, values) in b.cells.chunks(b.geometry.width).enumerate() {
        let start = (row + 200) * width + 100;
        cells[start..start + values.len()].copy_from_slice(values);
    }
    let shift = Pose2::translation(-100.0 * b.geometry.resolution, -200.0 * b.geometry.resolution);
    let geometry = GridGeometry { width, height, origin: b.geometry.origin * shift, ..b.geometry };
    let wide = align_grids(a.view().grid, Grid::new(geometry, &cells).unwrap(), &MapAlignerParameters::default());
    let (wide, narrow) = (wide.unwrap(), hypotheses(&a, &b).unwrap());
    let (of_wide, of_narrow) = (&wide.hypotheses[0].transform_a_b, &narrow.hypotheses[0].transform_a_b);
    assert!((of_wide.to_homogeneous() - of_narrow.to_homogeneous()).norm() < 1e-9);
    assert!((wide.second_best_share - narrow.second_best_share).abs() < 1e-9);
}

#[test]
fn along_a_corridor_the_covariance_is_long() {
    let corridor = FloorPlan::new(&[[0.0, 0.0, 40.0, 0.0], [0.0, 2.5, 40.0, 2.5]]);
    let part = seen(5.0, -0.2, 35.0, 2.7);
    let (a, b) = (corridor.draw(part, drawing(0.0, 0.0, 0.5)), corridor.draw(part, drawing(0.0, 0.0, 0.5)));
    let found = align(&a, &b).unwrap();
    // In frame a, the frame of both maps, the corridor runs along -0.5 rad.
    let along = pose(0.0, 0.0, -0.5) * nalgebra::Vector2::x();
    let across = pose(0.0, 0.0, -0.5) * nalgebra::Vector2::y();
    let position = found.covariance.fixed_view::<2, 2>(0, 0);
    // Without the part that comes from the turn about the centroid of the walls.
    let deviation = |direction: nalgebra::Vector2<f64>| direction.dot(&(position * direction)).sqrt();
    assert!(deviation(along) > 1.5 && deviation(along) > 3.0 * deviation(across), "{found:?}");
}

/// An open campus of 60 x 40 m: scattered small huts and short walls, none parallel to another.
fn campus() -> FloorPlan {
    let mut walls = Vec::new();
    for number in 0..26 {
        // Spread by irrational steps, so that no two parts look alike.
        let (x, y) = (60.0 * (0.618 * f64::from(number)).fract(), 40.0 * (0.445 * f64::from(number)).fract());
        let corner = |turn: i32, side: f64| {
            let at = pose(x, y, 0.7 * f64::from(number)) * pose(0.0, 0.0, TAU * f64::from(turn) / 4.0);
            at * Point2::new(side, 0.4 * side)
        };
        let side = 0.8 + 1.9 * (0.271 * f64::from(number)).fract();
        for turn in 0..(2 + number % 3) {
            let (start, end) = (corner(turn, side), corner(turn + 1, side));
            walls.push([start.x, start.y, end.x, end.y]);
        }
    }
    FloorPlan::new(&walls)
}

#[test]
fn an_open_campus_with_scattered_huts_is_aligned() {
    let campus = campus();
    let a = campus.draw(seen(-2.0, -2.0, 44.0, 42.0), Drawing { resolution: 0.1, ..drawing(3.0, 2.0, 0.4) });
    for yaw in [0.3, 2.9] {
        let b = campus.draw(seen(16.0, -2.0, 62.0, 42.0), Drawing { resolution: 0.1, ..drawing(50.0, 6.0, yaw) });
        assert_right(&a, &b);
        let found = hypotheses(&a, &b).unwrap();
        assert!(found.second_best_share < 0.5, "{found:?}");
    }
}

#[test]
fn a_round_hall_with_a_few_pillars_is_aligned() {
    let mut walls = round_wall(5.5, 1.0);
    walls.extend([[12.0, 7.0, 12.6, 7.3], [8.0, 3.0, 8.0, 4.1], [6.5, 7.0, 7.2, 7.6], [10.8, 3.4, 11.9, 3.1]]);
    let place = FloorPlan::new(&walls);
    let (a, b) = (place.draw(all(), drawing(3.0, 2.0, 0.4)), place.draw(all(), drawing(12.0, 6.0, -2.1)));
    assert_right(&a, &b);
}
