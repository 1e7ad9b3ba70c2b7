//! Agreement of two maps region by region, where each region may be shifted a little.
//!
//! The map of a SLAM is right in every room and deformed as a whole, by decimetres over a building. What counts is
//! whether the walls agree within each room; a shift of the whole room by a few centimetres counts little.

use super::MapView;
use crate::shared::geometry::{Point2, Pose2, is_free, is_known};
use crate::shared::walls::{CORRELATION_LENGTH, DEVIATION, LEAST_NORMAL_AGREEMENT, WallMap, before_wall, stride};
use nalgebra::{Matrix2, Vector2};
use std::collections::BTreeMap;

/// At most this many points are used to register a region.
const POINTS: usize = 120;
/// Iterations of the registration of a region: the largest distance of partners in each, metres.
const ROUNDS: [f64; 4] = [0.4, 0.3, 0.2, 0.2];
/// Distance beyond the tolerance at which a wall may still be the same one, drawn roughly or twice, or deformed,
/// metres.
const BESIDE: f64 = 0.4;

/// Agreement of two maps in one region.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Region {
    /// Inlier length: wall of one map on a parallel wall of the other that is seen from the same side, metres; the
    /// mean of both directions.
    pub(super) inlier_length: f64,
    /// Conflict length: wall of one map on free space of the other, metres; the mean of both directions.
    pub(super) conflict_length: f64,
    /// Shift of the walls of map b to align with those of map a, metres.
    pub(super) shift: f64,
}

/// Result of comparing the walls of two maps.
#[derive(Clone, Debug, Default)]
pub(super) struct Found {
    /// One for each region.
    pub(super) regions: Vec<Region>,
    /// Points of the walls of both maps at which the other map is known.
    pub(super) walls: Vec<ComparedWall>,
}

/// A point of a wall of one map, and what the other map holds there.
#[derive(Clone, Copy, Debug)]
pub(super) struct ComparedWall {
    /// Whether it is a wall of map b.
    pub(super) of_b: bool,
    /// Index of the point among the walls of its map.
    pub(super) index: usize,
    /// Position, frame a.
    pub(super) point: Point2,
    /// Unit normal of the wall, frame a; zero where the wall has no direction.
    pub(super) normal: Vector2<f64>,
    /// What the other map holds there.
    pub(super) finding: Finding,
}

/// What one map holds at a point of a wall of the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Finding {
    /// A parallel wall that is seen from the same side.
    Inlier,
    /// A parallel wall seen from the other side only, or a wall of another direction.
    Neither,
    /// Free space beside a parallel wall, as a deformation or a rough drawing leaves it.
    Beside,
    /// Free space, with no parallel wall beside it.
    Conflict,
}

/// How regions are compared.
#[derive(Clone, Copy, Debug)]
pub(super) struct RegionComparison {
    /// Side of a region, metres.
    pub(super) side: f64,
    /// Standard deviation of the shift of a region along x and along y, metres.
    pub(super) region_deviation: f64,
    /// Walls within this distance agree, metres.
    pub(super) tolerance: f64,
}

impl RegionComparison {
    /// Compares two maps at a relative pose, in square regions of frame a.
    pub(super) fn compare(&self, a: &MapView<'_>, b: &MapView<'_>, transform_a_b: &Pose2) -> Found {
        let mut parts: BTreeMap<(i32, i32), Part> = BTreeMap::new();
        let key = |point: &Point2| ((point.x / self.side).floor() as i32, (point.y / self.side).floor() as i32);
        for (index, point) in b.walls.walls.points().iter().enumerate() {
            let point = transform_a_b * point;
            if self.observes(a, &point) {
                parts.entry(key(&point)).or_default().of_b.push(index);
            }
        }
        let transform_b_a = transform_a_b.inverse();
        for (index, point) in a.walls.walls.points().iter().enumerate() {
            if self.observes(b, &(transform_b_a * point)) {
                parts.entry(key(point)).or_default().of_a.push(index);
            }
        }
        let mut found = Found::default();
        parts.values().for_each(|part| self.add_region(part, a, b, transform_a_b, &mut found));
        found
    }

    /// Whether a map knows something about a wall at a point. Space behind a wall is unknown, and a wall as thin as
    /// one cell may be off by a part of one.
    fn observes(&self, map: &MapView<'_>, place: &Point2) -> bool {
        is_known(map.value_at(place)) || map.walls.walls.nearest(place, self.tolerance).is_some()
    }

