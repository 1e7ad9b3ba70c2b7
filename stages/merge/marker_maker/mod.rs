//! Turns what was found in maps into shapes that RViz and Foxglove draw: walls, directions, tags with ellipses of two standard
//! deviations, topological maps, and how hypotheses lay the maps.
//!
//! Shapes are in the frame that the finding is in, which is its robot's map: viewers place them by `/tf_static`. Bends are left
//! out, as transforms cannot bend.

mod shapes;
mod stage;
#[cfg(test)]
mod tests;

pub use shapes::{direction, hypotheses, segments, tags, ways};
pub use stage::kind;
