//! The parameters of the quadrant classifier.

use gridweave_runtime::stage::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the directions of many walls become one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Mean {
    /// The weighted mean of four times the angle, round its mode: walls far from it count little or nothing.
    #[default]
    Circular,
    /// The mean of the two groups' weighted means (the paper).
    Groups,
}

/// How much a wall counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Weighting {
    /// By length x reliability.
    #[default]
    Length,
    /// By reliability over the variance of its direction, which falls with the square of its length: the mean of least
    /// variance.
    Precision,
    /// By length x (1 - reliability), as equation 4 is printed. The paper calls a reliability near 1 ideal, so this is
    /// likely to be a slip; a wall of reliability 1 counts nothing.
    #[serde(rename = "equation_4")]
    Equation4,
}

/// Where the rotation between two maps comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RotationFrom {
    /// The directions of the maps, with the quarter turn from the tags (the paper's methods 2 and 3).
    #[default]
    Directions,
    /// The tags alone (the paper's method 1).
    Tags,
    /// The mean of the two, weighted with the inverse of their variances.
    Both,
}

/// How the tags tell a rotation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TagRotationFrom {
    /// The weighted least squares fit of all common tags.
    #[default]
    LeastSquares,
    /// The direction from the middle of the two best tags to the third: equations 5 and 6 (the paper).
    Triplet,
}

/// Which tags give the translation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TranslationFrom {
    /// All common tags, weighted with the inverse of their covariances.
    #[default]
    AllTags,
    /// The best tag alone: equation 8 (the paper's methods 2 and 3).
    BestTag,
    /// The centroid of the three best tags (the paper's method 1).
    Triplet,
}

/// The parameters of `quadrant_classifier`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct QuadrantClassifierParameters {
    /// How the directions of many walls become one: `circular` or `groups` (the paper).
    pub mean: Mean,
    /// How much a wall counts: `length` (length x reliability), `precision` (reliability over the variance of its
    /// direction, which is the most exact) or `equation_4` (as printed in the paper).
    pub weighting: Weighting,
    /// Where the rotation between two maps comes from: `directions`, `tags` (the paper's method 1) or `both`. Maps
    /// without a direction, or whose directions contradict the tags, are turned by the tags in any case.
    pub rotation: RotationFrom,
    /// How the tags tell a rotation: `least_squares` or `triplet` (the paper).
    pub tag_rotation: TagRotationFrom,
    /// Which tags give the translation: `all_tags`, `best_tag` (the paper) or `triplet` (the paper's method 1).
    pub translation: TranslationFrom,
    /// A wall within this angle of the map's direction, or of its perpendicular, agrees with it, radians. Others have no
    /// say in the `circular` mean.
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 0.5))]
    pub tolerance: f64,
    /// A map has a direction if at least this share of its wall length agrees with it. Walls of all directions
    /// alike give tolerance / 45 degrees, 0.11 by default.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_agreement: f64,
    /// A map has a direction if at least this length of walls agrees with it, metres.
    #[schemars(range(min = 0.0))]
    pub min_wall_length: f64,
    /// How far the end of a wall may lie off the wall, metres, one standard deviation: about half a cell. It bounds how
    /// well a short wall tells a direction.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub end_deviation: f64,
    /// Standard deviation of a wall's direction that no length removes, radians: walls are not quite straight, nor quite
    /// at right angles. With `end_deviation` it tells how well each wall's direction is known; walls that lie far off by
    /// that measure have no say in the `circular` mean.
    #[schemars(range(min = 0.0))]
    pub wall_deviation: f64,
    /// Standard deviation of a map's direction that no number of walls removes, radians: maps bend, and corners are not
    /// square.
    #[schemars(range(min = 0.0))]
    pub min_deviation: f64,
    /// Standard deviation of a tag's position in one map, metres, which is added to what its estimate claims.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub tag_deviation: f64,
    /// Tags that tell the rotation no better than this standard deviation, radians, cannot tell the quarter turn: the
    /// maps are not aligned.
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 0.25))]
    pub max_tag_rotation_deviation: f64,
    /// Directions contradict the tags when the two rotations differ by more than three joint standard deviations and
    /// this angle, radians.
    #[schemars(range(min = 0.0))]
    pub contradiction_angle: f64,
    /// Directions contradict the tags in any case when the two rotations differ by more than this, radians: 45 degrees
    /// away the quarter turn is a toss of a coin. The paper has no such bounds; with 0.8 for this one and for
    /// `contradiction_angle` they are out of reach.
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 0.8))]
    pub max_contradiction: f64,
    /// Two common tags, or more of which it may be chance that they agree, count only where the directions of both maps
    /// do not contradict them, and could have: where the bound on the difference of the two rotations (see
    /// `contradiction_angle`) is at most this angle, radians. The next quarter turn then is dozens of standard
    /// deviations away.
    #[schemars(range(min = 0.0))]
    pub max_confirming_angle: f64,
    /// Whether a single common tag proposes a place for each quarter turn that the directions leave open. What it proposes
    /// is provisional: `merge_verifier` must find one of them right, or another source must have found it, too.
    pub single_tag: bool,
    /// The least certainty of a single tag in both maps.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub single_tag_certainty: f64,
    /// Maps are not aligned if their tags then lie farther apart than this, metres (root mean square).
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_are_in_range() {
        assert_eq!(QuadrantClassifierParameters::default().check(), []);
    }

    #[test]
    fn every_value_out_of_range_is_reported() {
        let parameters = QuadrantClassifierParameters {
            tolerance: 0.0,
            min_agreement: 1.1,
            min_wall_length: -1.0,
            end_deviation: 0.0,
            wall_deviation: -0.1,
            min_deviation: f64::NAN,
            tag_deviation: f64::INFINITY,
            max_tag_rotation_deviation: 1.0,
            contradiction_angle: -0.1,
            max_contradiction: 0.9,
            max_confirming_angle: -0.1,
            max_residual: 0.0,
            resend_distance: -0.1,
            resend_angle: f64::NAN,
            ..Default::default()
        };
        assert_eq!(parameters.check().len(), 14);
    }
}
