//! Registration of points on the walls of a local map.

use super::local_map::LocalMap;
use super::scan_points::{SPACING, ScanPoint};
use crate::shared::geometry::{MovingLookup, Pose2, quarter_turn};
use crate::shared::walls::{CORRELATION_LENGTH, DEVIATION, LEAST_NORMAL_AGREEMENT};
use nalgebra::{Matrix3, UnitComplex, Vector2, Vector3};

/// Distances within which a point is matched with a surface, metres: from the search's cells down to the noise.
const RADII: [f64; 7] = [0.3, 0.25, 0.2, LAST_RADIUS, LAST_RADIUS, LAST_RADIUS, LAST_RADIUS];
const LAST_RADIUS: f64 = 0.15;
/// Least share of the points of a scan, or of a submap, that lie on a map of which it has seen enough to be registered.
const LEAST_MATCHED: f64 = 0.5;
/// Every which point is looked up before all are, and the least share of these that has a wall within the first radius
/// of the guess: of all points it is at least that in all but 3 of 125,000 registrations of five public and simulated logs
/// with [`LEAST_MATCHED`] at the end.
const SAMPLE: usize = 4;
const LEAST_MATCHED_AT_GUESS: f64 = 0.3;
/// Steps at the last radius that are shorter end the iteration, metres and radians.
const LEAST_STEP: f64 = 1e-4;
/// Standard deviation in the weight of a match, as a share of the radius (Welsch).
const WEIGHT_WIDTH: f64 = 0.5;

/// Registration of points on a local map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match {
    /// Pose of the points' frame in the map's.
    pub pose: Pose2,
    /// Inverse of the covariance of (x, y, yaw) in the map's frame by the matches alone. Each match counts by the product of
    /// the normals of the wall and of the point, whose errors are independent: the square of one alone would grow with its
    /// noise, as if a bare wall showed where along it the points are.
    pub information: Matrix3<f64>,
    /// Share of the points that lie on the map: those with a normal on a wall of the same direction.
    pub matched: f64,
}

impl LocalMap {
    /// Registers points on the walls: the distances of the points to the lines of the surfaces are minimised together
    /// with the deviation from a prior, with weights that fall with the distance (point to line as in Censi 2008, "An
    /// ICP variant using a point-to-line metric").
    pub fn register(&self, scan: &[ScanPoint], guess: &Pose2, prior: (&Pose2, &Matrix3<f64>)) -> Match {
        let mut moving = MovingScan::new(self, scan, guess, Some(prior));
        let equations = moving.equations(RADII[0]);
        moving.run(equations)
    }

    /// Registers points by the walls alone. `None` if fewer than [`LEAST_MATCHED`] of them lie on the map. Most scans
    /// share little with the map, which a part of their points at the guess shows.
    pub(super) fn find(&self, scan: &[ScanPoint], guess: &Pose2) -> Option<Match> {
        let sample: Vec<ScanPoint> = scan.iter().step_by(SAMPLE).copied().collect();
        let mut at_guess = MovingScan::new(self, &sample, guess, None);
        let equations = at_guess.equations(RADII[0]);
        if at_guess.share(&equations) < LEAST_MATCHED_AT_GUESS {
            return None;
        }
        let mut moving = MovingScan::new(self, scan, guess, None);
        let equations = moving.equations(RADII[0]);
        let found = moving.run(equations);
        (found.matched >= LEAST_MATCHED).then_some(found)
    }
}

/// A scan on its way to its place on a map.
struct MovingScan<'a> {
    map: &'a LocalMap,
    scan: &'a [ScanPoint],
    pose: Pose2,
    prior: Option<(&'a Pose2, &'a Matrix3<f64>)>,
    /// For each point the lookup of its nearest wall or spot.
    lookups: Vec<MovingLookup>,
}

/// Normal equations of a small move (x, y, yaw about the points' frame).
#[derive(Default)]
struct MoveEquations {
    matrix: Matrix3<f64>,
    vector: Vector3<f64>,
    /// The matrix with the walls' normals on one side and the points' own on the other.
    information: Matrix3<f64>,
    /// Number of the points that lie on the map.
    matched: u32,
}

impl<'a> MovingScan<'a> {
    fn new(
        map: &'a LocalMap,
        scan: &'a [ScanPoint],
        guess: &Pose2,
        prior: Option<(&'a Pose2, &'a Matrix3<f64>)>,
    ) -> Self {
        Self { map, scan, pose: *guess, prior, lookups: vec![MovingLookup::default(); scan.len()] }
    }

    /// Moves the points to where the equations and those after them say, the first of which are within `RADII[0]`.
    fn run(mut self, mut equations: MoveEquations) -> Match {
        for radii in RADII.windows(2) {
            let Some(step) = self.step(&equations) else { break };
            self.pose.translation.vector += step.xy();
            self.pose.rotation *= UnitComplex::new(step.z);
            equations = self.equations(radii[1]);
            if radii[0] == LAST_RADIUS && step.norm() < LEAST_STEP {
                break;
            }
        }
        let (information, matched) = (positive_part(&equations.information), self.share(&equations));
        Match { pose: self.pose, information, matched }
    }

