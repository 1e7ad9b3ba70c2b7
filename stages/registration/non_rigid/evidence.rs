//! Evidence for the deformation of maps against rigid maps.

use super::DeformationParameters;
use super::body::Body;
use super::equations::{Equations, Solution};
use super::rounds::Round;

/// Where maps are deformed little, the prior is too wide to be likely. So smaller deformations are tried as well,
/// with this share of the standard deviations.
const LITTLE: f64 = 0.25;

/// Logarithm of the evidence ratio of deformed to rigid maps, for two linear models (MacKay 1992, "Bayesian
/// interpolation"), with the prior of `parameters` or a narrower one, whichever is likelier. Above 0 the deformation
/// gains more than it costs. `None` if it is not finite.
///
/// The walls are those of the last round. Their error is assumed to be one cell in every half metre: all of a wall is
/// rounded to cells alike, which must not look like a deformation.
pub(super) fn gain(bodies: &[Body<'_>], last: &Round, parameters: &DeformationParameters) -> Option<f64> {
    let log_ratio = |of_deformations: &Equations, solution: &Solution| {
        Some(0.5 * (of_deformations.log_determinant()? - solution.log_determinant() + solution.explained))
    };
    let mut best = log_ratio(&last.of_deformations, &last.solution)?;
    // Only the sign counts, and most deformed maps are clearly so.
    if best <= 0.0 {
        let little =
            DeformationParameters { bend: LITTLE * parameters.bend, turn: LITTLE * parameters.turn, ..*parameters };
        let of_deformations = Equations::of_deformations(bodies, &last.of_deformations.unknowns, &little);
        let mut equations = of_deformations.clone();
        last.walls.iter().for_each(|contacts| contacts.add_to(&mut equations));
        best = best.max(log_ratio(&of_deformations, &equations.solve()?)?);
    }
    best.is_finite().then_some(best)
}
