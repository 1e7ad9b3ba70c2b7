//! Registration on drawn floor plans.

use super::{IcpParameters, IcpRefusal, InitialGuess, Metric, Weighting, refine, register};
use crate::shared::geometry::{Grid, GridGeometry, Pose2, pose};
use crate::shared::test_world::floor_plan::{DrawnMap, FloorPlan, apart, drawing, seen};
use crate::shared::walls::WallMap;
use nalgebra::{Matrix3, Vector2, Vector3};
use proptest::prelude::*;
use std::f64::consts::FRAC_PI_2;

/// A first guess that is off by a shift and a turn about the origin of map b, with a covariance as large.
fn guess(transform_a_b: Pose2, x: f64, y: f64, yaw: f64) -> InitialGuess {
    let covariance = Matrix3::from_diagonal(&Vector3::new(0.3 * 0.3, 0.3 * 0.3, 0.05 * 0.05));
    let mut transform_a_b = transform_a_b;
    transform_a_b.translation.vector += Vector2::new(x, y);
    transform_a_b.rotation *= nalgebra::UnitComplex::new(yaw);
    InitialGuess { transform_a_b, covariance }
}

fn assert_near(found: &Pose2, truth: &Pose2, map_b: &DrawnMap) {
    let (metres, radians) = apart(found, truth, map_b);
    assert!(metres < 0.02, "{metres} m");
    assert!(radians < 0.003, "{radians} rad");
}

#[test]
fn starts_half_a_metre_and_five_degrees_off_find_the_truth() {
    let (a, b) = FloorPlan::west_and_east_of_the_office();
    let truth = a.transform_to(&b);
    for (x, y, degrees) in [(0.0, 0.0, 0.0), (0.5, 0.0, 5.0), (0.0, -0.5, 5.0), (-0.35, 0.35, -5.0), (0.3, 0.4, -5.0)] {
        let initial_guess = guess(truth, x, y, f64::to_radians(degrees));
        let refinement = refine(&a.walls, &b.walls, &initial_guess, &IcpParameters::default());
        assert_near(&refinement.registration.transform_a_b, &truth, &b);
        assert_eq!(refinement.refusal, None);
        assert!(refinement.registration.covariance.cholesky().is_some());
    }
}

#[test]
fn registering_the_other_way_round_finds_the_inverse() {
    let (a, b) = FloorPlan::west_and_east_of_the_office();
    let truth = a.transform_to(&b);
    let initial_guess = guess(truth.inverse(), 0.2, -0.1, 0.03);
    let registration = register(&b.walls, &a.walls, &initial_guess, &IcpParameters::default());
    assert!(registration.converged);
    assert_near(&registration.transform_a_b.inverse(), &truth, &b);
}

#[test]
fn moving_the_frames_moves_the_result_along() {
    let office = FloorPlan::office();
    for (x, y, yaw) in [(40.0, -70.0, 3.0), (-5.0, 0.5, FRAC_PI_2), (0.01, 0.02, -0.7)] {
        let a = office.draw(seen(-0.2, -0.2, 14.0, 12.2), drawing(x, y, yaw));
        let b = office.draw(seen(5.0, -0.2, 20.2, 12.2), drawing(-y, x, yaw - 2.0));
        let truth = a.transform_to(&b);
        let turned = guess(truth, 0.0, 0.0, 0.0).transform_a_b * pose(0.1, -0.1, 0.0);
        let registration = register(
            &a.walls,
            &b.walls,
            &InitialGuess { transform_a_b: turned, ..guess(truth, 0.0, 0.0, 0.0) },
            &IcpParameters::default(),
        );
        assert_near(&registration.transform_a_b, &truth, &b);
    }
}

#[test]
fn every_metric_and_weighting_finds_the_truth() {
    let (a, b) = FloorPlan::west_and_east_of_the_office();
    let truth = a.transform_to(&b);
    for metric in [Metric::PointToLine, Metric::PointToPoint] {
        for weighting in [Weighting::GemanMcclure, Weighting::Huber, Weighting::None] {
            let parameters = IcpParameters { metric, weighting, ..Default::default() };
            let registration = register(&a.walls, &b.walls, &guess(truth, 0.1, 0.1, 0.02), &parameters);
            let (metres, radians) = apart(&registration.transform_a_b, &truth, &b);
            assert!(metres < 0.03 && radians < 0.005, "{metric:?} {weighting:?}: {metres} m, {radians} rad");
        }
    }
}

