//! The weights of the judgement. Written by `experiments fit-judgement`; do not edit.
//!
//! Fitted to 432 pairs of maps of 153 places that belong together, 96 of them simulated, and to 1421 pairs of different
//! buildings; `tests/experiments/README.md` has the command and what came of it.

/// The log-odds of a hypothesis of which nothing is known.
pub const INTERCEPT: f64 = -9.2078;
/// The weight of each term, in the order of [`Term::ALL`](super::Term::ALL).
pub const WEIGHTS: [f64; super::COUNT] = [
    1.9810,   // peak significance
    -1.0145,  // standard deviation of the position
    0.6440,   // inliers to walls through free space
    0.5609,   // common area
    2.9236,   // independent inliers
    2.4558,   // constraints in the weaker direction
    -18.3810, // local residual
    -4.9110,  // conflicts that are walls
    -4.5298,  // walls through free space
    -0.5448,  // deformation
];
/// The mean of each term over the right places of the fit.
pub const TYPICAL: [f64; super::COUNT] = [
    2.5557,  // peak significance
    -3.8925, // standard deviation of the position
    2.8169,  // inliers to walls through free space
    4.8083,  // common area
    0.7628,  // independent inliers
    1.5654,  // constraints in the weaker direction
    0.0519,  // local residual
    0.2261,  // conflicts that are walls
    0.0489,  // walls through free space
    0.9067,  // deformation
];
/// The log-odds of an alias against the place that it is an alias of: in any case, for the logarithm of the self-similar length
/// as a share of the inliers there, and for the log-likelihood ratio of the contradictions.
pub const ALIAS: [f64; 3] = [-0.5820, 2.1808, -0.4193];