    /// The move that fits the equations and the prior best.
    fn step(&self, equations: &MoveEquations) -> Option<Vector3<f64>> {
        let MoveEquations { mut matrix, mut vector, .. } = *equations;
        if let Some((mean, information)) = self.prior {
            let off = Vector3::new(
                mean.translation.x - self.pose.translation.x,
                mean.translation.y - self.pose.translation.y,
                (mean.rotation / self.pose.rotation).angle(),
            );
            matrix += information;
            vector += information * off;
        }
        // Nothing else fixes what no wall does.
        matrix += Matrix3::identity();
        Some(matrix.cholesky()?.solve(&vector))
    }

    /// The equations by the points that have a wall or a spot within `radius`.
    fn equations(&mut self, radius: f64) -> MoveEquations {
        let (map, pose) = (self.map, &self.pose);
        let mut equations = MoveEquations::default();
        // Neighbouring points of a wall are one measurement.
        let of_point = SPACING / CORRELATION_LENGTH / (DEVIATION * DEVIATION);
        let width = WEIGHT_WIDTH * radius;
        let weight = |squared_distance: f64| of_point * (-0.5 * squared_distance / (width * width)).exp();
        let mut before = usize::MAX;
        for (point, lookup) in self.scan.iter().zip(&mut self.lookups) {
            let arm = pose.rotation * point.place.coords;
            let place = pose.translation.vector + arm;
            let row = |by: &Vector2<f64>| Vector3::new(by.x, by.y, by.dot(&quarter_turn(&arm)));
            let index = if point.normal.is_some() { &map.index } else { &map.spots };
            let found = lookup.nearest(index, &place.into(), radius, before).map(|found| found.index);
            before = found.unwrap_or(before);
            let normal = point.normal.map(|normal| pose.rotation * normal);
            let surface = match (normal, found) {
                (None, Some(spot)) => {
                    let off = map.spots.points()[spot].coords - place;
                    let weight = weight(off.norm_squared());
                    for axis in [Vector2::x(), Vector2::y()] {
                        equations.add(weight, row(&axis), off.dot(&axis), Some(row(&axis)));
                    }
                    equations.matched += 1;
                    continue;
                }
                (None, None) => map.index.nearest(&place.into(), radius).map(|found| found.index),
                (Some(_), surface) => surface,
            };
            let Some(surface) = surface.map(|surface| &map.surfaces[surface]) else { continue };
            if normal.is_none_or(|normal| surface.normal.dot(&normal) >= LEAST_NORMAL_AGREEMENT) {
                let off = surface.normal.dot(&(surface.place.coords - place));
                equations.add(weight(off * off), row(&surface.normal), off, normal.map(|normal| row(&normal)));
                equations.matched += 1;
            }
        }
        equations
    }

    /// Share of the points that lie on the map.
    fn share(&self, equations: &MoveEquations) -> f64 {
        f64::from(equations.matched) / self.scan.len().max(1) as f64
    }
}

impl MoveEquations {
    /// Adds that the points lie `off` from the map in a direction. `row` are the derivatives of the distance in the direction that
    /// the map shows, and `seen` those in the one that the point itself shows, if it does.
    fn add(&mut self, weight: f64, row: Vector3<f64>, off: f64, seen: Option<Vector3<f64>>) {
        let weighted = weight * row;
        self.matrix += weighted * row.transpose();
        self.vector += weighted * off;
        if let Some(seen) = seen {
            self.information += weighted * seen.transpose();
        }
    }
}

