//! The weights of the judgement. Written by `experiments fit-judgement`; do not edit.
//!
//! Fitted to 672 pairs of maps of 393 places that belong together, 336 of them simulated, and to 1421 pairs of different
//! buildings; `tests/experiments/README.md` has the command and what came of it.

/// The log-odds of a hypothesis of which nothing is known.
pub const INTERCEPT: f64 = -9.6131;
/// The weight of each term, in the order of [`Term::ALL`](super::Term::ALL).
pub const WEIGHTS: [f64; super::COUNT] = [
    1.1593,   // peak significance
    6.1597,   // margin over chance
    -1.0849,  // standard deviation of the position
    0.3861,   // inliers to walls through free space
    0.5633,   // common area
    3.1408,   // independent inliers
    2.3996,   // constraints in the weaker direction
    -15.9687, // local residual
    -4.4254,  // conflicts that are walls
    -7.1012,  // walls through free space
    -0.5677,  // deformation
];
/// The mean of each term over the right places of the fit.
pub const TYPICAL: [f64; super::COUNT] = [
    2.0456,  // peak significance
    0.4093,  // margin over chance
    -3.9435, // standard deviation of the position
    3.0377,  // inliers to walls through free space
    5.0521,  // common area
    0.7779,  // independent inliers
    1.5732,  // constraints in the weaker direction
    0.0509,  // local residual
    0.2469,  // conflicts that are walls
    0.0422,  // walls through free space
    0.6617,  // deformation
];
/// The log-odds of an alias against the place that it is an alias of: in any case, for the logarithm of the self-similar length
/// as a share of the inliers there, and for the log-likelihood ratio of the contradictions.
pub const ALIAS: [f64; 3] = [-0.2996, 0.6743, -0.4117];
