//! The method on drawn maps, and the stage as a whole.

use super::*;
use crate::pair_aligner::test_maps::{check_extreme_maps, named};
use gridweave_stages::shared::geometry::turn_difference;
use gridweave_stages::shared::test_world::floor_plan::{Drawing, DrawnMap, FloorPlan, apart, drawing, seen};
use nalgebra::UnitComplex;
use proptest::prelude::*;
use std::f64::consts::PI;

fn walls(points: &[[f64; 2]]) -> WallCells {
    let radius = points.iter().map(|[x, y]| x.hypot(*y)).fold(0.0, f64::max);
    let points = points.iter().map(|[x, y]| [*x as f32, *y as f32]).collect();
    WallCells { middle: nalgebra::Point2::origin(), radius, points }
}

/// Points along the sides of an angle, the arms of which are of unequal length.
fn corner(yaw: f64) -> Vec<[f64; 2]> {
    let arms =
        (0..200).map(|index| (0.05 * f64::from(index), 0.0)).chain((0..90).map(|index| (0.0, 0.05 * f64::from(index))));
    let turn = UnitComplex::new(yaw);
    arms.map(|(x, y)| (turn * nalgebra::Vector2::new(x, y)).into()).collect()
}

fn align(a: &DrawnMap, b: &DrawnMap) -> Vec<RatedPose> {
    let parameters = HoughSpectrumParameters::default();
    let mut found = align_spectra(&named("a", a), &named("b", b), &parameters).unwrap();
    parameters.criterion().rank(&mut found);
    found
}

#[test]
fn a_line_has_all_its_energy_in_its_normal() {
    let line: Vec<[f64; 2]> = (-50..=50).map(|index| [0.05 * f64::from(index), 0.0]).collect();
    let spectrum = HoughSpectrum::new(&walls(&line), 180, 0.05);
    assert_eq!(spectrum.main_direction(), PI / 2.0);
    assert_eq!(spectrum.values[90], 101.0 * 101.0);
    assert_eq!(spectrum.values[0], 101.0, "seen from its end every point is on a line of its own");
}

#[test]
fn the_spectrum_of_one_cell_is_flat_and_one_direction_is_enough() {
    let spectrum = HoughSpectrum::new(&walls(&[[0.0, 0.0]]), 7, 0.05);
    assert_eq!((&spectrum.values, spectrum.main_direction()), (&vec![1.0; 7], 0.0));
    assert_eq!(HoughSpectrum { values: Vec::new() }.main_direction(), 0.0);
    let one = HoughSpectrum { values: vec![3.0] };
    assert!(correlate_spectra(&one, &one) == [9.0] && rotations(&one, &one, 4, 0.1).is_empty(), "nothing stands out");
}

proptest! {
    #[test]
    fn a_turn_of_the_map_shifts_the_spectrum_and_is_found(yaw in -4.0..4.0, frame in -4.0..4.0) {
        let a = HoughSpectrum::new(&walls(&corner(frame)), 720, 0.05);
        let b = HoughSpectrum::new(&walls(&corner(frame - yaw)), 720, 0.05);
        let found = rotations(&a, &b, 1, 0.1)[0];
        prop_assert!(turn_difference(found.angle, yaw, PI).abs() < 0.0088, "{found:?}");
        prop_assert!((0.0..PI).contains(&found.angle) && found.deviation > 0.0 && found.deviation < 0.1);
    }

    #[test]
    fn the_correlation_of_spectra_is_the_sum_that_the_paper_writes(
        a in prop::collection::vec(0u32..1000, 9), b in prop::collection::vec(0u32..1000, 9),
    ) {
        let spectrum = |values: &[u32]| HoughSpectrum { values: values.iter().map(|value| f64::from(*value)).collect() };
        let expected: Vec<f64> = (0..9)
            .map(|k| (0..9).map(|i| f64::from(a[i]) * f64::from(b[(i + 9 - k) % 9])).sum())
            .collect();
        prop_assert_eq!(correlate_spectra(&spectrum(&a), &spectrum(&b)), expected);
    }

    #[test]
    fn a_shift_along_an_axis_is_found(
        cells in prop::collection::btree_set(0i32..400, 20..60), shift in -300i32..300, cell in 0.02..0.3,
    ) {
        let of = |shift: i32| {
            let points: Vec<[f64; 2]> =
                cells.iter().map(|place| [(f64::from(place + shift) - 200.0) * cell, 0.3 * cell]).collect();
            project(&walls(&points), 0.0, cell)
        };
        let ([x_a, y_a], [x_b, y_b]) = (of(0), of(shift));
        let found = [shifts(&x_a, &x_b, cell, 1, 0.1)[0], shifts(&y_a, &y_b, cell, 1, 0.1)[0]];
        prop_assert!((found[0].metres + f64::from(shift) * cell).abs() <= 1.01 * cell, "{found:?} {shift}");
        prop_assert!(found[1].metres.abs() <= 1.01 * cell && found[0].deviation > 0.0);
    }
}

#[test]
fn maps_of_one_building_are_aligned_at_any_angle() {
    let office = FloorPlan::office();
    let a = office.draw(seen(-0.2, -0.2, 20.2, 12.2), drawing(3.0, 2.0, 0.4));
    for yaw in [0.0, 0.61, 1.571, 2.345, -2.9] {
        let b = office.draw(seen(-0.2, -0.2, 20.2, 12.2), Drawing { grid_yaw: 1.1, ..drawing(12.0, 6.0, yaw) });
        let found = align(&a, &b);
        let (metres, radians) = apart(&found[0].transform_a_b, &a.transform_to(&b), &b);
        assert!(metres < 0.05 && radians < 0.004, "{metres} m, {radians} rad at {yaw}");
        assert!(found[0].index.omega() > 0.95 && found[0].overlap > 0.9, "{:?}", found[0]);
        assert!(found[1].index.omega() < found[0].index.omega(), "{found:?}");
    }
}

#[test]
fn the_covariance_is_that_of_the_place_in_the_middle_of_the_map() {
    let office = FloorPlan::office();
    let a = office.draw(seen(-0.2, -0.2, 20.2, 12.2), drawing(3.0, 2.0, 0.4));
    let near = office.draw(seen(-0.2, -0.2, 20.2, 12.2), drawing(10.0, 6.0, 1.0));
    let far = office.draw(seen(-0.2, -0.2, 20.2, 12.2), drawing(400.0, -700.0, 1.0));
    for b in [&near, &far] {
        let found = align(&a, b)[0];
        let middle = b.transform_world_map.inverse() * nalgebra::Point2::new(10.0, 6.0);
        let jacobian = gridweave_stages::shared::geometry::point_jacobian(&found.transform_a_b, &middle);
        let deviations = (jacobian * found.covariance * jacobian.transpose()).diagonal().map(f64::sqrt);
        assert!(deviations.min() > 0.01 && deviations.max() < 0.2, "{deviations}");
        assert!(found.covariance.m33.sqrt() < 0.02 && found.covariance.cholesky().is_some());
    }
}

#[test]
fn maps_without_walls_and_too_large_ones_are_refused_and_a_single_cell_fits_anywhere() {
    let office = FloorPlan::office().draw(seen(-0.2, -0.2, 20.2, 12.2), drawing(3.0, 2.0, 0.4));
    check_extreme_maps(&office, 0, |a, b, max_extent| {
        align_spectra(a, b, &HoughSpectrumParameters { max_extent, ..Default::default() })
    });
}
