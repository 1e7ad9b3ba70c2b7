//! The skeleton of a map's free space, and the graph of places and ways that it makes.
//!
//! The generalized Voronoi diagram of a map is the set of free places that are equally far from two obstacles or more (Choset
//! and Burdick, "Sensor-based exploration: the hierarchical generalized Voronoi graph", 2000). On a grid it is a line one
//! cell wide that hangs together as the free space does:
//!
//! - [`FreeSpace`]: the free cells of a grid, small holes filled.
//! - [`DistanceMap`]: the distance from each of them to the nearest cell that is not free.
//! - [`Skeleton`]: what is left when free cells are taken away, those nearest to obstacles first, as long as the rest hangs
//!   together as before.
//! - [`SkeletonGraph`]: its ends and junctions as nodes and what lies between them as paths, without spurs.
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

/// What belongs to the skeleton of a map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkeletonParameters {
    /// Objects and unknown spots in free space that cover no more than this are taken for free, square metres: the skeleton
    /// would go round each of them.
    pub max_hole: f64,
    /// The skeleton does not pass where an obstacle or an unknown cell is nearer than this, metres: half the width of the
    /// narrowest way.
    pub min_clearance: f64,
    /// A way that leads from a junction to an end is left out if it reaches less far than this beyond what a square corner
    /// would give, metres; see [`SkeletonGraph::prune`].
    pub min_spur: f64,
}

impl Default for SkeletonParameters {
    fn default() -> Self {
        Self { max_hole: 0.25, min_clearance: 0.2, min_spur: 0.5 }
    }
}

/// The skeleton of a grid's free space as a graph, with what it was made from. None if no free cell has the clearance that is
/// asked for.
pub fn skeleton_graph(grid: &Grid<'_>, parameters: &SkeletonParameters) -> Option<(SkeletonGraph, DistanceMap)> {
    let distances = DistanceMap::of(FreeSpace::of(grid, parameters.max_hole)?);
    let skeleton = Skeleton::of(&distances, parameters.min_clearance);
    let mut graph = SkeletonGraph::of(&skeleton, &distances);
    graph.prune(parameters.min_spur);
    (!graph.nodes.is_empty()).then_some((graph, distances))
}
