//! The algorithm against its exact form, and the stage from outside.

use super::*;
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{OccupancyGrid, RobotFrame, RobotFrames};
use gridweave_runtime::stage::StageHarness;
use gridweave_stages::merge::grid_fuser::layout::CellLattice;
use gridweave_stages::merge::grid_fuser::{KnownArea, PlacedGrid};
use gridweave_stages::shared::geometry::{Grid, GridGeometry, Point2, Pose2, UNKNOWN, pose};
use gridweave_stages::shared::test_world::floor_plan::{DrawnMap, FloorPlan, drawing, seen};
use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;

const RESOLUTION: f64 = 0.1;

fn diagonal(x: f64, y: f64, yaw: f64) -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::new(x * x, y * y, yaw * yaw))
}

fn geometry(width: usize, height: usize, origin: Pose2) -> GridGeometry {
    GridGeometry { width, height, resolution: RESOLUTION, origin }
}

/// A field of log-odds with walls, free space and nothing.
fn field(width: usize, height: usize) -> Vec<f32> {
    let value = |index: usize| match (index % width, index / width) {
        (column, row) if column.abs_diff(width / 2) < 2 && row > 4 => 3.5,
        (_, row) if row == height / 3 => 3.5,
        (column, row) if column + row < width => -2.0,
        _ => 0.0,
    };
    (0..width * height).map(value).collect()
}

fn blur(log_odds: &[f32], geometry: &GridGeometry, covariance: &PointCovariance) -> Vec<f32> {
    let mut blurred = vec![0.0; log_odds.len()];
    convolve(log_odds, geometry, covariance, &mut blurred);
    blurred
}

#[test]
fn the_cut_kernels_of_tiles_come_near_the_exact_form() {
    let (width, height) = (43, 38);
    let log_odds = field(width, height);
    let tied = {
        // Translation and turn that go together, as where a map is known best away from its origin.
        let lever = Matrix3::new(1.0, 0.0, 2.0, 0.0, 1.0, -3.0, 0.0, 0.0, 1.0);
        lever * diagonal(0.1, 0.05, 0.05) * lever.transpose()
    };
    for (covariance, frame) in [
        (diagonal(0.15, 0.15, 0.0), pose(1.0, 2.0, 0.7)),
        (diagonal(0.3, 0.1, 0.02), pose(-1.0, 0.5, 2.0)),
        (diagonal(0.1, 0.1, 0.08), pose(2.0, 2.0, 0.0)),
        (tied, pose(0.0, 0.0, -1.0)),
    ] {
        let geometry = geometry(width, height, pose(-0.5, -0.3, 0.0));
        let covariance = PointCovariance::new(&frame, &covariance, RESOLUTION, 10.0).unwrap();
        let (cut, exact) =
            (blur(&log_odds, &geometry, &covariance), convolve_exactly(&log_odds, &geometry, &covariance));
        let errors = cut.iter().zip(&exact).map(|(cut, exact)| (cut - exact).abs());
        let worst = errors.clone().fold(0.0, f32::max);
        let mean = errors.sum::<f32>() / cut.len() as f32;
        // Log-odds lie between -2 and 3.5; the worst cells stand at the edges of tiles.
        assert!(worst < 0.45 && mean < 0.03, "{worst} {mean}");
    }
}

#[test]
fn kernels_on_coarse_cells_come_as_near_the_exact_form() {
    // Odd numbers of cells, so that the last coarse ones are halves; wide in both directions, and more in one.
    let (width, height) = (45, 39);
    let log_odds = field(width, height);
    let geometry = geometry(width, height, pose(-0.5, -0.3, 0.0));
    for (covariance, frame) in
        [(diagonal(0.5, 0.5, 0.0), pose(1.0, 2.0, 0.7)), (diagonal(0.9, 0.45, 0.0), pose(-1.0, 0.5, 2.0))]
    {
        let covariance = PointCovariance::new(&frame, &covariance, RESOLUTION, 10.0).unwrap();
        let (cut, exact) =
            (blur(&log_odds, &geometry, &covariance), convolve_exactly(&log_odds, &geometry, &covariance));
        let worst = cut.iter().zip(&exact).map(|(cut, exact)| (cut - exact).abs()).fold(0.0, f32::max);
        // What is cut off is 1.1 % of the blur: 0.06 where all of it lies on the other side of a border from -2 to 3.5.
        assert!(worst < 0.06, "{worst}");
    }
}

