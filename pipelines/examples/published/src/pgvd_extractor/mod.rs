//! The probabilistic generalized Voronoi diagram of a map: the skeleton of its free space as a graph, with the
//! probability of every part.
//!
//! From Saeedi, Paull, Trentini, Seto and Li, "Group mapping: a topological approach to map merging for multiple
//! robots" (IEEE Robotics and Automation Magazine, June 2014): a point belongs to the diagram if it is free and at
//! equal distance from two obstacles, so its probability is that of these cells, and edges in well-known areas count
//! more when maps are matched.
//!
//! The skeleton itself is that of [`skeleton`](gridweave_stages::topology::skeleton). What the paper leaves open, and
//! how it is decided here:
//! - **The cells that define a point** are its own cell, and two of the cells that are not free at about the least
//!   distance: the nearest one, and the one on the other side, that is, in the direction farthest from that to the
//!   first.
//! - **Its probability** is the product of three: that its own cell is free, and that each of the two others is
//!   occupied, as if cells were independent. An unknown cell is occupied with a probability of one half. So a path
//!   between two walls is near 1, one along the edge of the known area is below one half, and one between two such
//!   edges below a quarter.
//! - **A path's probability** is the mean over its points, which is the expected share of it. The product would make
//!   every long path improbable.
//! - **A node's probability** is that of its point.
//!
//! - [`point_probability`]: probability that a point is on the skeleton.
//! - [`topological_map`]: all of it.

mod parameters;
mod probability;
mod stage;
#[cfg(test)]
mod tests;

pub use parameters::PgvdExtractorParameters;
pub use probability::point_probability;
pub use stage::topological_map;

use gridweave_runtime::stage::StageKind;
use stage::PgvdExtractor;

/// The stage kind `pgvd_extractor`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "pgvd_extractor",
        "Makes the probabilistic generalized Voronoi diagram of every map: the lines of free space that are as far from obstacles \
         on both sides, as a graph whose nodes and paths say how probable they are given the cells that define them (Saeedi et \
         al., \"Group mapping\").",
        |parameters: PgvdExtractorParameters, _| Ok(PgvdExtractor::new(parameters)),
    )
    .input("map", "The robots' maps.", PgvdExtractor::receive_map)
    .build()
}
