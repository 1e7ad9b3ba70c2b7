//! First guess of the relative pose of two maps, from their directions and their common tags: sections 4.1.3 and 4.2.

use super::direction::Direction;
use super::parameters::{QuadrantClassifierParameters, RotationFrom};
use super::rotation_by_directions::{MissingDirection, rotation_by_directions};
use super::tag_rotation::{TagRotation, tag_pair, tag_rotation};
use super::translation::{residual, translate};
use crate::shared::geometry::{Pose2, turn_difference, wrap_angle};
use crate::tags::tag_filter::TagPair;
use gridweave_runtime::ros::CommonTag;
use nalgebra::Matrix3;
use std::f64::consts::TAU;

/// Residuals that are so many times as large as the covariances of the tags make likely are no noise.
const EXPECTED_FACTOR: f64 = 2.0;

/// A first guess of an alignment.
#[derive(Clone, Debug, PartialEq)]
pub struct FirstGuess {
    /// `T_a_b`.
    pub transform_a_b: Pose2,
    /// Covariance of (x, y, yaw), metres and radians.
    pub covariance: Matrix3<f64>,
    /// Least common precision of the tags, 0 to 1.
    pub score: f64,
    /// `tags+directions`, `tags`, `few tags+directions`, or `one tag+directions`.
    pub method: &'static str,
    /// Reason for the user.
    pub reason: String,
}

/// Why common tags give no alignment.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GuessError {
    /// There are too few tags, or all are at one position.
    #[error(
        "{0} common tags do not determine the rotation: it takes two or more at different positions, and three for the \
         paper's triplet"
    )]
    NoRotation(usize),
    /// The rotation is too uncertain.
    #[error(
        "the {count} common tags are too near each other: they determine the rotation to {degrees:.1} degrees only"
    )]
    WeakRotation {
        /// Number of tags.
        count: usize,
        /// Standard deviation of the rotation, degrees.
        degrees: f64,
    },
    /// The tags do not suffice alone, and there are no directions to confirm them.
    #[error("the directions of both maps must confirm {count} common tags, but {missing}")]
    NoDirections {
        /// Number of tags.
        count: usize,
        /// What is missing.
        missing: MissingDirection,
    },
    /// The tags do not suffice alone, and the directions are too uncertain to confirm them.
    #[error(
        "the directions of both maps must confirm {count} common tags, but both determine the rotation to {limit:.1} degrees \
         only, and {most:.1} are allowed (max_confirming_angle)"
    )]
    VagueDirections {
        /// Number of tags.
        count: usize,
        /// Bound of the difference of the two rotations, degrees.
        limit: f64,
        /// Largest bound allowed, degrees.
        most: f64,
    },
    /// The tags do not suffice alone, and the directions contradict them.
    #[error(
        "the directions of both maps must confirm {count} common tags, but differ from their rotation by {off:.1} degrees, \
         and {limit:.1} are allowed"
    )]
    Unconfirmed {
        /// Number of tags.
        count: usize,
        /// Difference of the two rotations, degrees.
        off: f64,
        /// Largest difference allowed, degrees.
        limit: f64,
    },
    /// The tags do not fit each other.
    #[error(
        "the {count} common tags do not fit: they are {residual:.2} m apart when the maps are aligned (max_residual)"
    )]
    Residual {
        /// Number of tags.
        count: usize,
        /// Root mean square of the residuals, metres.
        residual: f64,
    },
}

