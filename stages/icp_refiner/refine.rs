//! The whole of it: register, compare, judge.

use super::{
    Agreement, FirstGuess, IcpParameters, MapView, Refusal, Registration, Rival, best_rival, compare, register,
};

/// A refined alignment and the judgement on it.
#[derive(Clone, Debug, PartialEq)]
pub struct Refinement {
    /// How the maps were brought together.
    pub registration: Registration,
    /// What they say of each other there.
    pub agreement: Agreement,
    /// Where else they fit best, if that was looked for and anything was found.
    pub rival: Option<Rival>,
    /// Why the alignment may not be used; none if it may.
    pub refusal: Option<Refusal>,
}

impl Refinement {
    /// What speaks for the alignment, or against it, in plain words.
    pub fn reason(&self) -> String {
        match &self.refusal {
            Some(refusal) => refusal.to_string(),
            None => format!(
                "{:.0} m of wall agree and {:.0} m lie on free space, in {:.0} m2 that both maps know (acceptance \
                 index {:.3}); walls lie within {:.3} m of each other",
                self.agreement.wall_on_wall,
                self.agreement.wall_on_free,
                self.agreement.overlap,
                self.agreement.acceptance_index(),
                self.registration.mean_square_error.sqrt(),
            ),
        }
    }
}

/// Refines a first guess of `T_a_b` and judges the result.
pub fn refine(a: &MapView<'_>, b: &MapView<'_>, first_guess: &FirstGuess, parameters: &IcpParameters) -> Refinement {
    let registration = register(a.walls, b.walls, first_guess, parameters);
    let agreement = compare(a, b, &registration.transform_a_b, parameters);
    let refusal = Refusal::of(&registration, &agreement, parameters);
    Refinement { registration, agreement, rival: None, refusal }
}

/// Refines a first guess of `T_a_b` that rests on too little to be believed by itself, and judges whether the maps
/// confirm it: they must have more in common and agree better, and must not fit elsewhere nearly as well.
pub fn refine_provisional(
    a: &MapView<'_>,
    b: &MapView<'_>,
    first_guess: &FirstGuess,
    parameters: &IcpParameters,
) -> Refinement {
    let refinement = refine(a, b, first_guess, &parameters.for_provisional());
    if refinement.refusal.is_some() {
        return refinement;
    }
    let Registration { transform_a_b, centre, .. } = &refinement.registration;
    let rival = best_rival(a, b, transform_a_b, centre, parameters);
    let refusal = rival.as_ref().and_then(|rival| Refusal::by_rival(&refinement.agreement, rival, parameters));
    Refinement { rival, refusal, ..refinement }
}
