//! Loop closures: submaps that were seen before.

use super::correlative_search::{Excluded, MARGIN, PosePrior, search};
use super::local_map::LocalMap;
use super::pose_graph::{Constraint, PoseGraph, turned_information};
use super::scan_points::ScanPoint;
use super::scan_registration::{GAIN, thinned};
use crate::shared::geometry::Pose2;
use nalgebra::{Matrix3, Translation2, Vector2, Vector3};
use std::f64::consts::PI;
use std::ops::Range;

/// Distance of two submaps up to which they may have walls in common, metres, beyond what they are uncertain.
const COMMON_DISTANCE: f64 = 6.0;
/// Number of earlier submaps, the nearest ones, in which one is searched: the cost of a submap does not grow with the
/// time that a robot spends at one place.
const MAX_SEARCHED: usize = 12;
/// Half the window of the search in standard deviations, and at least, metres and radians. It has no upper bound: what lies
/// outside cannot show that the place is another one.
pub(super) const WINDOW: f64 = 3.0;
pub(super) const LEAST_WINDOW: [f64; 2] = [0.3, 0.1];
/// Number of points that the search looks at.
const SEARCHED_POINTS: usize = 250;
/// Least mean likelihood of the points at a place that is worth a registration.
const LEAST_RESPONSE: f64 = 0.35;
/// Largest likelihood of the points at another place, as a share of that at the best.
const MAX_SECOND: f64 = 0.85;
/// What is another place: distance, metres, and turn, radians.
pub(super) const OTHER_PLACE: [f64; 2] = [0.5, 0.15];
/// Standard deviation of a position, metres, above which a place is searched in all that may be there.
const UNCERTAIN: f64 = 0.5;
/// Share of the information of a registration that a closure has: the submaps are bent themselves.
const INFORMATION_SHARE: f64 = 0.3;
/// Shift by which it is seen whether walls show where along them a submap is, metres: no more than the likelihood field has walls
/// beside the window. And the least evidence that is lost by it: a standard deviation of seven metres.
const SLIDE: f64 = MARGIN;
const LEAST_LOST: f64 = 1e-3;
/// Information on a pose of which nothing else is known, so that it has a covariance.
const LEAST_INFORMATION: f64 = 1e-6;

/// Distance of the squares of a recorded map that are part of the map around one, metres: what a lidar sees from there.
const RECORDED_AROUND: f64 = 14.0;

/// The scans of one robot, which follow each other in time, or the squares of a recorded map.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Drive {
    pub(super) scans: Range<usize>,
    pub(super) is_recorded: bool,
}

/// A submap that has just been finished, which may be where the robot was before.
pub(super) struct Revisit<'a> {
    pub(super) graph: &'a PoseGraph,
    /// The points of each scan.
    pub(super) scans: &'a [&'a [ScanPoint]],
    /// The submaps, as ranges of scans; the last is the one that is looked for.
    pub(super) submaps: &'a [Range<usize>],
    /// The drives of which the scans are, one after the other.
    pub(super) drives: &'a [Drive],
    /// First scan of the local map: what is in it is registered already.
    pub(super) recent: usize,
}

/// An earlier submap that may be where the last one is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    /// Number of the submap.
    pub(super) submap: usize,
    /// Covariance of its pose (x, y, yaw) in the frame of the last submap.
    pub(super) covariance: Matrix3<f64>,
}

impl Candidate {
    /// Whether it may be so far off that a place is searched in all that may be there.
    pub(super) fn is_uncertain(&self) -> bool {
        self.deviations()[0] > UNCERTAIN
    }

    /// Standard deviations of its position, metres, and of its yaw, radians.
    pub(super) fn deviations(&self) -> [f64; 2] {
        [(self.covariance.m11 + self.covariance.m22).sqrt(), self.covariance.m33.sqrt()]
    }
}

/// Looks for the last submap, whose middle scan is expected to be at `pose`, in the first of the candidates. Each in which it
/// fits gives the pose of that scan in the earlier submap.
pub(super) fn find_closures(revisit: &Revisit<'_>, pose: &Pose2, candidates: &[Candidate]) -> Vec<Constraint> {
    let Some(own) = revisit.submaps.last() else { return Vec::new() };
    let centre = middle(own);
    let points = revisit.points_of(own.clone(), centre);
    let find_in = |candidate: &Candidate| {
        let mean = revisit.pose_of(candidate.submap).inv_mul(pose);
        revisit.find_in(candidate, &mean, centre, &points)
    };
    candidates.iter().take(MAX_SEARCHED).filter_map(find_in).collect()
}