/// Estimates the relative pose of two maps: the rotation from the directions of the two maps and the quarter turn of
/// the tags, or from the tags alone; then the translation from the tags.
///
/// The tags are sorted by falling common precision. Directions that are missing, not valid, or that contradict the
/// tags are ignored, and the reason mentions it.
pub fn first_guess(
    tags: &[CommonTag],
    direction_a: Option<&Direction>,
    direction_b: Option<&Direction>,
    parameters: &QuadrantClassifierParameters,
) -> Result<FirstGuess, GuessError> {
    let pairs = tag_pairs(tags, parameters);
    let count = pairs.len();
    let by_tags = rotation_of_tags(tags, parameters)?;
    let (rotation, method, rotation_reason) = match by_directions(&by_tags, direction_a, direction_b, parameters) {
        Ok(rotation) if parameters.rotation == RotationFrom::Both => {
            let reason = "rotation from the tags and both maps' directions".to_owned();
            (mean_rotation(&by_tags, &rotation), "tags+directions", reason)
        }
        Ok(rotation) => (rotation, "tags+directions", "rotation from the directions of both maps".to_owned()),
        Err(reason) => (by_tags, "tags", reason),
    };
    let transform = translate(&pairs, &rotation, parameters.translation).ok_or(GuessError::NoRotation(count))?;
    let residual = residual(&pairs, &transform.transform_a_b);
    let limit = parameters.max_residual.max(EXPECTED_FACTOR * expected_residual(tags));
    if residual.is_nan() || residual > limit {
        return Err(GuessError::Residual { count, residual });
    }
    let precisions = tags.iter().map(CommonTag::common_precision).filter(|precision| precision.is_finite());
    Ok(FirstGuess {
        transform_a_b: transform.transform_a_b,
        covariance: transform.covariance,
        score: precisions.fold(1.0, f64::min).max(0.0),
        method,
        reason: format!("{count} common tags; {rotation_reason}"),
    })
}

/// The rotation of the tags, if they determine the quarter turn.
pub(super) fn rotation_of_tags(
    tags: &[CommonTag],
    parameters: &QuadrantClassifierParameters,
) -> Result<TagRotation, GuessError> {
    let pairs = tag_pairs(tags, parameters);
    let count = pairs.len();
    let by_tags = tag_rotation(&pairs, parameters.tag_rotation).ok_or(GuessError::NoRotation(count))?;
    match by_tags.deviation > parameters.max_tag_rotation_deviation {
        true => Err(GuessError::WeakRotation { count, degrees: by_tags.deviation.to_degrees() }),
        false => Ok(by_tags),
    }
}

/// Root mean square of the tags' residuals by their covariances, metres; 0 if these are not finite.
fn expected_residual(tags: &[CommonTag]) -> f64 {
    let variance = |[xx, _, _, yy]: [f64; 4]| xx + yy;
    let sum: f64 = tags.iter().map(|tag| variance(tag.covariance_a) + variance(tag.covariance_b)).sum();
    let expected = (sum / tags.len().max(1) as f64).sqrt();
    if expected.is_finite() { expected } else { 0.0 }
}

pub(super) fn tag_pairs(tags: &[CommonTag], parameters: &QuadrantClassifierParameters) -> Vec<TagPair> {
    tags.iter().filter_map(|tag| tag_pair(tag, parameters.tag_deviation)).collect()
}

/// `d_theta + kappa * 90 degrees`, or why the rotation must be that of the tags.
fn by_directions(
    by_tags: &TagRotation,
    a: Option<&Direction>,
    b: Option<&Direction>,
    parameters: &QuadrantClassifierParameters,
) -> Result<TagRotation, String> {
    if parameters.rotation == RotationFrom::Tags {
        return Err("rotation from the tags".into());
    }
    match rotation_by_directions(by_tags, a, b, parameters) {
        Ok(found) if found.agrees() => Ok(found.rotation),
        Ok(_) => Err("rotation from the tags, which the directions of the maps contradict".into()),
        Err(missing) => Err(format!("rotation from the tags, for {missing}")),
    }
}

