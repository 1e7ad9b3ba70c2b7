//! A first guess from tags that do not suffice alone.

use super::GuessError;
use super::direction::Direction;
use super::first_guess::{FirstGuess, first_guess, rotation_of_tags};
use super::parameters::QuadrantClassifierParameters;
use super::rotation_by_directions::rotation_by_directions;
use gridweave_runtime::ros::CommonTag;

/// Relative pose of two maps from two common tags, or from more that may agree by chance.
///
/// As [`first_guess`], but the directions of the maps must be known and confirm the rotation of the tags. That is
/// evidence only if both are known well: of random rotations, a share of the allowed difference divided by 45 degrees
/// would be confirmed. The guess is then still to be verified by the walls of the maps.
pub fn provisional_guess(
    tags: &[CommonTag],
    direction_a: Option<&Direction>,
    direction_b: Option<&Direction>,
    parameters: &QuadrantClassifierParameters,
) -> Result<FirstGuess, GuessError> {
    let count = tags.len();
    let by_tags = rotation_of_tags(tags, parameters)?;
    let by_directions = rotation_by_directions(&by_tags, direction_a, direction_b, parameters)
        .map_err(|missing| GuessError::NoDirections { count, missing })?;
    let (off, limit) = (by_directions.off.abs().to_degrees(), by_directions.limit.to_degrees());
    if by_directions.limit > parameters.max_confirming_angle {
        let most = parameters.max_confirming_angle.to_degrees();
        return Err(GuessError::VagueDirections { count, limit, most });
    }
    if !by_directions.agrees() {
        return Err(GuessError::Unconfirmed { count, off, limit });
    }
    let guess = first_guess(tags, direction_a, direction_b, parameters)?;
    Ok(FirstGuess {
        method: "few tags+directions",
        reason: format!(
            "{count} common tags only, whose rotation is {off:.1} degrees off that of the maps' directions"
        ),
        ..guess
    })
}

#[cfg(test)]
mod tests {
    use super::super::parameters::RotationFrom;
    use super::*;
    use crate::shared::geometry::{Point2, Pose2, pose};
    use std::f64::consts::FRAC_PI_2;

    /// Two tags `length` metres apart.
    fn tags(transform_a_b: &Pose2, length: f64) -> Vec<CommonTag> {
        let tag = |x: f64| {
            let a = transform_a_b * Point2::new(x, 2.0);
            let covariance = [0.0009, 0.0, 0.0, 0.0009];
            CommonTag {
                a: [a.x, a.y],
                b: [x, 2.0],
                covariance_a: covariance,
                covariance_b: covariance,
                certainty_a: 0.95,
                certainty_b: 0.9,
                ..Default::default()
            }
        };
        vec![tag(1.0), tag(1.0 + length)]
    }

    fn direction(angle: f64, deviation: f64) -> Direction {
        Direction { angle, deviation, groups: [angle, angle + FRAC_PI_2], agreement: 0.9, valid: true }
    }

    fn guess(length: f64, a: &Direction, b: &Direction) -> Result<FirstGuess, GuessError> {
        let tags = tags(&pose(3.0, 4.0, 2.0), length);
        provisional_guess(&tags, Some(a), Some(b), &QuadrantClassifierParameters::default())
    }

    #[test]
    fn directions_confirm_the_rotation_of_two_tags() {
        for turns in 0..4 {
            let a = direction(2.0 + f64::from(turns) * FRAC_PI_2 + 0.01, 0.004);
            let found = guess(8.0, &a, &direction(0.0, 0.004)).unwrap();
            assert_eq!(found.method, "few tags+directions");
            assert_eq!(
                found.reason,
                "2 common tags only, whose rotation is 0.6 degrees off that of the maps' directions"
            );
            assert!((found.transform_a_b.rotation.angle() - 2.01).abs() < 1e-9, "the directions know it better");
            let middle = found.transform_a_b * Point2::new(5.0, 2.0) - pose(3.0, 4.0, 2.0) * Point2::new(5.0, 2.0);
            assert!(middle.norm() < 1e-3, "the tags determine the position");
        }
    }

    #[test]
    fn the_rotation_may_come_from_the_tags_but_is_confirmed_all_the_same() {
        let parameters = QuadrantClassifierParameters { rotation: RotationFrom::Tags, ..Default::default() };
        let tags = tags(&pose(3.0, 4.0, 2.0), 8.0);
        let with = |angle: f64| {
            provisional_guess(&tags, Some(&direction(angle, 0.004)), Some(&direction(0.0, 0.004)), &parameters)
        };
        assert!((with(2.01).unwrap().transform_a_b.rotation.angle() - 2.0).abs() < 1e-9);
        assert!(matches!(with(2.2), Err(GuessError::Unconfirmed { .. })));
    }

    #[test]
    fn directions_that_differ_or_are_missing_refuse() {
        let good = direction(0.0, 0.004);
        let off = guess(8.0, &direction(2.15, 0.004), &good).unwrap_err();
        assert!(matches!(off, GuessError::Unconfirmed { count: 2, .. }), "{off}");
        assert!(off.to_string().contains("8.6 degrees"), "{off}");
        let invalid = Direction { valid: false, ..direction(2.0, 0.004) };
        let none = guess(8.0, &invalid, &good).unwrap_err();
        assert!(none.to_string().contains("the walls of a map have no common direction"), "{none}");
        let parameters = QuadrantClassifierParameters::default();
        let tags = tags(&pose(3.0, 4.0, 2.0), 8.0);
        let none = provisional_guess(&tags, None, Some(&good), &parameters).unwrap_err();
        assert!(none.to_string().contains("a map is missing so far"), "{none}");
        assert_eq!(
            provisional_guess(&tags[..1], Some(&good), Some(&good), &parameters),
            Err(GuessError::NoRotation(1))
        );
    }

    #[test]
    fn uncertain_directions_confirm_nothing() {
        let good = direction(0.0, 0.004);
        for vague in [guess(1.6, &direction(2.0, 0.004), &good), guess(8.0, &direction(2.0, 0.05), &good)] {
            assert!(matches!(vague, Err(GuessError::VagueDirections { count: 2, .. })), "{vague:?}");
        }
    }
}
