//! The parameters of the line extractor.

use gridweave_runtime::stage::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the two points are drawn that make a line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Sampling {
    /// The second near the first, so that both are likely to lie on the same wall.
    #[default]
    Local,
    /// Both anywhere (the paper).
    Uniform,
}

/// When a line counts as a wall.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Scoring {
    /// When a stretch of it without a gap holds `min_points` points and is `min_length` long. Only these points are
    /// taken out.
    #[default]
    Points,
    /// When it holds `min_share` of all points, all of which are taken out (the paper).
    Percentage,
}

/// How the final line of a segment is found.
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

/// The parameters of `line_extractor`. The paper's cell (px) is 0.02 m.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LineExtractorParameters {
    /// How the two points are drawn that make a line: `local` (the second near the first) or `uniform` (the paper).
    pub sampling: Sampling,
    /// How far apart the two points of `local` sampling may be, metres.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub sampling_radius: f64,
    /// When a line counts as a wall: `points` or `percentage` (the paper).
    pub scoring: Scoring,
    /// How the final line of a segment is found: `faces`, `least_squares` or `ends` (the paper).
    pub fit: Fit,
    /// Of more occupied cells than these a random part is searched for lines (the set P); the lines found are then
    /// fitted to all cells.
    #[schemars(range(min = 2))]
    pub max_points: usize,
    /// Cells nearer to a line than this are its members (D_line), metres; never less than three quarters of a cell,
    /// which a straight wall of single cells takes up. Paper: 2 px.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub inlier_distance: f64,
    /// Points that a wall must hold under `points` scoring.
    #[schemars(range(min = 2))]
    pub min_points: usize,
    /// Share of all points that a line must hold under `percentage` scoring (T_perc). Paper: 0.15.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_share: f64,
    /// The search ends when less than this share of the points is left (T_final). Paper: 0.5.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub stop_share: f64,
    /// Lines drawn to choose the best of, each time. Paper: 1, the first that suffices is taken.
    #[schemars(range(min = 1))]
    pub candidates: usize,
    /// The search ends after this many choices in a row that gave no wall (`points` scoring).
    #[schemars(range(min = 1))]
    pub patience: usize,
    /// Lines drawn in all, at most. Under `percentage` scoring the best line so far is kept when they are spent.
    #[schemars(range(min = 1))]
    pub max_iterations: usize,
    /// A line is broken where neighbouring members are farther apart than this (D_s), metres. Paper: 30 px.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_gap: f64,
    /// Segments whose directions differ by less than this may be merged (T_theta), radians. The paper gives no value.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub merge_angle: f64,
    /// Segments whose nearest ends are nearer than this may be merged (T_j), metres; they are if one line then has
    /// both within `inlier_distance`. 0 merges none. The paper gives no value.
    #[schemars(range(min = 0.0))]
    pub merge_distance: f64,
    /// Shorter segments are dropped (T_len), metres. Paper: 30 px.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub min_length: f64,
    /// Segments whose mean occupancy is below this are dropped. Paper: 0.6.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_are_in_range() {
        assert_eq!(LineExtractorParameters::default().check(), []);
    }

    #[test]
    fn every_value_out_of_range_is_reported() {
        let parameters = LineExtractorParameters {
            sampling_radius: f64::NAN,
            max_points: 1,
            inlier_distance: 0.0,
            min_points: 0,
            min_share: 1.5,
            stop_share: -0.1,
            candidates: 0,
            patience: 0,
            max_iterations: 0,
            max_gap: -1.0,
            merge_angle: 2.0,
            merge_distance: f64::INFINITY,
            min_length: 0.0,
            min_reliability: f64::NAN,
            ..Default::default()
        };
        assert_eq!(parameters.check().len(), 14);
    }
}
