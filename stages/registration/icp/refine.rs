//! Registration and the check of its result.

use super::{IcpParameters, IcpRefusal, InitialGuess, Registration, register};
use crate::shared::walls::WallMap;

/// A refined alignment, and whether it may be used.
#[derive(Clone, Debug, PartialEq)]
pub struct RefinedAlignment {
    /// The registration.
    pub registration: Registration,
    /// Why the alignment may not be used; none if it may.
    pub refusal: Option<IcpRefusal>,
}

impl RefinedAlignment {
    /// Reason for or against the alignment, for the user.
    pub fn reason(&self) -> String {
        match &self.refusal {
            Some(refusal) => refusal.to_string(),
            None => format!("walls are aligned to {:.3} m", self.registration.mean_square_error.sqrt()),
        }
    }
}

/// Refines a first guess of `T_a_b`, and checks that the walls constrain the result. Whether the maps agree there is
/// judged by `merge_verifier`.
pub fn refine(a: &WallMap, b: &WallMap, initial_guess: &InitialGuess, parameters: &IcpParameters) -> RefinedAlignment {
    let registration = register(a, b, initial_guess, parameters);
    let refusal = IcpRefusal::of(&registration, parameters);
    RefinedAlignment { registration, refusal }
}
