//! A relative pose that a published method has found.

use crate::acceptance_index::AcceptanceIndex;
use gridweave_stages::shared::geometry::{Grid, Point2, Pose2, is_free, is_occupied, turn_difference};
use nalgebra::Matrix3;
use std::f64::consts::TAU;

/// Area of the free and occupied cells of a map, square metres.
pub fn known_area(grid: &Grid<'_>) -> f64 {
    let says_something = grid.cells.iter().filter(|value| is_free(**value) || is_occupied(**value)).count();
    says_something as f64 * grid.geometry.resolution.powi(2)
}

/// A hypothesis of the relative pose of two maps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RatedPose {
    /// `T_a_b`.
    pub transform_a_b: Pose2,
    /// Covariance of (x, y, yaw) of `T_a_b`, metres and radians.
    pub covariance: Matrix3<f64>,
    /// Cells that agree at that pose.
    pub index: AcceptanceIndex,
    /// Share of the map that knows less at which the other is known, too, 0 to 1.
    pub overlap: f64,
}

impl RatedPose {
    /// Counts the cells of two maps at a relative pose. `known` is the [`known_area`] of the map that knows less.
    pub fn new(a: &Grid<'_>, b: &Grid<'_>, transform_a_b: Pose2, covariance: Matrix3<f64>, known: f64) -> Self {
        let index = AcceptanceIndex::new(a, b, &transform_a_b);
        let area = index.known_in_both() as f64 * b.geometry.resolution.powi(2);
        let overlap = if known > 0.0 { (area / known).min(1.0) } else { 0.0 };
        Self { transform_a_b, covariance, index, overlap }
    }

    /// Whether another pose is the same: a point of map b is moved by less than `metres`, and the map is turned by
    /// less than `radians`.
    pub fn is_near(&self, other: &Self, point: &Point2, metres: f64, radians: f64) -> bool {
        let (here, there) = (self.transform_a_b, other.transform_a_b);
        let turn = turn_difference(here.rotation.angle(), there.rotation.angle(), TAU);
        (here * point - there * point).norm() < metres && turn.abs() < radians
    }
}
