//! The straight walls of an occupancy grid.
//!
//! RANSAC over the occupied cells, breakdown at gaps and merging of parts, after Tsardoulias et al., section 4.1.1.
//! The paper's rule, by which a line must contain 15 % of all points, finds nothing in maps with many walls; the
//! default draws the two points of a line near each other, and takes an unbroken stretch with enough points and
//! enough length. Each wall is then fitted by its faces, so its direction is right if it is solid, seen from both
//! sides, or has furniture at it. `sampling = "uniform"`, `scoring = "percentage"` and `fit = "ends"` are the
//! paper's.
//!
//! A solid that is deeper than a wall is thick is reduced to its surface.
//!
//! Not for curved walls, which become chains of short segments.

mod extract;
mod faces;
mod line;
mod merge;
mod parameters;
mod plane_points;
mod ransac;
mod reliability;
mod scale;
mod stage;
mod surface;
mod wall;

pub use extract::extract_segments;
pub use parameters::{Fit, LineExtractorParameters, Sampling, Scoring};
pub use stage::kind;
