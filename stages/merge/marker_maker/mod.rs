//! Turns features of maps and hypotheses into shapes for RViz and Foxglove: walls, directions, tags with ellipses of
//! two standard deviations, topological maps, and the relative poses of hypotheses.
//!
//! Shapes are in the frame of the feature, which is its robot's map: viewers place them by `/tf_static`. Deformations
//! are left out, as transforms are rigid.

mod hypothesis_markers;
mod shapes;
mod stage;
#[cfg(test)]
mod tests;

pub use shapes::{direction, hypotheses, segments, tags, ways};
pub use stage::kind;
