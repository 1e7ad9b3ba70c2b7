//! The whole of it: register, and judge the registration.

use super::{FirstGuess, IcpParameters, IcpRefusal, Registration, register};
use crate::shared::walls::WallMap;

/// A refined alignment and the judgement on it.
#[derive(Clone, Debug, PartialEq)]
pub struct Refinement {
    /// How the maps were brought together.
    pub registration: Registration,
    /// Why the alignment may not be used; none if it may.
    pub refusal: Option<IcpRefusal>,
}

impl Refinement {
    /// What speaks for the alignment, or against it, in plain words.
    pub fn reason(&self) -> String {
        match &self.refusal {
            Some(refusal) => refusal.to_string(),
            None => format!("walls lie within {:.3} m of each other", self.registration.mean_square_error.sqrt()),
        }
    }
}

/// Refines a first guess of `T_a_b` and judges whether it has come to a place that the walls fix. Whether the maps agree
/// there is another question, which `merge_verifier` answers.
pub fn refine(a: &WallMap, b: &WallMap, first_guess: &FirstGuess, parameters: &IcpParameters) -> Refinement {
    let registration = register(a, b, first_guess, parameters);
    let refusal = IcpRefusal::of(&registration, parameters);
    Refinement { registration, refusal }
}
