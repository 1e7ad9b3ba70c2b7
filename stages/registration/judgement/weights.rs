//! The weights of the judgement. Written by `experiments fit-judgement`; do not edit.
//!
//! Fitted to 672 pairs of maps of 393 places that belong together, 336 of them simulated, and to 1421 pairs of different
//! buildings; `tests/experiments/README.md` has the command and what came of it.

/// The log-odds of a hypothesis of which nothing is known.
pub const INTERCEPT: f64 = -8.9758;
/// The weight of each term, in the order of [`Term::ALL`](super::Term::ALL).
pub const WEIGHTS: [f64; super::COUNT] = [
    1.5499,  // peak significance
    4.1420,  // margin over chance
    -0.8750, // standard deviation of the position
    0.6563,  // common area
    1.8857,  // constraints in the weaker direction
    -2.3526, // walls in conflict
    2.7795,  // short pieces of wall
    -0.3442, // deformation
];
/// The mean of each term over the right places of the fit.
pub const TYPICAL: [f64; super::COUNT] = [
    2.0455,  // peak significance
    0.4093,  // margin over chance
    -3.9435, // standard deviation of the position
    5.0519,  // common area
    2.0128,  // constraints in the weaker direction
    0.3990,  // walls in conflict
    1.0230,  // short pieces of wall
    0.6478,  // deformation
];
/// The log-odds of an alias against the place that it is an alias of: in any case, for how many times its
/// length self-similarity leaves unexplained of the inliers, for the log-likelihood ratio of the contradictions, and for the
/// details that agree there and not here.
pub const ALIAS: [f64; 4] = [-0.3650, 0.5174, -0.2335, 1.0756];
