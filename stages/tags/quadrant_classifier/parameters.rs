//! Parameters of the quadrant classifier.

use gridweave_runtime::stage::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the directions of many walls are averaged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Mean {
    /// Weighted mean of four times the angle, around its mode: walls far from it count little or nothing.
    #[default]
    Circular,
    /// The mean of the two groups' weighted means (the paper).
    Groups,
}

/// Weight of a wall.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Weighting {
    /// Length x reliability.
    #[default]
    Length,
    /// Reliability over the variance of its direction, which falls with the square of its length: the
    /// minimum-variance mean.
    Precision,
    /// Length x (1 - reliability), as equation 4 is printed. The paper calls a reliability near 1 ideal, so this is
    /// probably a misprint; a wall of reliability 1 counts nothing.
    #[serde(rename = "equation_4")]
    Equation4,
}

/// Source of the rotation between two maps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RotationFrom {
    /// The directions of the maps, with the quarter turn from the tags (the paper's methods 2 and 3).
    #[default]
    Directions,
    /// The tags only (the paper's method 1).
    Tags,
    /// The mean of the two, weighted by the inverse of their variances.
    Both,
}

/// How the rotation is computed from the tags.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TagRotationFrom {
    /// Weighted least squares fit of all common tags.
    #[default]
    LeastSquares,
    /// The direction from the middle of the two best tags to the third: equations 5 and 6 (the paper).
    Triplet,
}

/// Which tags determine the translation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TranslationFrom {
    /// All common tags, weighted by the inverse of their covariances.
    #[default]
    AllTags,
    /// The best tag only: equation 8 (the paper's methods 2 and 3).
    BestTag,
    /// The centroid of the three best tags (the paper's method 1).
    Triplet,
}

/// Parameters of `quadrant_classifier`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct QuadrantClassifierParameters {
    /// How the directions of many walls are averaged: `circular` or `groups` (the paper).
    pub mean: Mean,
    /// Weight of a wall: `length` (length x reliability), `precision` (reliability over the variance of its
    /// direction, which is the most accurate) or `equation_4` (as printed in the paper).
    pub weighting: Weighting,
    /// Source of the rotation between two maps: `directions`, `tags` (the paper's method 1) or `both`. For maps
    /// without a direction, or whose directions contradict the tags, it is the tags in any case.
    pub rotation: RotationFrom,
    /// How the rotation is computed from the tags: `least_squares` or `triplet` (the paper).
    pub tag_rotation: TagRotationFrom,
    /// Which tags determine the translation: `all_tags`, `best_tag` (the paper) or `triplet` (the paper's method 1).
    pub translation: TranslationFrom,
    /// A wall within this angle of the map's direction, or of its perpendicular, agrees with it, radians. Others have
    /// no weight in the `circular` mean.
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 0.5))]
    pub tolerance: f64,
    /// Least share of the wall length that agrees with a map's direction. Walls of random directions give tolerance /
    /// 45 degrees, 0.11 by default.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_agreement: f64,
    /// Least length of walls that agree with a map's direction, metres.
    #[schemars(range(min = 0.0))]
    pub min_wall_length: f64,
    /// Standard deviation of the ends of a wall across it, metres: about half a cell. It bounds the accuracy of the
    /// direction of a short wall.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub end_deviation: f64,
    /// Standard deviation of a wall's direction at any length, radians: walls are not quite straight, nor quite at
    /// right angles. With `end_deviation` it is the deviation of each wall's direction; outliers by that measure have
    /// no weight in the `circular` mean.
    #[schemars(range(min = 0.0))]
    pub wall_deviation: f64,
    /// Standard deviation of a map's direction with any number of walls, radians: maps are deformed, and corners are
    /// not square.
    #[schemars(range(min = 0.0))]
    pub min_deviation: f64,
    /// Standard deviation of a tag's position in one map that is added to that of its estimate, metres.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub tag_deviation: f64,
    /// Largest standard deviation of the rotation from tags, radians: a greater one does not determine the quarter
    /// turn, and the maps are not aligned.
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 0.25))]
    pub max_tag_rotation_deviation: f64,
    /// Directions contradict the tags when the two rotations differ by more than three joint standard deviations and
    /// this angle, radians.
    #[schemars(range(min = 0.0))]
    pub contradiction_angle: f64,
    /// Directions contradict the tags in any case when the two rotations differ by more than this, radians: at 45
    /// degrees the quarter turn is random. The paper has no such bounds; 0.8 for this one and for
    /// `contradiction_angle` disables them.
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 0.8))]
    pub max_contradiction: f64,
    /// Two common tags, or more that may agree by chance, count only if the directions of both maps do not contradict
    /// them, and could have: if the bound on the difference of the two rotations (see `contradiction_angle`) is at
    /// most this angle, radians. The next quarter turn is then dozens of standard deviations away.
    #[schemars(range(min = 0.0))]
    pub max_confirming_angle: f64,
    /// Whether a single common tag gives a hypothesis for each quarter turn. They are provisional: `merge_verifier`
    /// must find one of them right, or another source must have found it, too.
    pub single_tag: bool,
    /// Least certainty of a single tag in both maps.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub single_tag_certainty: f64,
    /// Largest root mean square of the tags' residuals, metres, or twice what their covariances make likely, if that is
    /// more; else the maps are not aligned.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_residual: f64,
    /// A pair's alignment is sent again when it has moved by more than this, metres, or one of its maps has changed.
    #[schemars(range(min = 0.0))]
    pub resend_distance: f64,
    /// A pair's alignment is sent again when it has turned by more than this, radians, or one of its maps has changed.
    #[schemars(range(min = 0.0))]
    pub resend_angle: f64,
}

impl Default for QuadrantClassifierParameters {
    fn default() -> Self {
        Self {
            mean: Mean::Circular,
            weighting: Weighting::Length,
            rotation: RotationFrom::Directions,
            tag_rotation: TagRotationFrom::LeastSquares,
            translation: TranslationFrom::AllTags,
            tolerance: 5_f64.to_radians(),
            min_agreement: 0.35,
            min_wall_length: 2.0,
            end_deviation: 0.02,
            wall_deviation: 0.002,
            min_deviation: 0.002,
            tag_deviation: 0.03,
            max_tag_rotation_deviation: 0.2,
            contradiction_angle: 0.01,
            max_contradiction: 30_f64.to_radians(),
            max_confirming_angle: 0.12,
            single_tag: false,
            single_tag_certainty: 0.9,
            max_residual: 0.5,
            resend_distance: 0.001,
            resend_angle: 0.0001,
        }
    }
}

impl Parameters for QuadrantClassifierParameters {}
