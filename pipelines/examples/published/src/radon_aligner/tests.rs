//! The aligner on drawn maps, and the stage from outside.

use super::*;
use gridweave_stages::shared::geometry::{Cell, Grid, GridGeometry, Pose2, turn_difference};
use gridweave_stages::shared::test_world::floor_plan::{DrawnMap, FloorPlan, Seen, apart, drawing, seen};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

const STEPS: usize = 360;

/// West and east of the office, with most of it in common.
const WEST: Seen = Seen { low: nalgebra::Point2::new(-0.2, -0.2), high: nalgebra::Point2::new(15.0, 12.2) };
const EAST: Seen = Seen { low: nalgebra::Point2::new(4.0, -0.2), high: nalgebra::Point2::new(20.2, 12.2) };

fn align_drawn(
    a: &DrawnMap,
    b: &DrawnMap,
    parameters: &RadonAlignerParameters,
) -> Result<RadonAlignment, RadonRefusal> {
    let grids = [a, b].map(|map| Grid::new(map.geometry, &map.cells).unwrap());
    let prepared = grids.map(|grid| PreparedMap::new(&grid, parameters.steps()));
    let named = |index: usize, robot| NamedMap { robot, grid: grids[index], prepared: &prepared[index] };
    align(&named(0, "a"), &named(1, "b"), parameters)
}

/// The energy over the angle, by its definition: every point's projection, in bins of a tent's shape.
fn energy_by_definition(points: &WallPoints, angle: f64) -> f64 {
    let project = |angle: f64| {
        let mut bins = std::collections::BTreeMap::new();
        for point in points.points() {
            let place = 2.0 * (point.x * angle.cos() + point.y * angle.sin());
            for (offset, weight) in [(-1, 1.0), (0, 2.0), (1, 1.0)] {
                *bins.entry(place.floor() as i64 + offset).or_insert(0.0) += weight;
            }
        }
        bins.values().map(|value: &f64| value * value).sum::<f64>()
    };
    project(angle) + project(angle + FRAC_PI_2)
}

#[test]
fn the_energy_is_that_of_the_projections() {
    let office = FloorPlan::office().draw(WEST, drawing(1.0, 2.0, 0.3));
    let points = WallPoints::of(&Grid::new(office.geometry, &office.cells).unwrap());
    let energy = energy(&points, 9);
    for (step, energy) in energy.iter().enumerate() {
        let expected = energy_by_definition(&points, step as f64 * FRAC_PI_2 / 9.0);
        // Bins begin elsewhere.
        assert!((energy / expected - 1.0).abs() < 0.02, "{step}: {energy} for {expected}");
    }
}

#[test]
fn the_energy_has_its_peak_at_the_directions_of_walls_and_again_after_a_quarter_turn() {
    for yaw in [0.0, 0.2, FRAC_PI_4, 1.3] {
        let hall = FloorPlan::hall().draw(seen(-0.2, -0.2, 20.2, 12.2), drawing(0.0, 0.0, yaw));
        let prepared = PreparedMap::new(&Grid::new(hall.geometry, &hall.cells).unwrap(), STEPS);
        let error = turn_difference(prepared.energy().main_direction(), -yaw, FRAC_PI_2);
        assert!(error.abs() <= TAU / 1440.0, "{} degrees at {yaw}", error.to_degrees());
    }
}

#[test]
fn the_lattice_of_the_cells_is_no_direction() {
    // A disc has no direction of its own.
    let geometry = GridGeometry { width: 200, height: 200, resolution: 0.05, origin: Pose2::identity() };
    let is_in = |index: usize| {
        let cell = Cell { column: index % 200, row: index / 200 };
        (geometry.centre(cell) - nalgebra::Point2::new(5.0, 5.0)).norm() < 4.0
    };
    let cells: Vec<i8> = (0..200 * 200).map(|index| if is_in(index) { 100 } else { 0 }).collect();
    let energy = energy(&WallPoints::of(&Grid::new(geometry, &cells).unwrap()), STEPS);
    let mean = energy.iter().sum::<f64>() / STEPS as f64;
    assert!(energy.iter().all(|value| (value / mean - 1.0).abs() < 0.01), "{mean}");
}

