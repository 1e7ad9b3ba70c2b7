//! Relocalization: where a robot is, in all that it saw before, when its pose is too uncertain for one place.
//!
//! After a long way a pose is less certain than two doors of a corridor are apart. Where a robot then fits into one submap
//! it may fit into others as well, which the search of one alone does not see. So the scans of its last metres are searched in
//! all submaps at once, within all that is uncertain. Where most of them fit at one place alone, and no beams pass through
//! walls there, the robot has been there: what looks alike is seldom alike all along such a way.
//!
//! After a gap in which nothing shows well how the robot has moved, its next scan is searched likewise in the map around it.

use super::contradictions::{MAX_CONTRADICTING, PlacedScan, find_contradictions};
use super::correlative_search::{Excluded, PosePrior, search};
use super::likelihood_field::LikelihoodField;
use super::local_map::LocalMap;
use super::loop_closure::{Candidate, LEAST_WINDOW, OTHER_PLACE, Revisit, WINDOW, find_closures, middle};
use super::point_to_line::Match;
use super::pose_graph::{Constraint, turned_information};
use super::scan_points::ScanPoint;
use super::scan_registration::{GAIN, thinned};
use crate::shared::geometry::{Point2, Pose2};
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeSet;
use std::f64::consts::PI;

/// Least mean likelihood of the points at a place where the robot may be: much that was not seen looks alike.
const LEAST_RESPONSE: f64 = 0.7;
/// Logarithm of how much likelier than any other a place must be.
const LEAST_LEAD: f64 = 7.0;
/// Largest half of the window, metres and radians: a robot that may be farther off is not searched for, which bounds what a
/// submap costs.
const LARGEST_WINDOW: [f64; 2] = [30.0, 1.5];
/// Number of points that are searched for.
const SEARCHED_POINTS: usize = 750;
/// Distance of the farthest of them from the middle of the submap, metres.
const FARTHEST: f64 = 20.0;

/// Looks for the last submap in the earlier ones that may be at its place, by what is known of their relative poses: in each
/// by itself where that is certain, and otherwise in all of them. Each in which it fits gives the pose of its middle scan.
/// `covariances` are those of the scans in its frame, and `lidars` the positions of the lidar at them, in the frame of the base.
pub(super) fn find_loop_closures(
    revisit: &Revisit<'_>,
    covariances: &[Matrix3<f64>],
    lidars: &[Point2],
) -> Vec<Constraint> {
    let Some(own) = revisit.submaps.last() else { return Vec::new() };
    let candidates = revisit.candidates(|scan| covariances[scan]);
    let certain: Vec<Candidate> = candidates.iter().filter(|other| !other.is_uncertain()).copied().collect();
    let closures = find_closures(revisit, &revisit.graph.poses[middle(own)], &certain);
    if !closures.is_empty() || certain.len() == candidates.len() {
        return closures;
    }
    let earlier = scans_about(revisit, &candidates);
    let place = find_place(revisit, &candidates, &earlier);
    match place.filter(|pose| !is_contradicted(revisit, lidars, pose, &earlier)) {
        Some(pose) => closures_at(revisit, &pose, &candidates),
        None => Vec::new(),
    }
}

/// The scans of the candidates, and those before and after them from which walls may have been seen that the last metres show:
/// without these, a robot that has come back would see much that is in no candidate.
fn scans_about(revisit: &Revisit<'_>, candidates: &[Candidate]) -> Vec<usize> {
    let at = |submap: usize| revisit.pose_of(submap).translation.vector;
    let mut submaps = BTreeSet::new();
    for &Candidate { submap, .. } in candidates {
        let is_about = |other: &usize| {
            revisit.submaps[*other].end <= revisit.recent && (at(*other) - at(submap)).norm() < FARTHEST
        };
        submaps.extend((0..=submap).rev().take_while(is_about));
        submaps.extend((submap..revisit.submaps.len()).take_while(is_about));
    }
    submaps.into_iter().flat_map(|submap| revisit.submaps[submap].clone()).collect()
}

