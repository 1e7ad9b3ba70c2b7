//! Relocalization: where a robot is, in all that it saw before, when its pose is too uncertain for one place.
//!
//! After a long way a pose is less certain than two doors of a corridor are apart. Where a robot then fits into one submap
//! it may fit into others as well, which the search of one alone does not see. So the scans of its last metres are searched in
//! all submaps at once, within all that is uncertain. Where most of them fit at one place alone, and no beams pass through
//! walls there, the robot has been there: what looks alike is seldom alike all along such a way.

use super::contradictions::{MAX_CONTRADICTING, PlacedScan, find_contradictions};
use super::correlative_search::{Excluded, PosePrior, search};
use super::likelihood_field::LikelihoodField;
use super::loop_closure::{Candidate, LEAST_WINDOW, OTHER_PLACE, Revisit, WINDOW, find_closures, middle};
use super::pose_graph::{Constraint, turned_information};
use super::scan_registration::{GAIN, thinned};
use crate::shared::geometry::{Point2, Pose2};
use nalgebra::{Matrix3, Vector3};
use std::cell::LazyCell;

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
/// `lidars` are the positions of the lidar at the scans, in the frame of the base.
pub(super) fn find_loop_closures(revisit: &Revisit<'_>, lidars: &[Point2]) -> Vec<Constraint> {
    let Some(own) = revisit.submaps.last() else { return Vec::new() };
    let covariances = LazyCell::new(|| revisit.graph.covariances_from(middle(own)));
    let candidates = revisit.candidates(|scan| covariances[scan]);
    let certain: Vec<Candidate> = candidates.iter().filter(|other| !other.is_uncertain()).copied().collect();
    let closures = find_closures(revisit, &revisit.graph.poses[middle(own)], &certain);
    if !closures.is_empty() || certain.len() == candidates.len() {
        return closures;
    }
    match find_place(revisit, &candidates).filter(|pose| !is_contradicted(revisit, lidars, pose, &candidates)) {
        Some(pose) => closures_at(revisit, &pose, &candidates),
        None => Vec::new(),
    }
}

/// The pose of the last submap where the scans of its last metres are found in the candidates. `None` if they fit nowhere, or
/// at several places.
fn find_place(revisit: &Revisit<'_>, candidates: &[Candidate]) -> Option<Pose2> {
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
    let scans = candidates.iter().flat_map(|candidate| revisit.submaps[candidate.submap].clone());
    let walls = scans.flat_map(|scan| revisit.scans[scan].iter().map(move |point| poses[scan] * point.place));
    let field = LikelihoodField::new(walls, &prior.reach(&searched), x.max(y));
    let found = search(&field, &searched, &prior, GAIN, LEAST_RESPONSE, None)?;
    let excluded = Excluded { pose: found.pose, distance: OTHER_PLACE[0], turn: OTHER_PLACE[1] };
    // What has fewer points on walls is less likely whatever the prior says.
    let least = (found.score - LEAST_LEAD) / (GAIN * searched.len() as f64);
    let other = search(&field, &searched, &prior, GAIN, least, Some(&excluded));
    if other.is_some_and(|other| other.score > found.score - LEAST_LEAD) {
        return None;
    }
    Some(found.pose)
}