    fn add_region(&self, part: &Part, a: &MapView<'_>, b: &MapView<'_>, transform_a_b: &Pose2, found: &mut Found) {
        let shift = self.register(&part.of_b, a.walls, b.walls, transform_a_b);
        let shifted = Pose2::from_parts((transform_a_b.translation.vector + shift).into(), transform_a_b.rotation);
        let mut region = Region { shift: shift.norm(), ..Region::default() };
        let mut record = |wall: ComparedWall| found.walls.push(wall);
        self.add(&part.of_b, b, a, &shifted, &mut region, |index, finding| {
            let (point, normal) = (b.walls.walls.points()[index], b.walls.normals[index]);
            record(ComparedWall {
                of_b: true,
                index,
                point: shifted * point,
                normal: shifted.rotation * normal,
                finding,
            });
        });
        self.add(&part.of_a, a, b, &shifted.inverse(), &mut region, |index, finding| {
            let (point, normal) = (a.walls.walls.points()[index], a.walls.normals[index]);
            record(ComparedWall { of_b: false, index, point, normal, finding });
        });
        found.regions.push(region);
    }

    /// Translation that aligns some walls of map b with those of map a: point-to-line registration with a Gaussian
    /// prior on the translation, which is the only unknown.
    fn register(&self, points: &[usize], a: &WallMap, b: &WallMap, transform_a_b: &Pose2) -> Vector2<f64> {
        let stride = stride(points.len(), POINTS);
        let share = (stride as f64 * b.spacing / CORRELATION_LENGTH).min(1.0) / DEVIATION.powi(2);
        let prior = Matrix2::identity() / self.region_deviation.powi(2);
        let mut shift = Vector2::zeros();
        for distance in ROUNDS {
            let (mut information, mut vector) = (prior, Vector2::zeros());
            for &index in points.iter().step_by(stride) {
                let point = transform_a_b * b.walls.points()[index];
                let Some(partner) = a.walls.nearest(&(point + shift), distance) else { continue };
                let normal = a.normals[partner.index];
                let turned = transform_a_b.rotation * b.normals[index];
                if normal.dot(&turned).abs() < LEAST_NORMAL_AGREEMENT {
                    continue;
                }
                let residual = normal.dot(&(a.walls.points()[partner.index] - point));
                information += share * normal * normal.transpose();
                vector += share * residual * normal;
            }
            shift = information.try_inverse().map_or(shift, |covariance| covariance * vector);
        }
        shift
    }

    /// Compares some walls of `other` with `map`, and adds them to the region.
    fn add(
        &self,
        points: &[usize],
        other: &MapView<'_>,
        map: &MapView<'_>,
        transform: &Pose2,
        region: &mut Region,
        mut record: impl FnMut(usize, Finding),
    ) {
        // Both directions are summed, so each counts one half.
        let length = 0.5 * other.walls.spacing;
        let ahead = before_wall(map.grid.geometry.resolution.max(other.grid.geometry.resolution));
        for &index in points {
            let own = other.walls.walls.points()[index];
            let point = transform * own;
            let normal = other.walls.normals[index];
            let turned = transform.rotation * normal;
            // Ends and corners of walls have no direction, and match any.
            let runs_alike = |wall: usize| turned.dot(&map.walls.normals[wall]).abs() >= LEAST_NORMAL_AGREEMENT;
            if let Some(partner) = map.walls.walls.nearest(&point, self.tolerance) {
                if !runs_alike(partner.index) {
                    record(index, Finding::Neither);
                    continue;
                }
                let is_seen_from = |side: f64| {
                    is_free(other.value_at(&(own + normal * (side * ahead))))
                        && is_free(map.value_at(&(point + turned * (side * ahead))))
                };
                if is_seen_from(1.0) || is_seen_from(-1.0) {
                    region.inlier_length += length;
                    record(index, Finding::Inlier);
                } else {
                    record(index, Finding::Neither);
                }
            } else if is_free(map.value_at(&point)) {
                region.conflict_length += length;
                let beside = map.walls.walls.nearest(&point, self.tolerance + BESIDE);
                let is_beside = beside.is_some_and(|partner| runs_alike(partner.index));
                record(index, if is_beside { Finding::Beside } else { Finding::Conflict });
            }
        }
    }
}

/// Indices of the walls of both maps in one region.
#[derive(Default)]
struct Part {
    of_a: Vec<usize>,
    of_b: Vec<usize>,
}
