//! The walls of a map as points with normals: what registers maps on each other and what compares them look at these.

mod wall_line;
mod wall_map;

pub use wall_map::{KnownSample, WallMap};

use crate::shared::robot_maps::RobotMap;
use std::cell::OnceCell;

/// The radius in which a wall's direction is measured, metres: what stages take that are not told another.
pub const NORMAL_RADIUS: f64 = 0.2;

/// Walls that cross by more than this are not the same wall: the cosine of 30 degrees.
pub const LEAST_NORMAL_AGREEMENT: f64 = 0.866;

/// The length of wall that counts as one measurement of where it lies, metres: neighbouring points of a wall say the same.
pub const CORRELATION_LENGTH: f64 = 0.5;

/// Standard deviation of such a measurement, metres.
pub const DEVIATION: f64 = 0.05;

/// So far before a wall, metres, space is known to be free where the wall was seen from there, on a map of the given metres
/// a cell. Two maps show the same face of a wall if both know free space before it: where the ends of two buildings are
/// laid back to back, wall lies on wall, too.
pub fn before_wall(resolution: f64) -> f64 {
    f64::max(0.2, 3.0 * resolution)
}

/// Walls that are made when they are first asked for.
pub type WallsOnDemand = OnceCell<WallMap>;

impl RobotMap<WallsOnDemand> {
    /// The walls of the map. Their directions are taken within `normal_radius` metres, which must be the same at every
    /// call.
    pub fn walls(&self, normal_radius: f64) -> &WallMap {
        self.own.get_or_init(|| WallMap::new(&self.grid(), normal_radius))
    }
}

/// Every how many-th of `count` points makes a sample of at most so many.
pub fn stride(count: usize, most_points: usize) -> usize {
    count.div_ceil(most_points.max(1)).max(1)
}
