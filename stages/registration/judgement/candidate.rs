//! A candidate: hypotheses at one relative pose, and the agreement of the maps there.

use super::Terms;
use crate::registration::comparison::{Agreement, ComparisonParameters, Deformed};
use crate::registration::{Basis, Hypothesis};
use crate::shared::geometry::{Point2, Pose2, point_jacobian};
use nalgebra::Matrix3;

/// Hypotheses whose inliers are shifted by less than this, metres, and turned by less than [`SAME_TURN`] count as
/// one: ICP converges from either to the same pose, unless the walls fit at both.
const SAME_POSITION: f64 = 0.3;
/// Radians.
const SAME_TURN: f64 = 0.2;
/// Inlier ratio above which a deformation has nothing to explain.
const CLEAR_AGREEMENT: f64 = 0.95;

/// Hypotheses at one relative pose, and the agreement of the maps there.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// The hypothesis that represents the candidate.
    pub hypothesis: Hypothesis,
    /// Its index among all that were judged.
    pub number: usize,
    /// Further hypotheses at the same pose.
    pub others: Vec<Hypothesis>,
    /// Indices of those.
    numbers: Vec<usize>,
    /// Agreement of the maps, with map b deformed if `deformed` is given.
    pub agreement: Agreement,
    /// Deformation of map b, if it explains more than it costs.
    pub deformed: Option<Deformed>,
    /// Covariance of (x, y, yaw) that the deformation of the maps leaves, whether it is worth its cost or not; none
    /// if it was not computed.
    pub left_by_deformation: Option<Matrix3<f64>>,
}

impl Candidate {
    /// A hypothesis at which the maps agree so much, without deformation.
    pub(super) fn new((number, hypothesis): (usize, &Hypothesis), agreement: Agreement) -> Self {
        let hypothesis = hypothesis.clone();
        let (others, numbers) = (Vec::new(), Vec::new());
        Self { hypothesis, number, others, numbers, agreement, deformed: None, left_by_deformation: None }
    }

    /// Whether a deformation of map b can explain contradictions.
    pub(super) fn is_worth_deforming(&self, parameters: &ComparisonParameters) -> bool {
        parameters.bend > 0.0
            && !self.hypothesis.is_refused
            && self.agreement.evidence > 0.0
            && self.agreement.inlier_ratio() < CLEAR_AGREEMENT
    }

    /// Applies a deformation of map b, if it explains more than it costs.
    pub(super) fn deform(mut self, deformed: Option<Deformed>) -> Self {
        self.left_by_deformation = deformed.map(|deformed| deformed.covariance);
        self.deformed =
            deformed.filter(|deformed| deformed.agreement.evidence - deformed.cost > self.agreement.evidence);
        self.agreement = self.deformed.map_or(self.agreement, |deformed| deformed.agreement);
        self
    }

    /// Merges a candidate at the same pose into this one. It is represented by what was proposed and not refused, of
    /// two such by the first.
    pub(super) fn unite(&mut self, mut other: Self) {
        let rank = |candidate: &Self| (candidate.hypothesis.is_refused, candidate.hypothesis.is_alternative_only);
        if rank(&other) < rank(self) {
            std::mem::swap(self, &mut other);
        }
        self.others.push(other.hypothesis);
        self.others.append(&mut other.others);
        self.numbers.push(other.number);
        self.numbers.append(&mut other.numbers);
    }

    /// Whether it includes the hypothesis with an index.
    pub(super) fn has(&self, number: usize) -> bool {
        self.number == number || self.numbers.contains(&number)
    }

    /// Pose of map b in map a, `T_a_b`.
    pub fn transform_a_b(&self) -> Pose2 {
        self.deformed.map_or(self.hypothesis.transform_a_b, |deformed| deformed.transform_a_b)
    }

    /// All hypotheses of the candidate.
    fn hypotheses(&self) -> impl Iterator<Item = &Hypothesis> {
        std::iter::once(&self.hypothesis).chain(&self.others)
    }

    /// Whether a condition holds for the basis of any hypothesis that is not refused.
    pub(super) fn rests_on(&self, is_meant: impl Fn(Basis) -> bool) -> bool {
        self.hypotheses().any(|hypothesis| !hypothesis.is_refused && is_meant(hypothesis.basis))
    }

    /// Values of the terms of the sum.
    pub fn terms(&self) -> Terms {
        let peaks = self.hypotheses().filter_map(|hypothesis| match hypothesis.basis {
            Basis::Search { significance, margin } => Some((significance, margin)),
            Basis::Tags | Basis::FewTags | Basis::Unknown => None,
        });
        let highest = |one: (f64, f64), other: (f64, f64)| (one.0.max(other.0), one.1.max(other.1));
        Terms::new(peaks.fold((0.0, 0.0), highest), self.deviation(), &self.agreement)
    }

    /// Largest standard deviation of the centroid of the inliers over all directions, metres.
    fn deviation(&self) -> f64 {
        let Hypothesis { transform_a_b, covariance, .. } = &self.hypothesis;
        let jacobian = point_jacobian(transform_a_b, &(transform_a_b.inverse() * self.agreement.centre));
        let of_centre = jacobian * covariance * jacobian.transpose();
        let (mean, half) = (0.5 * (of_centre.m11 + of_centre.m22), 0.5 * (of_centre.m11 - of_centre.m22));
        let widest = (mean + half.hypot(of_centre.m12)).sqrt();
        // A value that is not a number counts as unknown.
        if widest.is_finite() { widest } else { f64::INFINITY }
    }

    /// Shift of the centroid of the inliers to another relative pose, metres, and the turn, radians.
    pub(super) fn change(&self, other: &Pose2) -> (f64, f64) {
        let change = other * self.transform_a_b().inverse();
        let centre: Point2 = self.agreement.centre;
        ((change * centre - centre).norm(), change.rotation.angle())
    }

    /// Whether another relative pose counts as the same.
    pub(super) fn is_at(&self, other: &Pose2) -> bool {
        let (shift, turn) = self.change(other);
        shift < SAME_POSITION && turn.abs() < SAME_TURN
    }
}