/// The pose of the last submap where its last metres are found in the `earlier` scans, those about the candidates. `None` if
/// they fit nowhere, or at several places.
fn find_place(revisit: &Revisit<'_>, candidates: &[Candidate], earlier: &[usize]) -> Option<Pose2> {
    let scan = middle(revisit.submaps.last()?);
    let mut points = revisit.points_of(revisit.recent..revisit.submaps.last()?.end, scan);
    points.retain(|point| point.place.coords.norm() < FARTHEST);
    let searched = thinned(&points, SEARCHED_POINTS);
    let poses = &revisit.graph.poses;
    let least_known = candidates.iter().max_by(|a, b| a.deviations()[0].total_cmp(&b.deviations()[0]))?;
    let information = turned_information(&least_known.covariance.try_inverse()?, &poses[scan].rotation);
    let covariance = information.try_inverse()?;
    let [x, y, yaw] = [0, 1, 2].map(|axis| WINDOW * covariance[(axis, axis)].sqrt());
    // Written so that a value that is not a number fails it.
    if !(x <= LARGEST_WINDOW[0] && y <= LARGEST_WINDOW[0] && yaw <= LARGEST_WINDOW[1]) {
        return None;
    }
    let prior = PosePrior { mean: poses[scan], information, window: [x, y, yaw] };
    let walls = earlier.iter().flat_map(|&scan| revisit.scans[scan].iter().map(move |point| poses[scan] * point.place));
    let field = LikelihoodField::new(walls, &prior.reach(&searched), x.max(y));
    find_only_place(&field, &searched, &prior, LEAST_RESPONSE)
}

/// The pose at which points fit into a field, with at least a mean likelihood. `None` if they fit nowhere, or at several places.
fn find_only_place(field: &LikelihoodField, points: &[Point2], prior: &PosePrior, least: f64) -> Option<Pose2> {
    let found = search(field, points, prior, GAIN, least, None)?;
    let excluded = Excluded { pose: found.pose, distance: OTHER_PLACE[0], turn: OTHER_PLACE[1] };
    // What has fewer points on walls is less likely whatever the prior says.
    let least = (found.score - LEAST_LEAD) / (GAIN * points.len() as f64);
    let other = search(field, points, prior, GAIN, least, Some(&excluded));
    other.is_none_or(|other| other.score <= found.score - LEAST_LEAD).then_some(found.pose)
}

/// Registers a scan on a map where it fits at one place alone, of all at which it may be. `guess` is its pose as it is expected, with
/// the standard deviations of its position and yaw, metres and radians. `None` if it fits nowhere, or at several places.
pub(super) fn relocate(map: &LocalMap, points: &[ScanPoint], guess: &Pose2, deviations: [f64; 2]) -> Option<Match> {
    let [place, yaw] = deviations.map(|deviation| WINDOW * deviation);
    if !place.is_finite() || place > LARGEST_WINDOW[0] {
        return None;
    }
    let information = Vector3::new(deviations[0], deviations[0], deviations[1]).map(|deviation| deviation.powi(-2));
    let information = Matrix3::from_diagonal(&information);
    let prior = PosePrior { mean: *guess, information, window: [place, place, yaw.min(PI)] };
    let searched = thinned(points, SEARCHED_POINTS);
    let found = find_only_place(&map.field(&searched, &prior), &searched, &prior, 0.0)?;
    Some(map.register(points, &found, (guess, &information)))
}

/// Whether the scans of the last metres contradict earlier ones, or these them, where the last submap is at a pose.
fn is_contradicted(revisit: &Revisit<'_>, lidars: &[Point2], pose: &Pose2, earlier: &[usize]) -> bool {
    let Some(own) = revisit.submaps.last() else { return false };
    let poses = &revisit.graph.poses;
    let moved = pose * poses[middle(own)].inverse();
    let placed = |scan: usize, pose: Pose2, drive: usize| PlacedScan {
        points: revisit.scans[scan],
        pose,
        lidar: lidars.get(scan).copied(),
        drive,
    };
    let last = (revisit.recent..own.end).map(|scan| placed(scan, moved * poses[scan], 0));
    let earlier = earlier.iter().map(|&scan| placed(scan, poses[scan], 1));
    let scans: Vec<PlacedScan<'_>> = last.chain(earlier).collect();
    // Those of one side contradict each other neither more nor less for the place.
    find_contradictions(&scans, scans.len()).are_more_than(MAX_CONTRADICTING)
}