proptest! {
    #[test]
    fn no_grid_and_no_first_guess_makes_it_fail(
        cells in prop::collection::vec(any::<i8>(), 24 * 18),
        resolution in prop_oneof![0.01..1.0, Just(1e-300), Just(1e300)],
        origin in prop::array::uniform3(prop_oneof![-9.0..9.0, Just(1e20), Just(-1e200), Just(f64::MAX)]),
        start in prop::array::uniform3(prop_oneof![-9.0..9.0, Just(1e20), Just(f64::MAX), Just(f64::NAN)]),
        covariance in prop::array::uniform3(prop_oneof![0.0..9.0, Just(1e-300), Just(1e300), Just(f64::NAN)]),
    ) {
        let geometry = GridGeometry { width: 24, height: 18, resolution, origin: pose(origin[0], origin[1], origin[2]) };
        if let Ok(grid) = Grid::new(geometry, &cells) {
            let map = WallMap::new(&grid, 0.2);
            let parameters = IcpParameters::default();
            let start = pose(start[0], start[1], start[2]);
            let initial_guess = InitialGuess::new(start, Matrix3::from_diagonal(&covariance.into()), &parameters);
            let refinement = refine(&map, &map, &initial_guess, &parameters);
            prop_assert!(!refinement.reason().is_empty());
        }
    }
}

#[test]
fn along_a_bare_corridor_the_first_guess_stays_and_its_uncertainty_is_reported() {
    let corridor = FloorPlan::corridor();
    let a = corridor.draw(seen(0.0, -1.5, 40.0, 1.5), drawing(0.0, 0.0, 0.5));
    let b = corridor.draw(seen(10.0, -1.5, 50.0, 1.5), drawing(20.0, 0.2, 0.7));
    let truth = a.transform_to(&b);
    // Half a metre along the corridor, which runs at -0.5 rad in map a, and a little across.
    let mut initial_guess = guess(truth, 0.5 * f64::cos(0.5) + 0.05, -0.5 * f64::sin(0.5), 0.01);
    initial_guess.covariance = Matrix3::from_diagonal(&Vector3::new(0.6 * 0.6, 0.6 * 0.6, 0.02 * 0.02));
    let refinement = refine(&a.walls, &b.walls, &initial_guess, &IcpParameters::default());
    let registration = &refinement.registration;
    let along = Vector3::new(f64::cos(0.5), -f64::sin(0.5), 0.0);
    let across = Vector3::new(f64::sin(0.5), f64::cos(0.5), 0.0);
    let centre_deviation = |axis: &Vector3<f64>| axis.dot(&(registration.centre_covariance * axis)).sqrt();
    assert!(centre_deviation(&along) > 0.5, "{}", centre_deviation(&along));
    assert!(centre_deviation(&across) < 0.02, "{}", centre_deviation(&across));
    let known_to = |axis: &Vector3<f64>| axis.dot(&(registration.information * axis)).sqrt().recip();
    assert!(known_to(&along) > 0.5, "the position along the corridor is known to {} m", known_to(&along));
    assert!(known_to(&across) < 0.02, "{}", known_to(&across));
    let shift = a.transform_world_map.rotation
        * (registration.transform_a_b * b.transform_world_map.inverse() * nalgebra::Point2::new(30.0, 0.0)
            - truth * b.transform_world_map.inverse() * nalgebra::Point2::new(30.0, 0.0));
    assert!(shift.y.abs() < 0.02, "{shift}");
    assert!((shift.x - 0.5).abs() < 0.15, "{shift}");
    let Some(IcpRefusal::OpenPosition { direction, .. }) = refinement.refusal else {
        panic!("{:?}", refinement.refusal)
    };
    assert!((direction.to_radians() + 0.5).abs() < 0.02, "{direction}");
    assert!(refinement.reason().contains("bare corridor"));
}

#[test]
fn points_that_pull_on_points_do_not_close_a_bare_corridor() {
    let corridor = FloorPlan::corridor();
    let a = corridor.draw(seen(0.0, -1.5, 40.0, 1.5), drawing(0.0, 0.0, 0.5));
    let b = corridor.draw(seen(10.0, -1.5, 50.0, 1.5), drawing(20.0, 0.2, 0.7));
    let mut initial_guess = guess(a.transform_to(&b), 0.0, 0.0, 0.0);
    initial_guess.covariance = Matrix3::from_diagonal(&Vector3::new(0.6 * 0.6, 0.6 * 0.6, 0.02 * 0.02));
    let parameters = IcpParameters { metric: Metric::PointToPoint, max_iterations: 200, ..Default::default() };
    let refinement = refine(&a.walls, &b.walls, &initial_guess, &parameters);
    assert!(matches!(refinement.refusal, Some(IcpRefusal::OpenPosition { .. })), "{}", refinement.reason());
}

#[test]
fn along_a_bare_corridor_a_good_first_guess_suffices() {
    let corridor = FloorPlan::corridor();
    let a = corridor.draw(seen(0.0, -1.5, 40.0, 1.5), drawing(0.0, 0.0, 0.5));
    let b = corridor.draw(seen(10.0, -1.5, 50.0, 1.5), drawing(20.0, 0.2, 0.7));
    let mut initial_guess = guess(a.transform_to(&b), 0.03, 0.02, 0.005);
    initial_guess.covariance = Matrix3::from_diagonal(&Vector3::new(0.05 * 0.05, 0.05 * 0.05, 0.01 * 0.01));
    let refinement = refine(&a.walls, &b.walls, &initial_guess, &IcpParameters::default());
    assert_eq!(refinement.refusal, None);
}