/// The symmetric matrix without negative eigenvalues that is nearest to one (Higham 1988, "Computing a nearest symmetric
/// positive semidefinite matrix").
fn positive_part(matrix: &Matrix3<f64>) -> Matrix3<f64> {
    let mut eigen = (0.5 * (matrix + matrix.transpose())).symmetric_eigen();
    eigen.eigenvalues = eigen.eigenvalues.map(|value| value.max(0.0));
    eigen.recompose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::{Point2, pose};

    /// Walls with their normals, as seen from the inside of a room of 6 by 4 metres.
    fn walls(sides: &[[f64; 4]]) -> Vec<ScanPoint> {
        let mut points = Vec::new();
        for &[x, y, normal_x, normal_y] in sides {
            let along = Vector2::new(-normal_y, normal_x);
            for step in -20..=20 {
                let place = Point2::new(x, y) + along * (SPACING * f64::from(step));
                points.push(ScanPoint { place, normal: Some(Vector2::new(normal_x, normal_y)) });
            }
        }
        points
    }

    fn seen_from(pose: &Pose2, points: &[ScanPoint]) -> Vec<ScanPoint> {
        let into = pose.inverse();
        points
            .iter()
            .map(|point| ScanPoint { place: into * point.place, normal: point.normal.map(|normal| into * normal) })
            .collect()
    }

    #[test]
    fn points_are_registered_to_a_millimetre_and_only_where_walls_say_so() {
        let room = walls(&[[3.0, 0.0, -1.0, 0.0], [-3.0, 0.0, 1.0, 0.0], [0.0, 2.0, 0.0, -1.0]]);
        let map = LocalMap::new([(Pose2::identity(), &room[..])].into_iter());
        let truth = pose(0.11, -0.07, 0.03);
        let found = map.find(&seen_from(&truth, &room), &Pose2::identity()).unwrap();
        let off = truth.inverse() * found.pose;
        assert!(off.translation.vector.norm() < 1e-3 && off.rotation.angle().abs() < 1e-3, "{off}");
        assert!(found.matched > 0.95);

        // A corridor: nothing tells where along it.
        let corridor = walls(&[[0.0, 1.0, 0.0, -1.0], [0.0, -1.0, 0.0, 1.0]]);
        let map = LocalMap::new([(Pose2::identity(), &corridor[..])].into_iter());
        let found = map.find(&corridor, &pose(0.0, 0.05, 0.0)).unwrap();
        let weakest = found.information.symmetric_eigenvalues().min();
        assert!(weakest < 1e-6 * found.information.trace(), "{}", found.information);
        assert!(found.pose.translation.vector.norm() < 1e-3);
    }

    #[test]
    fn noise_does_not_show_where_along_bare_walls_a_scan_was_made() {
        let corridor = walls(&[[0.0, 1.0, 0.0, -1.0], [0.0, -1.0, 0.0, 1.0]]);
        // Normals are off by up to 0.4 radians, and each tenth point has none.
        let noisy = |seed: usize| -> Vec<ScanPoint> {
            let noise = |number: usize| ((number * 7919 + seed * 104_729) % 1000) as f64 / 1000.0 - 0.5;
            let noisy = |(number, point): (usize, &ScanPoint)| {
                let turn = UnitComplex::new(0.8 * noise(number));
                let normal = point.normal.filter(|_| number % 10 != seed % 10).map(|normal| turn * normal);
                ScanPoint { place: point.place + Vector2::y() * (0.06 * noise(number + 500)), normal }
            };
            corridor.iter().enumerate().map(noisy).collect()
        };
        let scans: Vec<Vec<ScanPoint>> = (0..10).map(noisy).collect();
        let map = LocalMap::new(scans.iter().map(|scan| (Pose2::identity(), &scan[..])));
        let found = map.find(&noisy(11), &Pose2::identity()).unwrap();
        let position = found.information.fixed_view::<2, 2>(0, 0).symmetric_eigenvalues();
        let [along, across] = [position.min(), position.max()].map(|information| information.sqrt().recip());
        assert!(along > 4.0 * across && along > 0.08, "{along} {across}");
        assert!(found.matched > 0.9, "points without a normal lie on the wall as well: {}", found.matched);
    }

    #[test]
    fn corners_that_all_scans_see_at_one_place_show_where_along_a_corridor_a_scan_was_made() {
        let bare = walls(&[[0.0, 1.0, 0.0, -1.0], [0.0, -1.0, 0.0, 1.0]]);
        let seen = |scan: u32| -> Vec<ScanPoint> {
            let noise = 0.01 * (f64::from(scan) - 3.0) / 3.0;
            let corner = |x: f64, y: f64| ScanPoint { place: Point2::new(x + noise, y - noise), normal: None };
            bare.iter().copied().chain([corner(0.3, 1.0), corner(-0.5, -1.0)]).collect()
        };
        let scans: Vec<Vec<ScanPoint>> = (0..6).map(seen).collect();
        let map = LocalMap::new(scans.iter().map(|scan| (Pose2::identity(), &scan[..])));
        let truth = pose(0.05, 0.02, 0.0);
        let found = map.find(&seen_from(&truth, &seen(3)), &Pose2::identity()).unwrap();
        let off = truth.inverse() * found.pose;
        assert!(off.translation.vector.norm() < 0.02, "{off}");
        let weakest = found.information.fixed_view::<2, 2>(0, 0).symmetric_eigenvalues().min();
        assert!(weakest > 0.1_f64.powi(-2) * 0.5, "{weakest}");
    }

    #[test]
    fn the_other_face_of_a_wall_is_not_matched() {
        let map = LocalMap::new([(Pose2::identity(), &walls(&[[1.0, 0.0, -1.0, 0.0]])[..])].into_iter());
        assert_eq!(map.find(&walls(&[[1.05, 0.0, 1.0, 0.0]]), &Pose2::identity()), None);
    }
}