/// Ties the last submap, which is at a pose, to the nearest of the candidates there.
fn closures_at(revisit: &Revisit<'_>, pose: &Pose2, candidates: &[Candidate]) -> Vec<Constraint> {
    let [place, yaw] = LEAST_WINDOW.map(|window| (window / WINDOW).powi(2));
    let covariance = Matrix3::from_diagonal(&Vector3::new(0.5 * place, 0.5 * place, yaw));
    let distance = |submap: usize| (revisit.pose_of(submap).translation.vector - pose.translation.vector).norm();
    let mut near: Vec<(f64, usize)> = candidates.iter().map(|other| (distance(other.submap), other.submap)).collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let near: Vec<Candidate> = near.into_iter().map(|(_, submap)| Candidate { submap, covariance }).collect();
    find_closures(revisit, pose, &near)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mapping::slam::loop_closure::Drive;
    use crate::mapping::slam::pose_graph::PoseGraph;
    use crate::shared::geometry::{Point2, pose};
    use nalgebra::Vector2;
    use std::ops::Range;

    const SUBMAP: usize = 10;

    /// Surfaces, and the boxes that hide what is behind them: left, low, right, high, metres.
    #[derive(Default)]
    struct Corridor {
        surfaces: Vec<ScanPoint>,
        boxes: Vec<[f64; 4]>,
    }

    impl Corridor {
        /// 60 m long with a pillar on both sides each 4 m, and a cupboard at `x`; its sides are `wider` than 1.5 m from its middle.
        fn new(x: f64, wider: f64) -> Self {
            let [low, high] = [-wider, 3.0 + wider];
            let mut corridor = Self::default();
            corridor.wall([0.0, low], [60.0, low], [0.0, 1.0]);
            corridor.wall([0.0, high], [60.0, high], [0.0, -1.0]);
            for number in 0..15 {
                let left = 4.0 * f64::from(number) + 1.0;
                corridor.put([left, low, left + 0.5, low + 0.5]);
                corridor.put([left, high - 0.5, left + 0.5, high]);
            }
            corridor.put([x, high - 1.0, x + 3.0, high]);
            corridor
        }

        fn wall(&mut self, from: [f64; 2], to: [f64; 2], normal: [f64; 2]) {
            let (from, to) = (Vector2::from(from), Vector2::from(to));
            let steps = ((to - from).norm() / 0.05).round() as usize;
            self.surfaces.extend((0..=steps).map(|step| ScanPoint {
                place: Point2::from(from + (to - from) * (step as f64 / steps as f64)),
                normal: Some(Vector2::from(normal)),
            }));
        }

        fn put(&mut self, [left, low, right, high]: [f64; 4]) {
            self.boxes.push([left, low, right, high]);
            self.wall([left, low], [left, high], [-1.0, 0.0]);
            self.wall([right, low], [right, high], [1.0, 0.0]);
            self.wall([left, low], [right, low], [0.0, -1.0]);
            self.wall([left, high], [right, high], [0.0, 1.0]);
        }

        /// Whether a box is between a place and a surface.
        fn is_hidden(&self, from: &Vector2<f64>, to: &Point2) -> bool {
            let way = to.coords - from;
            self.boxes.iter().any(|[left, low, right, high]| {
                let within =
                    [(from.x, way.x, left, right), (from.y, way.y, low, high)].map(|(at, way, least, most)| {
                        let ends = [(least - at) / way, (most - at) / way];
                        [ends[0].min(ends[1]), ends[0].max(ends[1])]
                    });
                // Not the surface itself, which is at the end of the way.
                within[0][0].max(within[1][0]) < within[0][1].min(within[1][1]).min(1.0 - 1e-3)
            })
        }

        /// What is seen from a pose.
        fn scan(&self, at: &Pose2) -> Vec<ScanPoint> {
            let lidar = at.translation.vector;
            let near = self.surfaces.iter().filter(|point| (point.place.coords - lidar).norm() < 6.0);
            let seen = near.filter(|point| !self.is_hidden(&lidar, &point.place));
            seen.map(|point| ScanPoint { place: at.inverse() * point.place, ..*point }).collect()
        }
    }

    /// What a judge says of a robot that has gone along the corridor, and comes back to a place in it after a way on which its
    /// pose has become wrong by `off` metres along it, with a standard deviation of 2 m. Then it sees other walls.
    fn judged<T>(
        corridor: &Corridor,
        corridor_again: &Corridor,
        place: f64,
        off: f64,
        judge: impl FnOnce(&Revisit<'_>, &[Candidate]) -> T,
    ) -> T {
        let at = |step: usize| pose(0.4 * step as f64, 1.5, 0.0);
        let again = |step: usize| pose(place + 0.4 * step as f64, 1.5, 0.0);
        let truth: Vec<Pose2> = (0..150).map(at).chain((0..SUBMAP).map(again)).collect();
        let seen = |(scan, truth): (usize, &Pose2)| match scan < 150 {
            true => corridor.scan(truth),
            false => corridor_again.scan(truth),
        };
        let scans: Vec<Vec<ScanPoint>> = truth.iter().enumerate().map(seen).collect();
        let scans: Vec<&[ScanPoint]> = scans.iter().map(Vec::as_slice).collect();
        let mut graph = PoseGraph { poses: truth, ..Default::default() };
        graph.poses[150..].iter_mut().for_each(|pose| pose.translation.x += off);
        let submaps: Vec<Range<usize>> = (0..16).map(|submap| SUBMAP * submap..SUBMAP * (submap + 1)).collect();
        let drives = [Drive { scans: 0..160, is_recorded: false }];
        let revisit = Revisit { graph: &graph, scans: &scans, submaps: &submaps, drives: &drives, recent: 150 };
        let covariance = Matrix3::from_diagonal(&Vector3::new(4.0, 0.04, 0.01));
        let candidates = revisit.candidates(|_| covariance);
        assert!(candidates.iter().all(Candidate::is_uncertain));
        judge(&revisit, &candidates)
    }

    #[test]
    fn a_corridor_that_looks_alike_all_along_is_known_again_only_where_something_stands() {
        let corridor = Corridor::new(33.5, 0.0);
        let find = |revisit: &Revisit<'_>, candidates: &[Candidate]| {
            find_place(revisit, candidates, &scans_about(revisit, candidates))
        };
        // The place nearest to where it seems to be that fits but for the cupboard is one pillar away.
        let at = judged(&corridor, &corridor, 30.0, 3.6, find).unwrap();
        let truth = 30.0 + 0.4 * 5.0;
        assert!((at.translation.x - truth).abs() < 0.1 && (at.translation.y - 1.5).abs() < 0.1, "{at}");
        assert_eq!(judged(&corridor, &corridor, 12.0, 3.6, find), None);
    }

    #[test]
    fn a_place_at_which_beams_pass_through_walls_is_another_one() {
        let corridor = Corridor::new(33.5, 0.0);
        let is_contradicted = |again: &Corridor| {
            judged(&corridor, again, 30.0, 3.6, |revisit, candidates| {
                let earlier = scans_about(revisit, candidates);
                is_contradicted(revisit, &[Point2::origin(); 160], &pose(32.0, 1.5, 0.0), &earlier)
            })
        };
        assert!(!is_contradicted(&corridor));
        assert!(is_contradicted(&Corridor::new(33.5, 1.0)));
    }

    #[test]
    fn walls_that_no_candidate_shows_are_those_of_the_scans_before_and_after_them() {
        let corridor = Corridor::new(33.5, 0.0);
        let [own, about] = judged(&corridor, &corridor, 30.0, 3.6, |revisit, candidates| {
            let nearest = &candidates[..1];
            let own = revisit.submaps[nearest[0].submap].clone().collect::<Vec<usize>>();
            [own, scans_about(revisit, nearest)]
        });
        assert!(
            own.iter().all(|scan| about.contains(scan)) && about.len() > 6 * own.len(),
            "{} {}",
            own.len(),
            about.len()
        );
        assert!(about.is_sorted() && *about.last().unwrap() < 150, "what is in the local map is no witness");
    }
}