#[test]
fn two_maps_of_one_office_are_aligned_however_they_are_turned() {
    let parameters = RadonAlignerParameters::default();
    for (number, yaw) in [(1, 0.7), (3, 2.9), (5, -0.8)] {
        let a = FloorPlan::office().draw(WEST, drawing(3.0, 2.0, 0.4));
        let mut view = drawing(12.0, 6.0, yaw);
        view.grid_yaw = 0.3 * f64::from(number);
        view.resolution = 0.05 + 0.005 * f64::from(number);
        let b = FloorPlan::office().draw(EAST, view);
        let found = align_drawn(&a, &b, &parameters).unwrap();
        let (metres, radians) = apart(&found.transform_a_b, &a.transform_to(&b), &b);
        assert!(metres < 0.1 && radians < 0.01, "yaw {yaw}: {metres} m, {} degrees", radians.to_degrees());
        assert!(found.similarity > 0.97, "{found:?}");
        assert!(found.similarities.iter().all(|other| *other <= found.similarity + 1e-2), "{found:?}");
        let deviation = found.covariance[(2, 2)].sqrt();
        assert!(4.0 * deviation > radians && deviation < 0.01, "{} degrees", deviation.to_degrees());
        let eigenvalues = found.covariance.symmetric_eigenvalues();
        assert!(eigenvalues.iter().all(|value| *value > 0.0), "{eigenvalues}");
    }
}

#[test]
fn exchanging_the_maps_gives_the_inverse() {
    let parameters = RadonAlignerParameters::default();
    let a = FloorPlan::office().draw(WEST, drawing(3.0, 2.0, 0.4));
    let b = FloorPlan::office().draw(EAST, drawing(12.0, 6.0, -2.0));
    let (forth, back) = (align_drawn(&a, &b, &parameters).unwrap(), align_drawn(&b, &a, &parameters).unwrap());
    let identity = forth.transform_a_b * back.transform_a_b;
    assert!(identity.rotation.angle().abs() < 1e-3, "{}", identity.rotation.angle());
    let place = nalgebra::Point2::new(3.0, 2.0);
    assert!((identity * place - place).norm() < 0.1, "{identity}");
}

#[test]
fn what_cannot_be_aligned_is_refused() {
    let parameters = RadonAlignerParameters::default();
    let office = FloorPlan::office().draw(WEST, drawing(3.0, 2.0, 0.4));
    let free = FloorPlan::new(&[]).draw(WEST, drawing(3.0, 2.0, 0.4));
    assert_eq!(align_drawn(&office, &free, &parameters).unwrap_err(), RadonRefusal::NoWalls { robot: "b".into() });
    let short = RadonAlignerParameters { max_extent: 10.0, ..parameters.clone() };
    assert_eq!(
        align_drawn(&office, &office, &short).unwrap_err(),
        RadonRefusal::TooLarge { robot: "a".into(), most: 10.0 }
    );
    let strict = RadonAlignerParameters { min_similarity: 0.999, ..parameters.clone() };
    let other = FloorPlan::another_office().draw(EAST, drawing(1.0, 1.0, 1.0));
    assert!(matches!(align_drawn(&office, &other, &strict), Err(RadonRefusal::Dissimilar { .. })));
    // Walls at all angles.
    let spokes: Vec<[f64; 4]> = (0..12)
        .map(|number| {
            let (sin, cos) = (f64::from(number) * TAU / 24.0).sin_cos();
            [10.0 + cos, 6.0 + sin, 10.0 + 4.0 * cos, 6.0 + 4.0 * sin]
        })
        .collect();
    let spokes = FloorPlan::new(&spokes).draw(EAST, drawing(1.0, 1.0, 1.0));
    let sure = RadonAlignerParameters { min_correlation: 0.9, ..parameters.clone() };
    assert!(matches!(align_drawn(&office, &spokes, &sure), Err(RadonRefusal::NoRotation { .. })));
    let all = RadonAlignerParameters { min_overlap: 1.0, ..parameters };
    assert_eq!(align_drawn(&office, &other, &all).unwrap_err(), RadonRefusal::NoOverlap { percent: 100.0 });
}
