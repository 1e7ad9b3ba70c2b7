//! Compares two maps at one relative pose: where their walls agree, and where they contradict each other.
//!
//! Walls of one map on walls of the other are evidence for a pose, walls on known free space are evidence against it:
//! Birk and Carpin, "Merging occupancy grid maps from multiple robots" (Proceedings of the IEEE 2006).
//!
//! - [`compare`]: the [`Agreement`] of two maps.
//! - [`Deformed`]: the same with map b deformed, where the maps contradict each other as they came.

mod agreement;
mod deformed;
mod details;
mod parameters;
mod regions;
mod straight_walls;

pub use agreement::{Agreement, MapView, compare, overlap};
pub use deformed::Deformed;
pub use details::{Details, WallLengths};
pub use parameters::ComparisonParameters;
