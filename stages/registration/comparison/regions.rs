//! How well two maps agree region by region, each of which may slide a little.
//!
//! The map of a SLAM is right in every room and bent as a whole, by decimetres over a building. Where walls of one place
//! are compared, what counts is whether they lie on each other in each room; that a whole room has slid by a few
//! centimetres counts little.

use super::MapView;
use crate::shared::geometry::{Point2, Pose2, is_free, is_known};
use crate::shared::walls::{CORRELATION_LENGTH, DEVIATION, LEAST_NORMAL_AGREEMENT, WallMap, before_wall, stride};
use nalgebra::{Matrix2, Vector2};
use std::collections::BTreeMap;

/// Points by which a region is registered at the most.
const POINTS: usize = 120;
/// Rounds of the registration of a region, and how far partners lie apart at the most in each, metres.
const ROUNDS: [f64; 4] = [0.4, 0.3, 0.2, 0.2];
/// So far beyond what counts as its place a wall is found that is drawn roughly, or twice, or where a map is bent, metres.
const BESIDE: f64 = 0.4;

/// What two maps say of each other in one region.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Region {
    /// Length of wall of one map that lies on wall of the other that runs alike and is seen from the same side, metres; the
    /// mean of both ways.
    pub(super) inlier_length: f64,
    /// Length of wall of one map where the other knows free space, metres; the mean of both ways.
    pub(super) conflict_length: f64,
    /// How far the walls of map b were slid to lie on those of map a, metres.
    pub(super) shift: f64,
}

/// What was found at the walls of two maps.
#[derive(Clone, Debug, Default)]
pub(super) struct Found {
    /// Region by region.
    pub(super) regions: Vec<Region>,
    /// The points of the walls of both maps of which the other knows something.
    pub(super) walls: Vec<ComparedWall>,
}

/// A point of a wall of one map, and what the other knows there.
#[derive(Clone, Copy, Debug)]
pub(super) struct ComparedWall {
    /// Whether it is of map b.
    pub(super) of_b: bool,
    /// Where it lies, frame a.
    pub(super) point: Point2,
    /// Across the wall, frame a; zero where the wall has no direction.
    pub(super) normal: Vector2<f64>,
    /// What the other map knows there.
    pub(super) finding: Finding,
}

/// What one map knows of a point of a wall of the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Finding {
    /// A wall that runs alike and is seen from the same side.
    Inlier,
    /// A wall that runs alike, seen from the other side only; or another direction.
    Neither,
    /// Free space, and beside it a wall that runs alike, as a bend or a rough drawing leaves it.
    Beside,
    /// Free space, and no wall that runs alike beside it.
    Conflict,
}

/// How regions are compared.
#[derive(Clone, Copy, Debug)]
pub(super) struct RegionComparison {
    /// The side of a region, metres.
    pub(super) side: f64,
    /// Standard deviation of how far a region slides along x and along y, metres.
    pub(super) region_deviation: f64,
    /// Walls within this distance agree, metres.
    pub(super) tolerance: f64,
}

impl RegionComparison {
    /// Compares two maps at an alignment, in squares of frame a.
    pub(super) fn compare(&self, a: &MapView<'_>, b: &MapView<'_>, transform_a_b: &Pose2) -> Found {
        let mut parts: BTreeMap<(i32, i32), Part> = BTreeMap::new();
        let key = |point: &Point2| ((point.x / self.side).floor() as i32, (point.y / self.side).floor() as i32);
        for (index, point) in b.walls.walls.points().iter().enumerate() {
            let point = transform_a_b * point;
            if self.tells_of(a, &point) {
                parts.entry(key(&point)).or_default().of_b.push(index);
            }
        }
        let transform_b_a = transform_a_b.inverse();
        for (index, point) in a.walls.walls.points().iter().enumerate() {
            if self.tells_of(b, &(transform_b_a * point)) {
                parts.entry(key(point)).or_default().of_a.push(index);
            }
        }
        let mut found = Found::default();
        parts.values().for_each(|part| self.add_region(part, a, b, transform_a_b, &mut found));
        found
    }

    /// Whether a map says anything of a wall at a place: what lies behind a wall is unknown, and a wall that is as thin as a cell may
    /// come to lie there by a part of one.
    fn tells_of(&self, map: &MapView<'_>, place: &Point2) -> bool {
        is_known(map.value_at(place)) || map.walls.walls.nearest(place, self.tolerance).is_some()
    }