/// The scan in the middle of a submap, whose pose is that of the submap.
pub(super) fn middle(scans: &Range<usize>) -> usize {
    (scans.start + scans.end) / 2
}

impl Revisit<'_> {
    /// The earlier submaps that may be where the last one is, the nearest first. `covariance` gives that of a scan in the
    /// frame of the last submap.
    pub(super) fn candidates(&self, covariance: impl Fn(usize) -> Matrix3<f64>) -> Vec<Candidate> {
        let Some((own, earlier)) = self.submaps.split_last() else { return Vec::new() };
        let poses = &self.graph.poses;
        let distance = |other: &Range<usize>| {
            (poses[middle(other)].translation.vector - poses[middle(own)].translation.vector).norm()
        };
        let mut apart: Vec<(f64, usize)> = (0..earlier.len())
            .filter(|submap| earlier[*submap].end <= self.recent)
            .map(|submap| (distance(&earlier[submap]), submap))
            .collect();
        apart.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let may_be_there = |(distance, submap): (f64, usize)| {
            let candidate = Candidate { submap, covariance: covariance(middle(&earlier[submap])) };
            (distance <= COMMON_DISTANCE + 2.0 * candidate.deviations()[0]).then_some(candidate)
        };
        apart.into_iter().filter_map(may_be_there).collect()
    }

    /// The pose of a submap: that of its middle scan.
    pub(super) fn pose_of(&self, submap: usize) -> Pose2 {
        self.graph.poses[middle(&self.submaps[submap])]
    }

    /// The drive of a scan.
    pub(super) fn drive(&self, scan: usize) -> &Drive {
        &self.drives[self.drives.partition_point(|drive| drive.scans.end <= scan)]
    }

    /// Points of scans in the frame of one of them.
    pub(super) fn points_of(&self, scans: Range<usize>, frame: usize) -> Vec<ScanPoint> {
        let into = self.graph.poses[frame].inverse();
        let of_scan = |scan: usize| {
            let by = into * self.graph.poses[scan];
            let moved = move |point: &ScanPoint| ScanPoint {
                place: by * point.place,
                normal: point.normal.map(|normal| by * normal),
            };
            self.scans[scan].iter().map(moved)
        };
        scans.flat_map(of_scan).collect()
    }

    /// The scans before `until` of a submap and of those before and after it on the same drive, as a later one need not
    /// begin where it did; of a recorded map those around it.
    pub(super) fn scans_around(&self, submap: usize, until: usize) -> Vec<usize> {
        let own = &self.submaps[submap];
        let drive = self.drive(own.start);
        if drive.is_recorded {
            let at = |scan: usize| self.graph.poses[scan].translation.vector;
            let is_near = |scan: &usize| (at(*scan) - at(own.start)).norm() <= RECORDED_AROUND;
            return drive.scans.clone().filter(is_near).collect();
        }
        let beside = |other: Option<usize>| {
            let other = self.submaps.get(other?)?;
            (drive.scans.contains(&other.start) && other.end <= until).then_some(other)
        };
        let first = beside(submap.checked_sub(1)).map_or(own.start, |before| before.start);
        let last = beside(submap.checked_add(1)).map_or(own.end, |after| after.end);
        (first..last).collect()
    }

    /// The walls of scans at their poses in the frame of one of them.
    pub(super) fn map_of(&self, scans: &[usize], frame: usize) -> LocalMap {
        let poses = &self.graph.poses;
        let into = poses[frame].inverse();
        LocalMap::new(scans.iter().map(|scan| (into * poses[*scan], self.scans[*scan])))
    }

    /// Looks for the points of the scan `centre` and those around it in an earlier submap, where its pose is expected to be
    /// `mean` in that of the submap.
    fn find_in(&self, candidate: &Candidate, mean: &Pose2, centre: usize, points: &[ScanPoint]) -> Option<Constraint> {
        let at = middle(&self.submaps[candidate.submap]);
        let deviations = candidate.deviations();
        let map = self.map_of(&self.scans_around(candidate.submap, self.recent), at);
        let half = |axis: usize| (WINDOW * deviations[axis]).max(LEAST_WINDOW[axis]);
        let window = [half(0), half(0), half(1).min(PI)];
        let information = turned_information(&candidate.covariance.try_inverse()?, &mean.rotation);
        let prior = PosePrior { mean: *mean, information, window };
        let searched = thinned(points, SEARCHED_POINTS);
        let field = map.field(&searched, &prior);
        let found = search(&field, &searched, &prior, GAIN, LEAST_RESPONSE, None)?;
        let fit = map.find(points, &found.pose)?;
        let excluded = Excluded { pose: found.pose, distance: OTHER_PLACE[0], turn: OTHER_PLACE[1] };
        let least = MAX_SECOND * found.response;
        if search(&field, &searched, &prior, GAIN, least, Some(&excluded)).is_some() {
            return None;
        }
        let evidence_at = |shift: Vector2<f64>| {
            let shifted = Translation2::from(shift) * fit.pose;
            GAIN * field.likelihood(searched.iter().map(|point| shifted * point))
        };
        let information = without_slide(&(INFORMATION_SHARE * fit.information), evidence_at);
        Some(Constraint { from: at, to: centre, transform: fit.pose, information, is_loop: true })
    }
}

