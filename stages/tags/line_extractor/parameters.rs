//! Parameters of the line extractor.

use gridweave_runtime::stage::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the two points of a line are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Sampling {
    /// The second near the first, so that both are likely to be on the same wall.
    #[default]
    Local,
    /// Both anywhere (the paper).
    Uniform,
}

/// Which lines count as walls.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Scoring {
    /// Those with a stretch without a gap of `min_points` points and a length of `min_length`. Only these points are
    /// removed.
    #[default]
    Points,
    /// Those with `min_share` of all points, all of which are removed (the paper).
    Percentage,
}

/// How the final line of a segment is fitted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Fit {
    /// All faces of a wall at once, robustly: a wall may have been seen from both sides, and furniture stands at it.
    #[default]
    Faces,
    /// Total least squares over all occupied cells of the segment.
    LeastSquares,
    /// The line through the two farthest members (the paper).
    Ends,
}

/// Parameters of `line_extractor`. The paper's cell (px) is 0.02 m.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LineExtractorParameters {
    /// How the two points of a line are drawn: `local` (the second near the first) or `uniform` (the paper).
    pub sampling: Sampling,
    /// Largest distance of the two points of `local` sampling, metres.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub sampling_radius: f64,
    /// Which lines count as walls: `points` or `percentage` (the paper).
    pub scoring: Scoring,
    /// How the final line of a segment is fitted: `faces`, `least_squares` or `ends` (the paper).
    pub fit: Fit,
    /// Most occupied cells that are searched for lines (the set P): of more, a random sample; the lines found are
    /// then fitted to all cells.
    #[schemars(range(min = 2))]
    pub max_points: usize,
    /// Largest distance of inliers from a line (D_line), metres; never less than three quarters of a cell, the width
    /// of a straight wall of single cells. Paper: 2 px.
    #[schemars(range(max = 10.0), extend("exclusiveMinimum" = 0))]
    pub inlier_distance: f64,
    /// Least number of points of a wall under `points` scoring.
    #[schemars(range(min = 2))]
    pub min_points: usize,
    /// Least share of all points on a line under `percentage` scoring (T_perc). Paper: 0.15.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_share: f64,
    /// The search ends when less than this share of the points is left (T_final). Paper: 0.5.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub stop_share: f64,
    /// Number of lines of which the best is chosen, each time. Paper: 1, the first that suffices is taken.
    #[schemars(range(min = 1))]
    pub candidates: usize,
    /// The search ends after this many choices in a row without a wall (`points` scoring).
    #[schemars(range(min = 1))]
    pub patience: usize,
    /// Most lines drawn in all. Under `percentage` scoring the best line so far is then kept.
    #[schemars(range(min = 1))]
    pub max_iterations: usize,
    /// Largest distance of neighbouring inliers; a line is broken at larger gaps (D_s), metres. Paper: 30 px.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_gap: f64,
    /// Largest angle between segments that may be merged (T_theta), radians. The paper gives no value.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub merge_angle: f64,
    /// Largest distance of the nearest ends of segments that may be merged (T_j), metres; they are merged if one line
    /// then has both within `inlier_distance`. 0 merges none. The paper gives no value.
    #[schemars(range(min = 0.0))]
    pub merge_distance: f64,
    /// Least length of a segment (T_len), metres. Paper: 30 px.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub min_length: f64,
    /// Least mean occupancy of a segment. Paper: 0.6.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_reliability: f64,
}

impl Default for LineExtractorParameters {
    fn default() -> Self {
        Self {
            sampling: Sampling::Local,
            sampling_radius: 0.5,
            scoring: Scoring::Points,
            fit: Fit::Faces,
            max_points: 10_000,
            inlier_distance: 0.08,
            min_points: 12,
            min_share: 0.15,
            stop_share: 0.05,
            candidates: 8,
            patience: 25,
            max_iterations: 20_000,
            max_gap: 0.6,
            merge_angle: 0.05,
            merge_distance: 0.3,
            min_length: 0.6,
            min_reliability: 0.6,
        }
    }
}

impl Parameters for LineExtractorParameters {}