    fn add_region(&self, part: &Part, a: &MapView<'_>, b: &MapView<'_>, transform_a_b: &Pose2, found: &mut Found) {
        let slide = self.register(&part.of_b, a.walls, b.walls, transform_a_b);
        let slid = Pose2::from_parts((transform_a_b.translation.vector + slide).into(), transform_a_b.rotation);
        let mut region = Region { shift: slide.norm(), ..Region::default() };
        let mut tell = |wall: ComparedWall| found.walls.push(wall);
        self.add(&part.of_b, b, a, &slid, &mut region, |own, normal, finding| {
            tell(ComparedWall { of_b: true, point: slid * own, normal: slid.rotation * normal, finding });
        });
        self.add(&part.of_a, a, b, &slid.inverse(), &mut region, |own, normal, finding| {
            tell(ComparedWall { of_b: false, point: own, normal, finding });
        });
        found.regions.push(region);
    }

    /// How far some walls of map b slide to lie on those of map a: registration from point to line, where nothing but the
    /// translation is open, and no slide is likelier than a small one.
    fn register(&self, points: &[usize], a: &WallMap, b: &WallMap, transform_a_b: &Pose2) -> Vector2<f64> {
        let stride = stride(points.len(), POINTS);
        let share = (stride as f64 * b.spacing / CORRELATION_LENGTH).min(1.0) / DEVIATION.powi(2);
        let prior = Matrix2::identity() / self.region_deviation.powi(2);
        let mut slide = Vector2::zeros();
        for distance in ROUNDS {
            let (mut information, mut vector) = (prior, Vector2::zeros());
            for &index in points.iter().step_by(stride) {
                let point = transform_a_b * b.walls.points()[index];
                let Some(partner) = a.walls.nearest(&(point + slide), distance) else { continue };
                let normal = a.normals[partner.index];
                let turned = transform_a_b.rotation * b.normals[index];
                if normal.dot(&turned).abs() < LEAST_NORMAL_AGREEMENT {
                    continue;
                }
                let residual = normal.dot(&(a.walls.points()[partner.index] - point));
                information += share * normal * normal.transpose();
                vector += share * residual * normal;
            }
            slide = information.try_inverse().map_or(slide, |covariance| covariance * vector);
        }
        slide
    }

    /// Adds what `map` says of some walls of `other`.
    fn add(
        &self,
        points: &[usize],
        other: &MapView<'_>,
        map: &MapView<'_>,
        transform: &Pose2,
        region: &mut Region,
        mut tell: impl FnMut(Point2, Vector2<f64>, Finding),
    ) {
        // Both ways are added up.
        let length = 0.5 * other.walls.spacing;
        let ahead = before_wall(map.grid.geometry.resolution.max(other.grid.geometry.resolution));
        for &index in points {
            let own = other.walls.walls.points()[index];
            let point = transform * own;
            let normal = other.walls.normals[index];
            let turned = transform.rotation * normal;
            // Ends and corners of walls have no direction, and may be those of any.
            let runs_alike = |wall: usize| turned.dot(&map.walls.normals[wall]).abs() >= LEAST_NORMAL_AGREEMENT;
            if let Some(partner) = map.walls.walls.nearest(&point, self.tolerance) {
                if !runs_alike(partner.index) {
                    tell(own, normal, Finding::Neither);
                    continue;
                }
                let is_seen_from = |side: f64| {
                    is_free(other.value_at(&(own + normal * (side * ahead))))
                        && is_free(map.value_at(&(point + turned * (side * ahead))))
                };
                if is_seen_from(1.0) || is_seen_from(-1.0) {
                    region.inlier_length += length;
                    tell(own, normal, Finding::Inlier);
                } else {
                    tell(own, normal, Finding::Neither);
                }
            } else if is_free(map.value_at(&point)) {
                region.conflict_length += length;
                let beside = map.walls.walls.nearest(&point, self.tolerance + BESIDE);
                let is_beside = beside.is_some_and(|partner| runs_alike(partner.index));
                tell(own, normal, if is_beside { Finding::Beside } else { Finding::Conflict });
            }
        }
    }
}

/// Walls in one region, by their numbers.
#[derive(Default)]
struct Part {
    of_a: Vec<usize>,
    of_b: Vec<usize>,
}
