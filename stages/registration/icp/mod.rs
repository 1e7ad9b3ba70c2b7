//! Refines the alignment of two maps by ICP on their walls (Tsardoulias et al., section 4.3).
//!
//! [`register`] moves map b until its walls are aligned with those of map a, where both are near each other;
//! [`IcpRefusal`] is the reason why the result may not be used. [`refine`] does both.

mod initial_guess;
mod iteration;
mod normal_equations;
mod parameters;
mod refine;
mod refusal;
mod registration;

#[cfg(test)]
mod tests;

pub use initial_guess::InitialGuess;
pub use parameters::{IcpParameters, Metric, Weighting};
pub use refine::{RefinedAlignment, refine};
pub use refusal::IcpRefusal;
pub use registration::{Registration, register};
