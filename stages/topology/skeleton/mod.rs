//! Skeleton of a map's free space, and its graph of nodes and paths.
//!
//! The generalized Voronoi diagram of a map is the set of free points at equal distance from two obstacles or more
//! (Choset and Burdick, "Sensor-based exploration: the hierarchical generalized Voronoi graph", 2000). On a grid it
//! is a line one cell wide with the connectivity of the free space:
//!
//! - [`FreeSpace`]: the free cells of a grid, small holes filled.
//! - [`DistanceMap`]: the distance from each of them to the nearest cell that is not free.
//! - [`Skeleton`]: the cells that remain when free cells are removed, those nearest to obstacles first, as long as
//!   the connectivity is unchanged.
//! - [`SkeletonGraph`]: its ends and junctions as nodes and the lines between them as paths, without spurs.
//!
//! [`skeleton_graph`] does all of it.

mod distance;
mod free_space;
mod graph;
mod prune;
mod thinning;
mod trace;
mod window;

#[cfg(test)]
mod tests;

pub use distance::DistanceMap;
pub use free_space::FreeSpace;
pub use graph::{NodeKind, SkeletonGraph, SkeletonNode, SkeletonPath, way_length};
pub use thinning::Skeleton;
pub use window::Window;

use crate::shared::geometry::Grid;

/// Parameters of the skeleton of a map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkeletonParameters {
    /// Largest area of objects and unknown spots in free space that are treated as free, square metres: the skeleton
    /// would go round each of them.
    pub max_hole: f64,
    /// Least distance of the skeleton from obstacles and unknown cells, metres: half the width of the narrowest path.
    pub min_clearance: f64,
    /// A path from a junction to an end is a spur if it extends less than this beyond a square corner, metres; see
    /// [`SkeletonGraph::prune`].
    pub min_spur: f64,
}

impl Default for SkeletonParameters {
    fn default() -> Self {
        Self { max_hole: 0.25, min_clearance: 0.2, min_spur: 0.5 }
    }
}

/// The skeleton of a grid's free space as a graph, with its distances. None if no free cell has the required
/// clearance.
pub fn skeleton_graph(grid: &Grid<'_>, parameters: &SkeletonParameters) -> Option<(SkeletonGraph, DistanceMap)> {
    let distances = DistanceMap::of(FreeSpace::of(grid, parameters.max_hole)?);
    let skeleton = Skeleton::of(&distances, parameters.min_clearance);
    let mut graph = SkeletonGraph::of(&skeleton, &distances);
    graph.prune(parameters.min_spur);
    (!graph.nodes.is_empty()).then_some((graph, distances))
}
