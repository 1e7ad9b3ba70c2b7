//! Deforms all maps together, and says how certain that is.

use super::DeformationParameters;
use super::body::Body;
use super::contacts::DeformedBody;
use super::drift::{Drift, drift};
use super::equations::deformation_cost;
use super::evidence::gain;
use super::rounds::{Estimate, estimate};
use crate::shared::deformation::Deformation;
use nalgebra::Matrix3;

/// Deformation of one map.
#[derive(Clone, Debug)]
pub struct RefinedMap {
    /// The deformation.
    pub deformation: Deformation,
    /// Covariance of each node: (x, y, turn), metres and radians.
    pub covariances: Vec<Matrix3<f64>>,
    /// Length of its walls on walls of others, metres.
    pub wall_matched: f64,
    /// Cost of the deformation: the logarithm of how much likelier none is, half the squared deformations between
    /// neighbouring nodes in standard deviations.
    pub cost: f64,
    /// Drift of the map; none if its walls constrain it too little.
    pub drift: Option<Drift>,
    /// Whether the deformation was known before, and stayed: nothing else is then known of the map.
    pub is_held: bool,
}

/// Deformations of all maps.
#[derive(Clone, Debug)]
pub struct Refinement {
    /// One for each body.
    pub maps: Vec<RefinedMap>,
    /// Logarithm of the evidence ratio of deformed to rigid maps. If it is not above 0, `maps` fits the noise of
    /// walls.
    pub gain: f64,
    /// Whether it depends on deformations that were known before.
    pub started_from_known: bool,
}

impl Refinement {
    /// The deformations if the evidence supports them; else none, with the same covariances, but for maps that are
    /// held.
    #[must_use]
    pub fn if_supported(self) -> Vec<RefinedMap> {
        if self.gain > 0.0 { self.maps } else { self.maps.into_iter().map(RefinedMap::undeformed).collect() }
    }
}

impl RefinedMap {
    fn undeformed(self) -> Self {
        if self.is_held {
            return self;
        }
        let deformation = Deformation::none(self.deformation.lattice);
        Self { deformation, cost: 0.0, drift: None, ..self }
    }
}

/// Deforms placed maps so that walls that several of them have are aligned. `None` if the equations have no solution,
/// because numbers are too large.
pub fn refine(bodies: &[Body<'_>], parameters: &DeformationParameters) -> Option<Refinement> {
    let Estimate { bodies: deformed, started_from_known, last } = estimate(bodies, parameters)?;
    let gain = gain(bodies, &last, parameters)?;
    let covariances = last.solution.covariances();
    let refined = |((body, wall_matched), is_held): ((DeformedBody<'_>, f64), bool)| {
        let DeformedBody { deformation, first, .. } = body;
        RefinedMap {
            covariances: (first..first + deformation.moves.len()).map(|node| covariances.of(node, node)).collect(),
            cost: deformation_cost(&deformation, parameters),
            drift: drift(&deformation, first, &covariances, parameters),
            deformation,
            wall_matched,
            is_held,
        }
    };
    let is_held = bodies.iter().map(Body::is_held);
    let maps = deformed.into_iter().zip(last.matched).zip(is_held).map(refined).collect();
    Some(Refinement { maps, gain, started_from_known })
}

/// Deforms a map onto a fixed one, and returns its deformation with the cost of it, as [`RefinedMap::cost`].
pub fn deform_onto(fixed: &Body<'_>, map: &Body<'_>, parameters: &DeformationParameters) -> Option<(Deformation, f64)> {
    let bodies = [fixed.clone().kept(), map.clone()];
    let DeformedBody { deformation, .. } = estimate(&bodies, parameters)?.bodies.pop()?;
    let cost = deformation_cost(&deformation, parameters);
    Some((deformation, cost))
}
