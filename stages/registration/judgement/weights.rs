//! The weights of the judgement. Written by `experiments fit-judgement`; do not edit.
//!
//! Fitted to 672 pairs of maps of 393 places that belong together, 336 of them simulated, and to 1421 pairs of different
//! buildings; `tests/experiments/README.md` has the command and what came of it.

/// The log-odds of a hypothesis of which nothing is known.
pub const INTERCEPT: f64 = -8.0351;
/// The weight of each term, in the order of [`Term::ALL`](super::Term::ALL).
pub const WEIGHTS: [f64; super::COUNT] = [
    1.3955,  // peak significance
    5.8997,  // margin over chance
    -0.6553, // standard deviation of the position
    0.3722,  // common area
    2.3004,  // independent inliers
    1.6493,  // constraints in the weaker direction
    -7.7551, // local residual
    -2.5829, // conflicts that are walls
    0.8771,  // furniture and pillars
    2.6753,  // short pieces of wall
    -0.4712, // deformation
];
/// The mean of each term over the right places of the fit.
pub const TYPICAL: [f64; super::COUNT] = [
    2.0456,  // peak significance
    0.4093,  // margin over chance
    -3.9435, // standard deviation of the position
    5.0521,  // common area
    0.7779,  // independent inliers
    1.5732,  // constraints in the weaker direction
    0.0509,  // local residual
    0.2469,  // conflicts that are walls
    0.5838,  // furniture and pillars
    1.0261,  // short pieces of wall
    0.6617,  // deformation
];
/// The log-odds of an alias against the place that it is an alias of: in any case, for how many times its
/// length self-similarity leaves unexplained of the inliers, for the log-likelihood ratio of the contradictions, and for the
/// details that agree there and not here.
pub const ALIAS: [f64; 4] = [-0.4233, 0.5446, -0.2315, 1.1098];
