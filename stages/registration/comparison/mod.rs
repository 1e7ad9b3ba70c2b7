//! Compares two maps at one place: where their walls lie on each other, and where they contradict each other.
//!
//! Walls of one map on walls of the other speak for a place, and walls on known free space against it: Birk and Carpin,
//! "Merging occupancy grid maps from multiple robots" (Proceedings of the IEEE 2006).
//!
//! - [`compare`]: what two maps say of each other, in an [`Agreement`].
//! - [`Deformed`]: the same with map b deformed as maps of a SLAM are, where the maps contradict each other as they came.

mod agreement;
mod conflicts;
mod deformed;
mod parameters;
mod regions;
mod straight_walls;

pub use agreement::{Agreement, MapView, compare};
pub use deformed::Deformed;
pub use parameters::ComparisonParameters;
