//! The weights of the judgement. Written by `experiments fit-judgement`; do not edit.
//!
//! Fitted to 1060 pairs of maps of 587 places that belong together, 724 of them simulated, and to 1809 pairs of different
//! buildings; `tests/experiments/README.md` has the command and what came of it.

/// The log-odds of a hypothesis of which nothing is known.
pub const INTERCEPT: f64 = -8.8332;
/// The weight of each term, in the order of [`Term::ALL`](super::Term::ALL).
pub const WEIGHTS: [f64; super::COUNT] = [
    1.2897,  // peak significance
    6.0846,  // margin over chance
    -0.7533, // standard deviation of the position
    0.7437,  // common area
    1.7289,  // constraints in the weaker direction
    -2.1361, // walls in conflict
    1.3930,  // short pieces of wall
    -0.5592, // things on open floor
];
/// The mean of each term over the right places of the fit.
pub const TYPICAL: [f64; super::COUNT] = [
    1.7583,  // peak significance
    0.3472,  // margin over chance
    -3.9594, // standard deviation of the position
    5.1036,  // common area
    2.0354,  // constraints in the weaker direction
    0.3940,  // walls in conflict
    1.1603,  // short pieces of wall
    0.4902,  // things on open floor
];
/// The log-odds of an alias against the place that it is an alias of: in any case, for how many times its
/// length self-similarity leaves unexplained of the inliers, for the log-likelihood ratio of the contradictions, and for the
/// details that agree there and not here.
pub const ALIAS: [f64; 4] = [-0.0932, 0.1026, -0.4223, 0.2158];
