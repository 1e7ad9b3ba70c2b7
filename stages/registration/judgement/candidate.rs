//! A place of map b that hypotheses propose, and what the maps say there.

use super::Terms;
use crate::registration::comparison::{Agreement, ComparisonParameters, Deformed, MapView, compare};
use crate::registration::{Basis, Hypothesis};
use crate::shared::geometry::{Point2, Pose2, point_jacobian};
use nalgebra::Matrix3;

/// Hypotheses whose middles lie within this many metres of each other, and that are turned by less than [`SAME_TURN`], are one place:
/// ICP leads what is so near to one place, unless the walls fit at both.
const SAME_PLACE: f64 = 0.3;
/// Radians.
const SAME_TURN: f64 = 0.2;
/// The inlier ratio from which on a deformation has nothing to explain.
const CLEAR_AGREEMENT: f64 = 0.95;

/// A place of map b that hypotheses propose, and what the maps say there.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// The hypothesis that stands for it.
    pub hypothesis: Hypothesis,
    /// Its number among all that were judged.
    pub number: usize,
    /// Others at the same place.
    pub others: Vec<Hypothesis>,
    /// The numbers of those.
    numbers: Vec<usize>,
    /// What the maps say, as map b is deformed if it is.
    pub agreement: Agreement,
    /// Where map b lies deformed, if that explains more than it costs.
    pub deformed: Option<Deformed>,
    /// The covariance of (x, y, yaw) that the deformation of the maps leaves, whether it is worth its cost or not; none if it was not
    /// looked at.
    pub left_by_deformation: Option<Matrix3<f64>>,
}

impl Candidate {
    /// Compares the maps at a hypothesis, as they came.
    pub(super) fn new(
        (number, hypothesis): (usize, &Hypothesis),
        a: &MapView<'_>,
        b: &MapView<'_>,
        parameters: &ComparisonParameters,
    ) -> Self {
        let agreement = compare(a, b, &hypothesis.transform_a_b, parameters);
        let hypothesis = hypothesis.clone();
        let (others, numbers) = (Vec::new(), Vec::new());
        Self { hypothesis, number, others, numbers, agreement, deformed: None, left_by_deformation: None }
    }

    /// The same with map b deformed, where that can explain what contradicts.
    pub(super) fn deform(mut self, a: &MapView<'_>, b: &MapView<'_>, parameters: &ComparisonParameters) -> Self {
        let is_worth_it = parameters.bend > 0.0
            && !self.hypothesis.is_refused
            && self.agreement.evidence > 0.0
            && self.agreement.inlier_ratio() < CLEAR_AGREEMENT;
        let deformed = is_worth_it.then(|| Deformed::new(a, b, &self.hypothesis.transform_a_b, parameters)).flatten();
        self.left_by_deformation = deformed.map(|deformed| deformed.covariance);
        self.deformed =
            deformed.filter(|deformed| deformed.agreement.evidence - deformed.cost > self.agreement.evidence);
        self.agreement = self.deformed.map_or(self.agreement, |deformed| deformed.agreement);
        self
    }

    /// This and another one at the same place as one. What was proposed and not refused stands for it, of two such the first.
    pub(super) fn unite(&mut self, mut other: Self) {
        let rank = |candidate: &Self| (candidate.hypothesis.is_refused, candidate.hypothesis.is_rival);
        if rank(&other) < rank(self) {
            std::mem::swap(self, &mut other);
        }
        self.others.push(other.hypothesis);
        self.others.append(&mut other.others);
        self.numbers.push(other.number);
        self.numbers.append(&mut other.numbers);
    }

    /// Whether the hypothesis of a number proposes the place.
    pub(super) fn has(&self, number: usize) -> bool {
        self.number == number || self.numbers.contains(&number)
    }

    /// Where map b lies: `T_a_b`.
    pub fn transform_a_b(&self) -> Pose2 {
        self.deformed.map_or(self.hypothesis.transform_a_b, |deformed| deformed.transform_a_b)
    }

    /// All hypotheses at the place.
    fn hypotheses(&self) -> impl Iterator<Item = &Hypothesis> {
        std::iter::once(&self.hypothesis).chain(&self.others)
    }

    /// Whether a condition holds for the basis of any hypothesis at the place.
    pub(super) fn rests_on(&self, is_meant: impl Fn(Basis) -> bool) -> bool {
        self.hypotheses().any(|hypothesis| !hypothesis.is_refused && is_meant(hypothesis.basis))
    }

    /// The values of the terms of the sum.
    pub fn terms(&self) -> Terms {
        let significance = self.hypotheses().filter_map(|hypothesis| match hypothesis.basis {
            Basis::Search { significance } => Some(significance),
            Basis::Tags | Basis::FewTags | Basis::Unknown => None,
        });
        let cost = self.deformed.map_or(0.0, |deformed| deformed.cost);
        Terms::new(significance.fold(0.0, f64::max), self.deviation(), &self.agreement, cost)
    }

    /// The standard deviation of the middle of the inliers in its least known direction, metres.
    fn deviation(&self) -> f64 {
        let Hypothesis { transform_a_b, covariance, .. } = &self.hypothesis;
        let jacobian = point_jacobian(transform_a_b, &(transform_a_b.inverse() * self.agreement.centre));
        let of_centre = jacobian * covariance * jacobian.transpose();
        let (mean, half) = (0.5 * (of_centre.m11 + of_centre.m22), 0.5 * (of_centre.m11 - of_centre.m22));
        let widest = (mean + half.hypot(of_centre.m12)).sqrt();
        // What is no number is not known.
        if widest.is_finite() { widest } else { f64::INFINITY }
    }

    /// How far another place is: the shift of the middle of the inliers, metres, and the turn, radians.
    pub(super) fn change(&self, other: &Pose2) -> (f64, f64) {
        let change = other * self.transform_a_b().inverse();
        let centre: Point2 = self.agreement.centre;
        ((change * centre - centre).norm(), change.rotation.angle())
    }

    /// Whether another place is the same.
    pub(super) fn is_at(&self, other: &Pose2) -> bool {
        let (shift, turn) = self.change(other);
        shift < SAME_PLACE && turn.abs() < SAME_TURN
    }
}
