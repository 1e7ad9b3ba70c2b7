//! Whether maps bend at all, or lie as the rigid frames have them.

use super::ElasticRefinerParameters;
use super::body::Body;
use super::equations::{Equations, Solution};
use super::refine::Round;

/// Where maps bend little, what they are allowed is too much to be likely. So bends are tried that are less, by this share of the
/// deviations.
const LITTLE: f64 = 0.25;

/// How much likelier what walls say is if the maps bend than if they lie as the rigid frames have them, as a logarithm: the ratio
/// of the evidence of two linear models (MacKay 1992, "Bayesian interpolation"), the maps being allowed to bend as far as
/// `parameters` say, or a little, whichever is likelier. Above 0 the bend gains more than it costs. `None` if there is no number.
///
/// What walls say is what they said in the last round. They are taken to be as wrong as one cell in every half metre: as the
/// cells of a map round all of a wall alike, maps that are not bent must not seem so for it.
pub(super) fn gain(bodies: &[Body<'_>], last: &Round, parameters: &ElasticRefinerParameters) -> Option<f64> {
    let log_ratio = |of_deformations: &Equations, solution: &Solution| {
        Some(0.5 * (of_deformations.log_determinant()? - solution.log_determinant() + solution.explained))
    };
    let mut best = log_ratio(&last.of_deformations, &last.solution)?;
    // It is the sign that counts, and most maps that bend do so clearly.
    if best <= 0.0 {
        let little =
            ElasticRefinerParameters { bend: LITTLE * parameters.bend, turn: LITTLE * parameters.turn, ..*parameters };
        let of_deformations = Equations::of_deformations(bodies, &last.of_deformations.order, &little);
        let mut equations = of_deformations.clone();
        last.walls.iter().for_each(|contacts| contacts.add_to(&mut equations));
        best = best.max(log_ratio(&of_deformations, &equations.solve()?)?);
    }
    best.is_finite().then_some(best)
}
