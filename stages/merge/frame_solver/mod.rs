//! Frame solver: estimates one pose of each robot's map in the reference robot's map from alignments of pairs.
//!
//! The accepted alignments form a pose graph. Its cycles are checked: alignments that contradict the others are left
//! out, and where the evidence does not decide which of several is wrong, the robots that depend on them are not
//! merged, as a wrong merge is worse than none. All the others are solved together by weighted least squares. Robots
//! that are connected with each other, but not with the reference, are solved in the same way in a frame of their
//! own.
//!
//! Maps grow, and so alignments are refined again and again. Frames that were sent stay until the alignments fit
//! others better by a margin, and the reference stays once robots are placed in its frame.
//!
//! - [`solve`]: names in, poses and reasons out; the whole of the algorithm.
//! - [`solution`]: the data of a problem and of its solution.
//! - [`graph`]: the pose graph, its spanning trees and cycles.
//! - [`consistency`]: which alignments contradict each other; by trial where there are few contradictions (`search`),
//!   else by moves of robots (`consensus`), which are minimum cuts (`cut`).
//! - [`optimize`]: least squares on SE(2).
//! - [`uncertain`]: transforms with a covariance.

mod consensus;
pub mod consistency;
mod cut;
pub mod graph;
mod known_maps;
mod messages;
pub mod optimize;
mod parameters;
mod reasons;
mod search;
#[cfg(test)]
mod simulated_graph;
pub mod solution;
pub mod solve;
mod stage;
#[cfg(test)]
mod tests;
mod tree;
pub mod uncertain;

pub use parameters::FrameSolverParameters;
pub use stage::kind;
pub use uncertain::UncertainPose;
