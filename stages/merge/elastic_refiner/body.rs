//! A placed map, as it is bent: its walls with the side that they are seen from, and its lattice.

use crate::shared::deformation::{Corners, Lattice};
use crate::shared::geometry::{Grid, Point2, Pose2, is_free};
use crate::shared::walls::{LEAST_NORMAL_AGREEMENT, WallMap, before_wall};
use nalgebra::Vector2;

/// A map that is placed in the world.
#[derive(Clone, Debug)]
pub struct Body<'a> {
    /// Its walls.
    pub(super) walls: &'a WallMap,
    /// For each point of the walls, from which sides it is seen: that of its normal, and the other.
    pub(super) seen: Vec<Sides>,
    /// Its nodes.
    pub(super) lattice: Lattice,
    /// For each point of the walls, the nodes around it.
    pub(super) corners: Vec<Option<Corners>>,
    /// The least and the greatest corner of the rectangle that holds the walls, map frame; none without walls.
    pub(super) bounds: Option<[Point2; 2]>,
    /// `T_world_map`.
    pub(super) transform_world_map: Pose2,
    /// Whether it stays as it is.
    pub(super) is_kept: bool,
}

/// From which sides a wall is seen: from that of its normal, and from the other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Sides {
    ahead: bool,
    behind: bool,
}

impl<'a> Body<'a> {
    /// A map with its walls that lies at `transform_world_map`, with nodes every `spacing` metres.
    pub fn new(grid: &Grid<'_>, walls: &'a WallMap, transform_world_map: Pose2, spacing: f64) -> Self {
        let before = before_wall(grid.geometry.resolution);
        let is_seen = |point: &Point2, normal: &Vector2<f64>, side: f64| {
            is_free(grid.value_at(&(point + normal * (side * before))))
        };
        let points = walls.walls.points().iter().zip(&walls.normals);
        let seen = points
            .map(|(point, normal)| Sides { ahead: is_seen(point, normal, 1.0), behind: is_seen(point, normal, -1.0) })
            .collect();
        let lattice = Lattice::over(grid, spacing);
        let corners = walls.walls.points().iter().map(|point| lattice.corners(point)).collect();
        let grow = |[low, high]: [Point2; 2], point: &Point2| [low.inf(point), high.sup(point)];
        let bounds = walls.walls.points().first().map(|first| walls.walls.points().iter().fold([*first; 2], grow));
        Self { walls, seen, lattice, corners, bounds, transform_world_map, is_kept: false }
    }

    /// The same map, which is not bent, while others are bent onto it.
    #[must_use]
    pub fn kept(self) -> Self {
        Self { is_kept: true, ..self }
    }
}

impl Sides {
    /// Whether two walls may be the same face, if the cosine between their normals, in one frame, is `cosine`.
    pub(super) fn fit(self, other: Self, cosine: f64) -> bool {
        // Ends and corners of walls have no direction, and may be those of any.
        if cosine.abs() < LEAST_NORMAL_AGREEMENT {
            return false;
        }
        match cosine > 0.0 {
            true => self.ahead && other.ahead || self.behind && other.behind,
            false => self.ahead && other.behind || self.behind && other.ahead,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Sides;

    #[test]
    fn only_faces_that_look_to_the_same_side_are_the_same() {
        let (ahead, behind) = (Sides { ahead: true, behind: false }, Sides { ahead: false, behind: true });
        let both = Sides { ahead: true, behind: true };
        assert!(ahead.fit(ahead, 1.0) && ahead.fit(behind, -1.0) && both.fit(behind, 0.95));
        assert!(!ahead.fit(behind, 1.0) && !ahead.fit(ahead, -1.0) && !both.fit(both, 0.5));
        assert!(!Sides::default().fit(both, 1.0), "a wall that nobody has looked at from before");
    }
}
