//! Relocalization: where a robot is, in all that it saw before, when its pose is too uncertain for one place.
//!
//! After a long way the deviations of a pose are wider than the distance of two doors. A submap then fits at several places
//! that look alike, and what the search of one of them finds says nothing of the others. It is searched in all at once,
//! and where it fits at one place alone, and the next submap fits there, too, the robot has been there before.

use super::correlative_search::{Excluded, PosePrior, search};
use super::likelihood_field::LikelihoodField;
use super::loop_closure::{
    Candidate, LEAST_WINDOW, MAX_SEARCHED, OTHER_PLACE, Revisit, SEARCHED_POINTS, WINDOW, middle,
};
use super::pose_graph::{Constraint, turned_information};
use super::scan_registration::{GAIN, thinned};
use crate::shared::geometry::Pose2;
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::PI;

/// Standard deviation of a position, metres, above which a place is searched in all that may be there.
const UNCERTAIN: f64 = 0.5;
/// Least mean likelihood of the points at a place where the robot may be: much that was not seen looks alike.
const LEAST_RESPONSE: f64 = 0.5;
/// Logarithm of how much likelier than any other a place must be.
const LEAST_LEAD: f64 = 7.0;
/// Largest half of the window, metres: a robot that may be farther off is not searched for.
const LARGEST_WINDOW: f64 = 60.0;
/// Farthest points from the middle of the submap that are searched for, metres.
const FARTHEST: f64 = 20.0;

/// A submap that was found among those before.
#[derive(Clone, Debug)]
pub(super) struct Relocalization {
    /// Its middle scan, and the pose of that.
    scan: usize,
    pose: Pose2,
    /// What it is tied to there.
    closures: Vec<Constraint>,
}

/// Whether a submap may be so far off that it has to be searched in all that may be there.
pub(super) fn is_uncertain(candidate: &Candidate) -> bool {
    candidate.deviations()[0] > UNCERTAIN
}

impl Relocalization {
    /// Looks for the last submap in all of the candidates. `None` if it fits nowhere, or at several places.
    pub(super) fn find(revisit: &Revisit<'_>, candidates: &[Candidate]) -> Option<Self> {
        let scan = middle(revisit.submaps.last()?);
        let points = revisit.points_of_submap(revisit.submaps.last()?);
        let searched: Vec<_> = points.iter().filter(|point| point.place.coords.norm() < FARTHEST).copied().collect();
        let searched = thinned(&searched, SEARCHED_POINTS);
        let poses = &revisit.graph.poses;
        let least_known = candidates.iter().max_by(|a, b| a.deviations()[0].total_cmp(&b.deviations()[0]))?;
        let information = turned_information(&least_known.covariance.try_inverse()?, &poses[scan].rotation);
        let covariance = information.try_inverse()?;
        let [x, y, yaw] = [0, 1, 2].map(|axis| WINDOW * covariance[(axis, axis)].sqrt());
        // Written so that a value that is not a number fails it.
        if !(x <= LARGEST_WINDOW && y <= LARGEST_WINDOW) {
            return None;
        }
        let window = [x, y, yaw.min(PI)];
        let prior = PosePrior { mean: poses[scan], information, window };
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
        let closures = closures_at(revisit, &found.pose, candidates);
        (!closures.is_empty()).then_some(Self { scan, pose: found.pose, closures })
    }

    /// Whether the next submap was found where this one and the way between both say.
    pub(super) fn agrees(&self, next: &Self, poses: &[Pose2]) -> bool {
        let expected = self.pose * poses[self.scan].inv_mul(&poses[next.scan]);
        let off = expected.inv_mul(&next.pose);
        off.translation.vector.norm() < OTHER_PLACE[0] && off.rotation.angle().abs() < OTHER_PLACE[1]
    }

    /// What the submap is tied to.
    pub(super) fn into_closures(self) -> Vec<Constraint> {
        self.closures
    }
}

/// The last submap, which is at a pose, in the nearest of the candidates there.
fn closures_at(revisit: &Revisit<'_>, pose: &Pose2, candidates: &[Candidate]) -> Vec<Constraint> {
    let Some(own) = revisit.submaps.last() else { return Vec::new() };
    let poses = &revisit.graph.poses;
    let points = revisit.points_of_submap(own);
    let place_of = |submap: usize| poses[middle(&revisit.submaps[submap])];
    let distance = |submap: usize| (place_of(submap).translation.vector - pose.translation.vector).norm();
    let mut near: Vec<(f64, usize)> = candidates.iter().map(|other| (distance(other.submap), other.submap)).collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let [place, yaw] = LEAST_WINDOW.map(|window| (window / WINDOW).powi(2));
    let covariance = Matrix3::from_diagonal(&Vector3::new(0.5 * place, 0.5 * place, yaw));
    let find_in = |(_, submap): (f64, usize)| {
        let mean = place_of(submap).inv_mul(pose);
        revisit.find_in(&Candidate { submap, covariance }, &mean, middle(own), &points)
    };
    near.into_iter().take(MAX_SEARCHED).filter_map(find_in).collect()
}
