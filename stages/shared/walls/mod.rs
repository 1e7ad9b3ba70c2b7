//! Walls of a map as points with normals, for registration and comparison.

mod extents;
mod wall_line;
mod wall_map;

pub use extents::WallExtent;
pub use wall_map::{KnownSample, WallMap};

use crate::shared::robot_maps::RobotMap;
use std::cell::OnceCell;

/// Default radius in which a wall's direction is estimated, metres.
pub const NORMAL_RADIUS: f64 = 0.2;

/// Least cosine between the normals of corresponding walls: 30 degrees.
pub const LEAST_NORMAL_AGREEMENT: f64 = 0.866;

/// Length of wall that counts as one measurement of its position, metres: neighbouring points of a wall are
/// correlated.
pub const CORRELATION_LENGTH: f64 = 0.5;

/// Standard deviation of such a measurement, metres.
pub const DEVIATION: f64 = 0.05;

/// Distance before a wall, metres, at which space must be known as free if the wall was seen from there, on a map of
/// the given metres per cell. Two maps have the same face of a wall if both know free space before it: where the ends
/// of two buildings are back to back, their walls coincide, too.
pub fn before_wall(resolution: f64) -> f64 {
    f64::max(0.2, 3.0 * resolution)
}

/// Walls that are computed when they are first requested.
pub type WallsOnDemand = OnceCell<WallMap>;

impl RobotMap<WallsOnDemand> {
    /// The walls of the map. Their directions are estimated within `normal_radius` metres, which must be the same at
    /// every call.
    pub fn walls(&self, normal_radius: f64) -> &WallMap {
        self.own.get_or_init(|| WallMap::new(&self.grid(), normal_radius))
    }
}

/// Stride that takes a sample of at most `most_points` of `count` points.
pub fn stride(count: usize, most_points: usize) -> usize {
    count.div_ceil(most_points.max(1)).max(1)
}