#[test]
fn a_grid_that_is_turned_in_the_world_is_blurred_along_the_axes_of_the_world() {
    let (width, height) = (41, 41);
    let mut log_odds = vec![0.0; width * height];
    log_odds[20 * width + 20] = 1.0;
    // Along x in the world is along y in the grid.
    let geometry = geometry(width, height, pose(0.0, 0.0, std::f64::consts::FRAC_PI_2));
    let covariance = PointCovariance::new(&Pose2::identity(), &diagonal(0.4, 0.0, 0.0), RESOLUTION, 10.0).unwrap();
    let blurred = blur(&log_odds, &geometry, &covariance);
    assert!(blurred[24 * width + 20] > 0.05 && blurred[20 * width + 22] == 0.0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn where_all_points_are_as_uncertain_no_evidence_is_lost(
        x in 0.0..0.7, y in 0.0..0.7, column in 25usize..60, row in 25usize..60,
    ) {
        let geometry = geometry(85, 85, pose(-1.0, 2.0, 0.0));
        let mut log_odds = vec![0.0; geometry.cell_count()];
        log_odds[row * geometry.width + column] = 3.5;
        let covariance = PointCovariance::new(&pose(1.0, 1.0, 0.4), &diagonal(x, y, 0.0), RESOLUTION, 10.0).unwrap();
        let sum: f32 = blur(&log_odds, &geometry, &covariance).iter().sum();
        prop_assert!((sum - 3.5).abs() < 1e-3, "{sum}");
    }

    #[test]
    fn a_point_is_as_uncertain_as_a_sampled_transform_makes_it(
        x in -9.0..9.0, y in -9.0..9.0, yaw in -3.0..3.0, px in -9.0..9.0, py in -9.0..9.0,
    ) {
        // To first order: the difference of the transform by each of its parameters.
        let (frame, covariance) = (pose(x, y, yaw), diagonal(0.1, 0.2, 0.05));
        let point = Point2::new(px, py);
        let step = 1e-6;
        let by = |dx: f64, dy: f64, dyaw: f64| (pose(x + dx, y + dy, yaw + dyaw) * point - frame * point) / step;
        let jacobian = nalgebra::Matrix2x3::from_columns(&[by(step, 0.0, 0.0), by(0.0, step, 0.0), by(0.0, 0.0, step)]);
        let expected = jacobian * covariance * jacobian.transpose();
        let found = PointCovariance::new(&frame, &covariance, 0.0, 100.0).unwrap().at(&(frame * point));
        prop_assert!((found - expected).norm() < 1e-4, "{found} {expected}");
    }
}

#[test]
fn a_deviation_is_no_greater_than_the_most_that_is_allowed() {
    let covariance = PointCovariance::new(&Pose2::identity(), &diagonal(0.1, 0.1, 0.5), 0.0, 0.3).unwrap();
    let corners = [(0.0, 0.0), (0.2, 0.0), (100.0, 0.0)].map(|(x, y)| Point2::new(x, y));
    assert!((covariance.greatest_deviation(&corners[..1]) - 0.1).abs() < 1e-9);
    assert!((covariance.greatest_deviation(&corners[..2]) - 0.1f64.hypot(0.1)).abs() < 1e-9);
    assert!((covariance.greatest_deviation(&corners) - 0.3).abs() < 1e-9);
}

fn office(resolution: f64) -> DrawnMap {
    let view = gridweave_stages::shared::test_world::floor_plan::Drawing { resolution, ..drawing(0.0, 0.0, 0.0) };
    FloorPlan::office().draw(seen(-0.2, -0.2, 14.0, 12.2), view)
}

fn carried(map: &DrawnMap, frame: Pose2, covariance: &Matrix3<f64>) -> Transformed {
    let grid = Grid::new(map.geometry, &map.cells).unwrap();
    let anchor = Point2::from(map.geometry.origin.translation.vector);
    let lattice = CellLattice { anchor, resolution: map.geometry.resolution, max_extent: 100.0, max_cells: 1_000_000 };
    let (placed, area) = (PlacedGrid::rigid(grid, frame), KnownArea::of(&grid));
    transform(&placed, &area, covariance, &lattice, &Default::default()).unwrap().unwrap()
}

#[test]
fn a_map_with_a_certain_frame_is_unchanged() {
    let map = office(0.1);
    let grid = Grid::new(map.geometry, &map.cells).unwrap();
    let carried = carried(&map, Pose2::identity(), &Matrix3::zeros());
    let known = map.cells.iter().filter(|value| **value != UNKNOWN).count();
    assert_eq!(carried.cells.iter().filter(|value| **value != UNKNOWN).count(), known);
    for row in 0..carried.geometry.height {
        for column in 0..carried.geometry.width {
            let cell = gridweave_stages::shared::geometry::Cell { column, row };
            assert_eq!(carried.grid().value(cell), grid.value_at(&carried.geometry.centre(cell)), "{cell:?}");
        }
    }
}

fn frames(placed: &[(&str, Pose2, Matrix3<f64>)]) -> RobotFrames {
    let frame = |(robot, pose, covariance): &(&str, Pose2, Matrix3<f64>)| RobotFrame {
        robot: (*robot).into(),
        frame_id: format!("{robot}/map"),
        x: pose.translation.x,
        y: pose.translation.y,
        yaw: pose.rotation.angle(),
        covariance: gridweave_stages::shared::geometry::row_by_row(covariance),
    };
    RobotFrames { reference: "a".into(), frames: placed.iter().map(frame).collect(), ..Default::default() }
}

#[test]
fn the_stage_sends_maps_of_placed_robots_on_one_lattice_when_they_have_changed() {
    let map = office(0.2);
    let message = OccupancyGrid { info: map.info(), data: &map.bytes(), ..Default::default() };
    let mut stage = StageHarness::new(&kind(), "").unwrap();
    let mut give = |robot: &str| {
        stage.give::<OccupancyGrid<'_>>("map", robot, LogTime(1), &message).unwrap();
        stage.take_messages("map").len()
    };
    assert_eq!((give("b"), give("a")), (0, 0), "nobody is placed");
    let place = |stage: &mut StageHarness, placed: &[(&str, Pose2, Matrix3<f64>)]| -> Vec<(String, GridGeometry)> {
        stage.give::<RobotFrames>("frames", "", LogTime(2), &frames(placed)).unwrap();
        let read = |message: &gridweave_runtime::message::Message| {
            let grid = message.decode::<OccupancyGrid<'_>>().unwrap();
            assert_eq!(grid.header.frame_id, "world");
            (message.header().robot.as_str().to_owned(), GridGeometry::from(&grid.info))
        };
        stage.take_messages("map").iter().map(read).collect()
    };
    let b = ("b", pose(3.3, 2.2, 0.5), diagonal(0.1, 0.1, 0.01));
    let sent = place(&mut stage, &[("a", Pose2::identity(), Matrix3::zeros()), b]);
    assert_eq!(sent.iter().map(|(robot, _)| robot.as_str()).collect::<Vec<_>>(), ["a", "b"]);
    let offset = (sent[1].1.origin.translation.vector - sent[0].1.origin.translation.vector) / 0.2;
    assert!((offset - offset.map(f64::round)).norm() < 1e-6, "{offset}");

    let same = place(&mut stage, &[("a", Pose2::identity(), Matrix3::zeros()), b]);
    assert_eq!(same, [], "nothing has changed");
    let moved = ("b", pose(3.4, 2.2, 0.5), b.2);
    let sent = place(&mut stage, &[("a", Pose2::identity(), Matrix3::zeros()), moved]);
    assert_eq!(sent.iter().map(|(robot, _)| robot.as_str()).collect::<Vec<_>>(), ["b"]);
    let mut absurd = b;
    absurd.2[(0, 0)] = f64::NAN;
    assert_eq!(place(&mut stage, &[("a", Pose2::identity(), Matrix3::zeros()), absurd]), []);
    assert!(
        stage.warnings().keys().any(|text| text.contains("the map of b was not transformed")),
        "{:?}",
        stage.warnings()
    );
    stage.give::<OccupancyGrid<'_>>("map", "a", LogTime(3), &message).unwrap();
    assert!(stage.take_messages("map").is_empty(), "the same map again");
}
