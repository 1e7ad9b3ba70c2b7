//! What a robot measures of a tag.

use nalgebra::Vector2;

/// A measurement of a tag.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Measured {
    /// Distance, metres.
    Range(f64),
    /// Position relative to the robot: metres ahead, and to the left.
    Place(Vector2<f64>),
    /// Bearing, radians from straight ahead of the robot, with its standard deviation, relative to the sensor: metres
    /// ahead of the robot, and to its left.
    Bearing { sensor: Vector2<f64>, bearing: f64, stddev: f64 },
}
