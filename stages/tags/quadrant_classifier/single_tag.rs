//! First guesses from one common tag.

use super::GuessError;
use super::direction::Direction;
use super::first_guess::{FirstGuess, tag_pairs};
use super::parameters::{QuadrantClassifierParameters, TranslationFrom};
use super::rotation_by_directions::difference_of_directions;
use super::tag_rotation::TagRotation;
use super::translation::translate;
use crate::shared::geometry::wrap_angle;
use gridweave_runtime::ros::CommonTag;
use std::f64::consts::FRAC_PI_2;

/// Hypotheses of the relative pose of two maps with one common tag: the directions determine the rotation up to
/// quarter turns, and the tag the position. Each quarter turn is a hypothesis; the maps must decide which of them is
/// right, if any.
pub fn single_tag_guesses(
    tag: &CommonTag,
    direction_a: Option<&Direction>,
    direction_b: Option<&Direction>,
    parameters: &QuadrantClassifierParameters,
) -> Result<Vec<FirstGuess>, GuessError> {
    let difference = difference_of_directions(direction_a, direction_b)
        .map_err(|missing| GuessError::NoDirections { count: 1, missing })?;
    let pairs = tag_pairs(std::slice::from_ref(tag), parameters);
    let guess = |turns: u8| {
        let angle = wrap_angle(difference.angle + f64::from(turns) * FRAC_PI_2);
        let rotation = TagRotation { angle, ..difference };
        let transform = translate(&pairs, &rotation, TranslationFrom::AllTags).ok_or(GuessError::NoRotation(1))?;
        Ok(FirstGuess {
            transform_a_b: transform.transform_a_b,
            covariance: transform.covariance,
            score: tag.common_precision().clamp(0.0, 1.0),
            method: "one tag+directions",
            reason: format!("one common tag only ({}), and a quarter turn that the directions leave open", tag.tag_id),
        })
    };
    (0..4).map(guess).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::{Point2, pose};

    fn direction(angle: f64) -> Direction {
        Direction { angle, deviation: 0.004, groups: [angle, angle + FRAC_PI_2], agreement: 0.9, valid: true }
    }

    #[test]
    fn one_of_the_quarter_turns_is_right_and_all_align_the_tag() {
        let truth = pose(3.0, 4.0, 2.0);
        let place = truth * Point2::new(5.0, -1.0);
        let covariance = [0.0009, 0.0, 0.0, 0.0009];
        let tag = CommonTag {
            a: [place.x, place.y],
            b: [5.0, -1.0],
            covariance_a: covariance,
            covariance_b: covariance,
            certainty_a: 0.95,
            certainty_b: 0.9,
            ..Default::default()
        };
        let parameters = QuadrantClassifierParameters::default();
        let guesses =
            single_tag_guesses(&tag, Some(&direction(2.0 + FRAC_PI_2)), Some(&direction(0.0)), &parameters).unwrap();
        assert_eq!(guesses.len(), 4);
        let right = |guess: &&FirstGuess| {
            let error = guess.transform_a_b * truth.inverse();
            error.translation.vector.norm() < 1e-9 && error.rotation.angle().abs() < 1e-9
        };
        assert_eq!(guesses.iter().filter(right).count(), 1);
        for guess in &guesses {
            assert!((guess.transform_a_b * Point2::new(5.0, -1.0) - place).norm() < 1e-9);
            assert!(guess.covariance.cholesky().is_some() && guess.score == 0.9);
        }
        let none = single_tag_guesses(&tag, None, Some(&direction(0.0)), &parameters).unwrap_err();
        assert!(none.to_string().contains("a map is missing so far"), "{none}");
    }
}
