//! Loop closures: submaps that were seen before.

use super::correlative_search::{Excluded, PosePrior, search};
use super::local_map::LocalMap;
use super::pose_graph::{Constraint, PoseGraph, turned_information};
use super::scan_points::ScanPoint;
use super::scan_registration::{GAIN, reach, thinned};
use nalgebra::Matrix3;
use std::ops::Range;

/// Distance of two submaps up to which they may have walls in common, metres, beyond what they are uncertain.
const COMMON_DISTANCE: f64 = 6.0;
/// Number of earlier submaps, the nearest ones, in which one is searched: the cost of a submap does not grow with the
/// time that a robot spends at one place.
const MAX_SEARCHED: usize = 12;
/// Half the window of the search in standard deviations, and its bounds, metres and radians.
const WINDOW: f64 = 3.0;
const LEAST_WINDOW: [f64; 2] = [0.3, 0.1];
const LARGEST_WINDOW: [f64; 2] = [4.0, 0.6];
/// Number of points that the search looks at.
const SEARCHED_POINTS: usize = 250;
/// Least mean likelihood of the points at a place that is worth a registration.
const LEAST_RESPONSE: f64 = 0.35;
/// Least share of the points on walls of the other submap.
const LEAST_MATCHED: f64 = 0.5;
/// Largest likelihood of the points at another place, as a share of that at the best.
const MAX_SECOND: f64 = 0.85;
/// What is another place: distance, metres, and turn, radians.
const OTHER_PLACE: [f64; 2] = [0.5, 0.15];
/// Share of the information of a registration that a closure has: the submaps are bent themselves.
const INFORMATION_SHARE: f64 = 0.3;

/// A submap that has just been finished, which may be where the robot was before.
pub(super) struct Revisit<'a> {
    pub(super) graph: &'a PoseGraph,
    /// The points of each scan.
    pub(super) scans: &'a [Vec<ScanPoint>],
    /// The submaps, as ranges of scans; the last is the one that is looked for.
    pub(super) submaps: &'a [Range<usize>],
    /// First scan of the local map: what is in it is registered already.
    pub(super) recent: usize,
}

/// Looks for the last submap in the earlier ones that may be at its place. Each that fits is the pose of its middle
/// scan in that of the earlier submap.
pub(super) fn find_loop_closures(revisit: &Revisit<'_>) -> Vec<Constraint> {
    let Some((own, earlier)) = revisit.submaps.split_last() else { return Vec::new() };
    let centre = middle(own);
    let poses = &revisit.graph.poses;
    let distance =
        |other: &Range<usize>| (poses[middle(other)].translation.vector - poses[centre].translation.vector).norm();
    let mut candidates: Vec<(f64, usize)> = (0..earlier.len())
        .filter(|other| earlier[*other].end <= revisit.recent)
        .map(|other| (distance(&earlier[other]), other))
        .collect();
    if candidates.is_empty() {
        return Vec::new();
    }
    candidates.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let covariances = revisit.graph.covariances_from(centre);
    let points = revisit.points_of_submap(own);
    let may_be_there = |(distance, other): (f64, usize)| {
        let covariance = covariances[middle(&earlier[other])]?;
        let deviation = (covariance.m11 + covariance.m22).sqrt();
        (distance <= COMMON_DISTANCE + 2.0 * deviation).then_some((other, covariance))
    };
    let searched = candidates.into_iter().filter_map(may_be_there).take(MAX_SEARCHED);
    searched.filter_map(|(other, covariance)| revisit.find_in(other, centre, &points, &covariance)).collect()
}

/// The scan in the middle of a submap, whose pose is that of the submap.
pub(super) fn middle(scans: &Range<usize>) -> usize {
    (scans.start + scans.end) / 2
}

impl Revisit<'_> {
    /// Points of a submap in the frame of its middle scan.
    fn points_of_submap(&self, scans: &Range<usize>) -> Vec<ScanPoint> {
        let into = self.graph.poses[middle(scans)].inverse();
        let of_scan = |scan: usize| {
            let by = into * self.graph.poses[scan];
            let moved = move |point: &ScanPoint| ScanPoint {
                place: by * point.place,
                normal: point.normal.map(|normal| by * normal),
            };
            self.scans[scan].iter().map(moved)
        };
        scans.clone().flat_map(of_scan).collect()
    }

    /// The walls of a submap and of those before and after it, as the later one need not begin where it did, from scans
    /// before `until`, in the frame of the submap's middle scan.
    pub(super) fn map_around(&self, submap: usize, until: usize) -> LocalMap {
        let poses = &self.graph.poses;
        let first = self.submaps[submap.saturating_sub(1)].start;
        let after = self.submaps.get(submap + 1).filter(|after| after.end <= until);
        let last = after.map_or(self.submaps[submap].end, |after| after.end);
        let into = poses[middle(&self.submaps[submap])].inverse();
        LocalMap::new((first..last).map(|scan| (into * poses[scan], &self.scans[scan][..])))
    }

    /// Looks for the points of the scan `centre` and those around it in an earlier submap. `covariance` is that of
    /// the earlier submap in the frame of `centre`.
    fn find_in(
        &self,
        other: usize,
        centre: usize,
        points: &[ScanPoint],
        covariance: &Matrix3<f64>,
    ) -> Option<Constraint> {
        let poses = &self.graph.poses;
        let at = middle(&self.submaps[other]);
        let deviations = [(covariance.m11 + covariance.m22).sqrt(), covariance.m33.sqrt()];
        let map = self.map_around(other, self.recent);
        let mean = poses[at].inv_mul(&poses[centre]);
        let half = |axis: usize| (WINDOW * deviations[axis]).clamp(LEAST_WINDOW[axis], LARGEST_WINDOW[axis]);
        let window = [half(0), half(0), half(1)];
        let information = turned_information(&covariance.try_inverse()?, &mean.rotation);
        let prior = PosePrior { mean, information, window };
        let searched = thinned(points, SEARCHED_POINTS);
        let [low, high] = reach(&searched, &mean, &window);
        let field = map.field(&low, &high);
        let found = search(&field, &searched, &prior, GAIN, LEAST_RESPONSE, None)?;
        let fit = map.register(points, &found.pose, None);
        if fit.matched < LEAST_MATCHED {
            return None;
        }
        let excluded = Excluded { pose: found.pose, distance: OTHER_PLACE[0], turn: OTHER_PLACE[1] };
        let least = MAX_SECOND * found.response;
        if search(&field, &searched, &prior, GAIN, least, Some(&excluded)).is_some() {
            return None;
        }
        Some(Constraint {
            from: at,
            to: centre,
            transform: fit.pose,
            information: INFORMATION_SHARE * fit.information,
            is_loop: true,
        })
    }
}