/// The information on a pose whose position is known no better, in the direction in which it is least known, than the evidence
/// falls where it is shifted that way. In a corridor the normals of walls are noisy and door frames may meet others: both seem to
/// show where along it a submap is, though its points lie as well on the walls elsewhere.
fn without_slide(information: &Matrix3<f64>, evidence_at: impl Fn(Vector2<f64>) -> f64) -> Matrix3<f64> {
    let Some(covariance) = (information + Matrix3::identity() * LEAST_INFORMATION).try_inverse() else {
        return *information;
    };
    let position = covariance.fixed_view::<2, 2>(0, 0).into_owned().symmetric_eigen();
    let widest = position.eigenvalues.imax();
    let along = position.eigenvectors.column(widest).into_owned();
    let shifted = evidence_at(SLIDE * along).max(evidence_at(-SLIDE * along));
    let lost = (evidence_at(Vector2::zeros()) - shifted).max(LEAST_LOST);
    // Of a normal distribution, whose logarithm falls by this.
    let variance = SLIDE * SLIDE / (2.0 * lost);
    let excess = (variance - position.eigenvalues[widest]).max(0.0);
    let along = Vector3::new(along.x, along.y, 0.0);
    (covariance + excess * along * along.transpose()).try_inverse().unwrap_or(*information)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Standard deviations along x, y and of the yaw.
    fn deviations(information: &Matrix3<f64>) -> [f64; 3] {
        let covariance = information.try_inverse().unwrap();
        [0, 1, 2].map(|axis| covariance[(axis, axis)].sqrt())
    }

    #[test]
    fn a_place_along_a_corridor_is_as_certain_as_the_evidence_falls_beside_it() {
        let seeming = Matrix3::from_diagonal(&Vector3::new(0.05, 0.01, 0.004).map(|deviation: f64| deviation.powi(-2)));
        // Nothing is lost along x.
        let [x, y, yaw] = deviations(&without_slide(&seeming, |shift| 30.0 - 2000.0 * shift.y * shift.y));
        assert!(x > 2.0 && (y - 0.01).abs() < 1e-6 && (yaw - 0.004).abs() < 1e-6, "{x} {y} {yaw}");
        // As much as by a standard deviation of 0.2 m.
        let [x, ..] = deviations(&without_slide(&seeming, |shift| -0.5 * shift.norm_squared() / 0.04));
        assert!((x - 0.2).abs() < 1e-6, "{x}");
        // More than the normals say, which remain what they are.
        let [x, ..] = deviations(&without_slide(&seeming, |shift| -1e3 * shift.norm_squared()));
        assert!((x - 0.05).abs() < 1e-4, "{x}");
        // Elsewhere it is likelier.
        let [x, ..] = deviations(&without_slide(&seeming, |shift| shift.x));
        assert!(x > 2.0, "{x}");
    }
}