/// Whether the scans of the last metres contradict the candidates, or these them, where the last submap is at a pose.
fn is_contradicted(revisit: &Revisit<'_>, lidars: &[Point2], pose: &Pose2, candidates: &[Candidate]) -> bool {
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
    let earlier = candidates.iter().flat_map(|candidate| revisit.submaps[candidate.submap].clone());
    let scans: Vec<PlacedScan<'_>> = last.chain(earlier.map(|scan| placed(scan, poses[scan], 1))).collect();
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
    use crate::mapping::slam::scan_points::ScanPoint;
    use crate::shared::geometry::{Point2, pose};
    use nalgebra::Vector2;
    use std::ops::Range;

    const SUBMAP: usize = 10;

    /// A corridor 60 m long with a pillar on both sides each 4 m, and a cupboard at `x`.
    fn corridor(x: f64) -> Vec<ScanPoint> {
        let wall = |from: [f64; 2], to: [f64; 2], normal: [f64; 2]| {
            let (from, to) = (Vector2::from(from), Vector2::from(to));
            let steps = ((to - from).norm() / 0.05).round() as usize;
            (0..=steps).map(move |step| ScanPoint {
                place: Point2::from(from + (to - from) * (step as f64 / steps as f64)),
                normal: Some(Vector2::from(normal)),
            })
        };
        let pillars = (0..15).map(|number| 4.0 * f64::from(number) + 1.0).flat_map(|x| {
            let low = wall([x, 0.0], [x, 0.5], [-1.0, 0.0]).chain(wall([x + 0.5, 0.0], [x + 0.5, 0.5], [1.0, 0.0]));
            low.chain(wall([x, 2.5], [x, 3.0], [-1.0, 0.0])).chain(wall([x + 0.5, 2.5], [x + 0.5, 3.0], [1.0, 0.0]))
        });
        let sides = wall([0.0, 0.0], [60.0, 0.0], [0.0, 1.0]).chain(wall([0.0, 3.0], [60.0, 3.0], [0.0, -1.0]));
        let cupboard = wall([x, 1.6], [x, 3.0], [-1.0, 0.0]).chain(wall([x, 1.6], [x + 3.0, 1.6], [0.0, -1.0]));
        sides.chain(pillars).chain(cupboard).collect()
    }

    /// What a judge says of a robot that has gone along the corridor, and comes back to a place in it after a way on which its
    /// pose has become wrong by `off` metres along it, with a standard deviation of 2 m. Then it sees other walls.
    fn judged<T>(
        walls: &[ScanPoint],
        walls_again: &[ScanPoint],
        place: f64,
        off: f64,
        judge: impl FnOnce(&Revisit<'_>, &[Candidate]) -> T,
    ) -> T {
        let at = |step: usize| pose(0.4 * step as f64, 1.5, 0.0);
        let again = |step: usize| pose(place + 0.4 * step as f64, 1.5, 0.0);
        let truth: Vec<Pose2> = (0..150).map(at).chain((0..SUBMAP).map(again)).collect();
        let seen = |(scan, truth): (usize, &Pose2)| -> Vec<ScanPoint> {
            let walls = if scan < 150 { walls } else { walls_again };
            let near = walls.iter().filter(|point| (point.place - truth.translation.vector).coords.norm() < 6.0);
            near.map(|point| ScanPoint { place: truth.inverse() * point.place, ..*point }).collect()
        };
        let scans: Vec<Vec<ScanPoint>> = truth.iter().enumerate().map(seen).collect();
        let scans: Vec<&[ScanPoint]> = scans.iter().map(Vec::as_slice).collect();
        let mut graph = PoseGraph { poses: truth, ..Default::default() };
        graph.poses[150..].iter_mut().for_each(|pose| pose.translation.x += off);
        let submaps: Vec<Range<usize>> = (0..16).map(|submap| SUBMAP * submap..SUBMAP * (submap + 1)).collect();
        let drives = [Drive { scans: 0..160, is_recorded: false }];
        let revisit = Revisit { graph: &graph, scans: &scans, submaps: &submaps, drives: &drives, recent: 150 };
        let covariance = Matrix3::from_diagonal(&Vector3::new(4.0, 0.04, 0.01));
        let candidates = revisit.candidates(|_| Some(covariance));
        assert!(candidates.iter().all(Candidate::is_uncertain));
        judge(&revisit, &candidates)
    }

    #[test]
    fn a_corridor_that_looks_alike_all_along_is_known_again_only_where_something_stands() {
        let walls = corridor(33.5);
        // The place nearest to where it seems to be that fits but for the cupboard is one pillar away.
        let at = judged(&walls, &walls, 30.0, 3.6, find_place).unwrap();
        let truth = 30.0 + 0.4 * 5.0;
        assert!((at.translation.x - truth).abs() < 0.1 && (at.translation.y - 1.5).abs() < 0.1, "{at}");
        assert_eq!(judged(&walls, &walls, 12.0, 3.6, find_place), None);
    }

    #[test]
    fn a_place_at_which_beams_pass_through_walls_is_another_one() {
        let walls = corridor(33.5);
        let wider = |point: &ScanPoint| {
            let place = point.place + Vector2::y() * (point.place.y - 1.5).signum();
            ScanPoint { place, ..*point }
        };
        let wider: Vec<ScanPoint> = walls.iter().map(wider).collect();
        let is_contradicted = |again: &[ScanPoint]| {
            judged(&walls, again, 30.0, 3.6, |revisit, candidates| {
                is_contradicted(revisit, &[Point2::origin(); 160], &pose(32.0, 1.5, 0.0), candidates)
            })
        };
        assert!(!is_contradicted(&walls));
        assert!(is_contradicted(&wider));
    }
}
