//! The weights of the judgement. Written by `experiments fit-judgement`; do not edit.
//!
//! Fitted to 432 pairs of maps of 153 places that belong together, 96 of them simulated, and to 1421 pairs of different
//! buildings; `tests/experiments/README.md` has the command and what came of it.

/// The log-odds of a hypothesis of which nothing is known.
pub const INTERCEPT: f64 = -9.2078;
/// The weight of each term, in the order of [`Term::ALL`](super::Term::ALL).
pub const WEIGHTS: [f64; super::COUNT] = [
    // peak significance
    1.9810,   // standard deviation of the place
    -1.0145,  // inliers to walls through free space
    0.6440,   // common area
    0.5609,   // independent inliers
    2.9236,   // constraints in the weaker direction
    2.4558,   // local residual
    -18.3810, // conflicts that are walls
    -4.9110,  // walls through free space
    -4.5298,  // deformation
    -0.5448,  // evidence of the walls
    0.0000,
];
/// The mean of each term over the right places of the fit.
pub const TYPICAL: [f64; super::COUNT] = [
    // peak significance
    2.5557,  // standard deviation of the place
    -3.8925, // inliers to walls through free space
    2.8169,  // common area
    4.8083,  // independent inliers
    0.7628,  // constraints in the weaker direction
    1.5654,  // local residual
    0.0519,  // conflicts that are walls
    0.2261,  // walls through free space
    0.0489,  // deformation
    0.9067,  // evidence of the walls
    9.5448,
];
/// The log-odds of an alias against the place that it is an alias of: in any case, for the logarithm of the self-similar length
/// as a share of the inliers there, and for the log-likelihood ratio of the contradictions.
pub const ALIAS: [f64; 3] = [-0.5820, 2.1808, -0.4193];
