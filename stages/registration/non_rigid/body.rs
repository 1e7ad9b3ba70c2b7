//! A placed map for the refinement: its walls, the sides from which they are seen, and its lattice.

use crate::shared::deformation::{Corners, Deformation, Lattice};
use crate::shared::geometry::{Grid, Point2, Pose2, is_free};
use crate::shared::walls::{LEAST_NORMAL_AGREEMENT, WallMap, before_wall};
use nalgebra::Vector2;
use std::sync::Arc;

/// A map that is placed in the world.
#[derive(Clone, Debug)]
pub struct Body<'a> {
    /// Walls of the map.
    pub(super) walls: &'a WallMap,
    /// What does not depend on the place, shared by all copies.
    pub(super) shape: Arc<Shape>,
    /// `T_world_map`.
    pub(super) transform_world_map: Pose2,
    /// Whether it is not deformed, or stays deformed as it is known.
    pub(super) is_kept: bool,
    /// Its deformation as it was estimated before.
    pub(super) known: Option<Deformation>,
}

/// The walls of a map with the nodes around them, in its own frame.
#[derive(Debug)]
pub struct Shape {
    /// Points of the walls.
    pub(super) points: Vec<WallPoint>,
    /// Nodes of the deformation.
    pub(super) lattice: Lattice,
}

/// A point of a wall, in the map frame.
#[derive(Debug)]
pub(super) struct WallPoint {
    pub(super) at: Point2,
    pub(super) normal: Vector2<f64>,
    /// Sides from which it is seen.
    pub(super) seen: Sides,
    /// The nodes around it.
    pub(super) corners: Option<Corners>,
}

/// Sides from which a wall is seen: that of its normal, and the opposite one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Sides {
    ahead: bool,
    behind: bool,
}

impl<'a> Body<'a> {
    /// A map with its walls at the pose `transform_world_map`, with nodes every `spacing` metres.
    pub fn new(grid: &Grid<'_>, walls: &'a WallMap, transform_world_map: Pose2, spacing: f64) -> Self {
        Self::of(Arc::new(Shape::new(grid, walls, spacing)), walls, transform_world_map)
    }

    /// A map of known shape, which is that of its walls, at the pose `transform_world_map`.
    pub fn of(shape: Arc<Shape>, walls: &'a WallMap, transform_world_map: Pose2) -> Self {
        Self { walls, shape, transform_world_map, is_kept: false, known: None }
    }

    /// The same map at another pose.
    #[must_use]
    pub fn at(&self, transform_world_map: Pose2) -> Self {
        Self { transform_world_map, ..self.clone() }
    }

    /// The same map without deformation, while others are aligned with it.
    #[must_use]
    pub fn kept(self) -> Self {
        Self { is_kept: true, ..self }
    }

    /// The same map, deformed as it was estimated before at this place, so that new maps are first aligned with it. A
    /// deformation on another lattice is that of another map, and is ignored.
    #[must_use]
    pub fn deformed(self, known: Deformation) -> Self {
        let known = Some(known).filter(|known| known.lattice == self.shape.lattice);
        Self { known, ..self }
    }

    /// The same map, which stays deformed as it was estimated before, while others are aligned with it.
    #[must_use]
    pub fn held(self, known: Deformation) -> Self {
        let body = self.deformed(known);
        if body.known.is_some() { body.kept() } else { body }
    }

    /// Whether it stays deformed as it was estimated before.
    pub(super) fn is_held(&self) -> bool {
        self.is_kept && self.known.is_some()
    }
}

impl Shape {
    /// The walls of a map, with nodes every `spacing` metres.
    pub fn new(grid: &Grid<'_>, walls: &WallMap, spacing: f64) -> Self {
        let before = before_wall(grid.geometry.resolution);
        let is_seen = |point: &Point2, normal: &Vector2<f64>, side: f64| {
            is_free(grid.value_at(&(point + normal * (side * before))))
        };
        let lattice = Lattice::over(grid, spacing);
        let point = |(at, normal): (&Point2, &Vector2<f64>)| WallPoint {
            at: *at,
            normal: *normal,
            seen: Sides { ahead: is_seen(at, normal, 1.0), behind: is_seen(at, normal, -1.0) },
            corners: lattice.corners(at),
        };
        let points = walls.walls.points().iter().zip(&walls.normals).map(point).collect();
        Self { points, lattice }
    }
}

impl Sides {
    /// Whether two walls may be the same face, if the cosine between their normals, in one frame, is `cosine`.
    pub(super) fn fit(self, other: Self, cosine: f64) -> bool {
        // Ends and corners of walls have no direction, and match any.
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
    fn only_faces_with_a_common_free_side_match() {
        let (ahead, behind) = (Sides { ahead: true, behind: false }, Sides { ahead: false, behind: true });
        let both = Sides { ahead: true, behind: true };
        assert!(ahead.fit(ahead, 1.0) && ahead.fit(behind, -1.0) && both.fit(behind, 0.95));
        assert!(!ahead.fit(behind, 1.0) && !ahead.fit(ahead, -1.0) && !both.fit(both, 0.5));
        assert!(!Sides::default().fit(both, 1.0), "a wall that is seen from no side");
    }
}