/// Mean of two rotations, weighted by the inverse of their variances.
fn mean_rotation(a: &TagRotation, b: &TagRotation) -> TagRotation {
    let (variance_a, variance_b) = (a.deviation * a.deviation, b.deviation * b.deviation);
    let share_b = variance_a / (variance_a + variance_b);
    let angle = wrap_angle(a.angle + share_b * turn_difference(b.angle, a.angle, TAU));
    TagRotation { angle, deviation: share_b.sqrt() * b.deviation }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::{Point2, pose};
    use crate::tags::quadrant_classifier::{TagRotationFrom, TranslationFrom};
    use proptest::prelude::*;
    use std::f64::consts::FRAC_PI_2;

    fn tags(transform_a_b: &Pose2) -> Vec<CommonTag> {
        let tag = |(x, y, certainty): (f64, f64, f64)| {
            let a = transform_a_b * Point2::new(x, y);
            let covariance = [0.0004, 0.0, 0.0, 0.0004];
            CommonTag {
                tag_id: format!("tag at {x}"),
                a: [a.x, a.y],
                b: [x, y],
                covariance_a: covariance,
                covariance_b: covariance,
                certainty_a: certainty,
                certainty_b: 0.95,
            }
        };
        [(2.0, 1.0, 0.91), (9.0, 5.0, 0.82), (4.0, 8.0, 0.76)].map(tag).to_vec()
    }

    fn direction(angle: f64) -> Direction {
        Direction { angle, deviation: 0.002, groups: [angle, angle + FRAC_PI_2], agreement: 0.9, valid: true }
    }

    proptest! {
        #[test]
        fn any_transform_is_recovered_in_every_mode(
            x in -50.0..50.0, y in -50.0..50.0, yaw in -4.0..4.0, direction_b in -1.0..1.0, turns in 0..4i32,
        ) {
            let truth = pose(x, y, yaw);
            let a = direction(direction_b + yaw + f64::from(turns) * FRAC_PI_2);
            for rotation in [RotationFrom::Directions, RotationFrom::Tags, RotationFrom::Both] {
                for tag_rotation in [TagRotationFrom::LeastSquares, TagRotationFrom::Triplet] {
                    for translation in [TranslationFrom::AllTags, TranslationFrom::BestTag, TranslationFrom::Triplet] {
                        let parameters =
                            QuadrantClassifierParameters { rotation, tag_rotation, translation, ..Default::default() };
                        let guess = first_guess(&tags(&truth), Some(&a), Some(&direction(direction_b)), &parameters);
                        let error = guess.unwrap().transform_a_b * truth.inverse();
                        prop_assert!(error.translation.vector.norm() < 1e-6 && error.rotation.angle().abs() < 1e-8);
                    }
                }
            }
        }

        #[test]
        fn any_input_gives_finite_numbers(
            values in prop::collection::vec(prop::array::uniform10(prop::num::f64::ANY), 0..6),
        ) {
            let tags: Vec<CommonTag> = values
                .iter()
                .map(|v| CommonTag {
                    tag_id: String::new(),
                    a: [v[0], v[1]],
                    b: [v[2], v[3]],
                    covariance_a: [v[4], v[5], v[5], v[6]],
                    covariance_b: [v[7], v[8], v[8], v[9]],
                    certainty_a: v[0],
                    certainty_b: v[9],
                })
                .collect();
            let parameters = QuadrantClassifierParameters { max_residual: 1e12, ..Default::default() };
            if let Ok(guess) = first_guess(&tags, Some(&direction(0.1)), Some(&direction(0.2)), &parameters) {
                prop_assert!(guess.covariance.iter().all(|value| value.is_finite()));
                prop_assert!(guess.transform_a_b.translation.vector.iter().all(|value| value.is_finite()));
                prop_assert!((0.0..=1.0).contains(&guess.score));
            }
        }
    }

    fn guess(tags: &[CommonTag], a: Option<&Direction>, b: Option<&Direction>) -> Result<FirstGuess, GuessError> {
        first_guess(tags, a, b, &QuadrantClassifierParameters::default())
    }

    #[test]
    fn tags_whose_positions_are_uncertain_by_metres_may_be_off_by_metres() {
        let mut tags = tags(&pose(3.0, 4.0, 2.0));
        tags[2].a[0] += 2.5;
        assert!(matches!(guess(&tags, None, None), Err(GuessError::Residual { .. })));
        for tag in &mut tags {
            (tag.covariance_a, tag.covariance_b) = ([1.0, 0.0, 0.0, 1.0], [0.5, 0.0, 0.0, 0.5]);
        }
        let parameters = QuadrantClassifierParameters { max_tag_rotation_deviation: 3.0, ..Default::default() };
        assert!(first_guess(&tags, None, None, &parameters).is_ok());
    }

    #[test]
    fn good_directions_make_the_rotation_better_than_noisy_tags() {
        let mut tags = tags(&pose(3.0, 4.0, 2.0));
        tags[2].a[0] += 0.06;
        let found = guess(&tags, Some(&direction(2.0 - FRAC_PI_2)), Some(&direction(0.0))).unwrap();
        assert_eq!(found.method, "tags+directions");
        assert!((found.transform_a_b.rotation.angle() - 2.0).abs() < 1e-9);
        assert_eq!(found.score, 0.76);
    }
}
