//! The weights of the judgement. Written by `experiments fit-judgement`; do not edit.

/// The log-odds of a hypothesis of which nothing is known.
pub const INTERCEPT: f64 = -5.2;
/// The weight of each term, in the order of [`Term::ALL`](super::Term::ALL).
pub const WEIGHTS: [f64; super::COUNT] = [0.83, 1.15, 2.8, 1.87, -21.0, -6.56, -13.73, -0.7, 0.18];
/// The mean of each term over the right places of the fit.
pub const TYPICAL: [f64; super::COUNT] = [6.0, 4.5, 0.75, 1.5, 0.06, 0.3, 0.1, 2.0, 9.0];
/// The log-odds of an alias against the place that it is an alias of: in any case, for the logarithm of the self-similar length as a
/// share of the inliers there, and for the log-likelihood ratio of the contradictions.
pub const ALIAS: [f64; 3] = [0.0, 3.0, -1.0];
