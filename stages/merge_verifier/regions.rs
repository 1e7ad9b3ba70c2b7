//! How well two maps agree region by region, each of which may slide a little.
//!
//! The map of a SLAM is right in every room and bent as a whole, by decimetres over a building. Where walls of one place
//! are compared, what counts is whether they lie on each other in each room; that a whole room has slid by a few
//! centimetres counts little.

use super::MapView;
use super::agreement::value_at;
use crate::geometry::{Point2, Pose2, is_free, is_known};
use crate::walls::{WallMap, stride};
use nalgebra::{Matrix2, Vector2};
use std::collections::BTreeMap;

/// Walls that cross by more than this are not the same wall: the cosine of 30 degrees.
const LEAST_NORMAL_AGREEMENT: f64 = 0.866;
/// Points by which a region is registered at the most.
const POINTS: usize = 120;
/// Rounds of the registration of a region, and how far partners lie apart at the most in each, metres.
const ROUNDS: [f64; 4] = [0.4, 0.3, 0.2, 0.2];
/// The length of wall that counts as one measurement of where a region lies, metres.
const CORRELATION_LENGTH: f64 = 0.5;
/// Standard deviation of such a measurement, metres.
const DEVIATION: f64 = 0.05;

/// What two maps say of each other in one region.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Region {
    /// Length of wall of one map that lies on wall of the other that runs alike, metres; the mean of both ways.
    pub wall_on_wall: f64,
    /// The part of it that lies within half the tolerance, metres.
    pub sharp: f64,
    /// Length of wall of one map where the other knows free space, metres; the mean of both ways.
    pub wall_on_free: f64,
    /// How far walls of map b slide there to lie on those of map a, frame a, metres.
    pub slide: Vector2<f64>,
}

/// How regions are compared.
#[derive(Clone, Copy, Debug)]
pub struct RegionComparison {
    /// The side of a region, metres.
    pub side: f64,
    /// Standard deviation of how far a region slides along x and along y, metres.
    pub slide_deviation: f64,
    /// Walls within this distance agree, metres.
    pub tolerance: f64,
}

impl RegionComparison {
    /// Compares two maps at an alignment, in squares of frame a.
    pub fn regions(&self, a: &MapView<'_>, b: &MapView<'_>, transform_a_b: &Pose2) -> Vec<Region> {
        let mut parts: BTreeMap<(i32, i32), Part> = BTreeMap::new();
        let key = |point: &Point2| ((point.x / self.side).floor() as i32, (point.y / self.side).floor() as i32);
        for (index, point) in b.walls.walls.points().iter().enumerate() {
            let moved = transform_a_b * point;
            if is_known(value_at(&a.grid, &moved)) {
                parts.entry(key(&moved)).or_default().of_b.push(index);
            }
        }
        let transform_b_a = transform_a_b.inverse();
        for (index, point) in a.walls.walls.points().iter().enumerate() {
            if is_known(value_at(&b.grid, &(transform_b_a * point))) {
                parts.entry(key(point)).or_default().of_a.push(index);
            }
        }
        parts.values().map(|part| self.compare(part, a, b, transform_a_b)).collect()
    }

    fn compare(&self, part: &Part, a: &MapView<'_>, b: &MapView<'_>, transform_a_b: &Pose2) -> Region {
        let slide = self.register(&part.of_b, a.walls, b.walls, transform_a_b);
        let slid = Pose2::from_parts((transform_a_b.translation.vector + slide).into(), transform_a_b.rotation);
        let mut region = Region { slide, ..Region::default() };
        self.add(&part.of_b, b.walls, a, &slid, &mut region);
        self.add(&part.of_a, a.walls, b, &slid.inverse(), &mut region);
        region
    }

    /// How far some walls of map b slide to lie on those of map a: registration from point to line, where nothing but the
    /// translation is open, and no slide is likelier than a small one.
    fn register(&self, points: &[usize], a: &WallMap, b: &WallMap, transform_a_b: &Pose2) -> Vector2<f64> {
        let stride = stride(points.len(), POINTS);
        let share = (stride as f64 * b.spacing / CORRELATION_LENGTH).min(1.0) / DEVIATION.powi(2);
        let prior = Matrix2::identity() / self.slide_deviation.powi(2);
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

    /// Adds what `map` says of some walls of another map.
    fn add(&self, points: &[usize], other: &WallMap, map: &MapView<'_>, transform: &Pose2, region: &mut Region) {
        // Both ways are added up.
        let length = 0.5 * other.spacing;
        for &index in points {
            let point = transform * other.walls.points()[index];
            if let Some(partner) = map.walls.walls.nearest(&point, self.tolerance) {
                let (one, another) = (map.walls.normals[partner.index], transform.rotation * other.normals[index]);
                // Ends and corners of walls have no direction, and may be those of any.
                if one == Vector2::zeros()
                    || another == Vector2::zeros()
                    || one.dot(&another).abs() >= LEAST_NORMAL_AGREEMENT
                {
                    region.wall_on_wall += length;
                    let distance = (map.walls.walls.points()[partner.index] - point).norm();
                    if distance <= 0.5 * self.tolerance {
                        region.sharp += length;
                    }
                }
            } else if is_free(value_at(&map.grid, &point)) {
                region.wall_on_free += length;
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
