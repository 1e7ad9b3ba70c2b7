//! The straight walls of an occupancy grid.
//!
//! RANSAC over the occupied cells, breakdown at gaps and merging of parts, after Tsardoulias et al., section 4.1.1. The
//! paper's rule, by which a line must hold 15 % of all points, finds nothing in maps with many walls; the default
//! draws the two points of a line near each other, and takes an unbroken stretch that holds enough points and is long
//! enough. Each wall is then fitted by its faces, so that it may be solid, or seen from both sides, or have furniture at
//! it, and still tells its direction. `sampling = "uniform"`, `scoring = "percentage"` and `fit = "ends"` give the paper's.
//!
//! What is occupied all through, deeper than a wall is thick, shows no wall but its surface.
//!
//! Not for curved walls, which become chains of short segments.

mod extract;
mod faces;
mod line;
mod merge;
mod parameters;
mod point_index;
mod ransac;
mod reliability;
mod scale;
mod stage;
mod surface;
mod wall;

pub use extract::extract_segments;
pub use parameters::{Fit, LineExtractorParameters, Sampling, Scoring};
pub use stage::kind;
