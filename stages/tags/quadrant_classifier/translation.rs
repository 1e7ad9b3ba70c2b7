//! The translation between two maps whose rotation is known (section 4.2, equation 8 of Tsardoulias et al.).

use super::parameters::TranslationFrom;
use super::tag_rotation::TagRotation;
use crate::shared::geometry::{Pose2, quarter_turn};
use crate::tags::tag_filter::TagPair;
use nalgebra::{Isometry2, Matrix2, Matrix3, Rotation2, Vector2};

/// A transform and its covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct EstimatedTransform {
    /// `T_a_b`.
    pub(super) transform_a_b: Pose2,
    /// Covariance of (x, y, yaw), metres and radians.
    pub(super) covariance: Matrix3<f64>,
}

/// Transform of map b with a given `rotation` that aligns its tags with those of map a.
///
/// The translation is a weighted mean over the tags, `sum A_i (a_i - R b_i)` with the A_i summing to one: the inverse
/// covariances, the best tag only (equation 8), or thirds. `None` without tags.
pub(super) fn translate(tags: &[TagPair], rotation: &TagRotation, from: TranslationFrom) -> Option<EstimatedTransform> {
    let turn = Rotation2::new(rotation.angle);
    let matrix = *turn.matrix();
    let covariance = |tag: &TagPair| tag.covariance_a + matrix * tag.covariance_b * matrix.transpose();
    let used = match from {
        TranslationFrom::AllTags => tags,
        TranslationFrom::BestTag => tags.get(..1)?,
        TranslationFrom::Triplet => tags.get(..3).unwrap_or(tags),
    };
    let weights: Vec<Matrix2<f64>> = match from {
        TranslationFrom::AllTags => {
            let information: Vec<Matrix2<f64>> =
                used.iter().map(|tag| covariance(tag).try_inverse()).collect::<Option<_>>()?;
            let total = information.iter().sum::<Matrix2<f64>>().try_inverse()?;
            information.iter().map(|part| total * part).collect()
        }
        TranslationFrom::BestTag | TranslationFrom::Triplet => {
            vec![Matrix2::identity() / used.len().max(1) as f64; used.len()]
        }
    };

    let (mut translation, mut by_rotation, mut spread) = (Vector2::zeros(), Vector2::zeros(), Matrix2::zeros());
    for (tag, weight) in used.iter().zip(&weights) {
        let turned = turn * tag.b.coords;
        translation += weight * (tag.a.coords - turned);
        by_rotation -= weight * quarter_turn(&turned);
        spread += weight * covariance(tag) * weight.transpose();
    }
    let variance = rotation.deviation * rotation.deviation;
    let block = spread + by_rotation * by_rotation.transpose() * variance;
    let cross = by_rotation * variance;
    let full = Matrix3::new(
        block[(0, 0)],
        block[(0, 1)],
        cross.x, //
        block[(0, 1)],
        block[(1, 1)],
        cross.y, //
        cross.x,
        cross.y,
        variance,
    );
    let finite = translation.iter().chain(full.iter()).all(|value| value.is_finite());
    (finite && !used.is_empty())
        .then(|| EstimatedTransform { transform_a_b: Isometry2::new(translation, rotation.angle), covariance: full })
}

/// Root mean square of the residuals of the tags under a transform, metres.
pub(super) fn residual(tags: &[TagPair], transform_a_b: &Pose2) -> f64 {
    let squares: f64 = tags.iter().map(|tag| (tag.a - transform_a_b * tag.b).norm_squared()).sum();
    (squares / tags.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::{Point2, pose};
    use proptest::prelude::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, Normal};

    const ALL: [TranslationFrom; 3] = [TranslationFrom::AllTags, TranslationFrom::BestTag, TranslationFrom::Triplet];

    fn tags(transform_a_b: &Pose2) -> Vec<TagPair> {
        let tag = |(x, y, variance): (f64, f64, f64)| {
            let b = Point2::new(x, y);
            let covariance = Matrix2::identity() * variance;
            TagPair { a: transform_a_b * b, b, covariance_a: covariance, covariance_b: covariance }
        };
        [(20.0, 1.0, 0.002), (25.0, 6.0, 0.004), (18.0, 9.0, 0.01), (22.0, 3.0, 0.003)].map(tag).to_vec()
    }

    proptest! {
        #[test]
        fn the_translation_of_exact_tags_is_recovered(x in -50.0..50.0, y in -50.0..50.0, yaw in -4.0..4.0) {
            let truth = pose(x, y, yaw);
            let rotation = TagRotation { angle: yaw, deviation: 0.01 };
            for from in ALL {
                let found = translate(&tags(&truth), &rotation, from).unwrap();
                prop_assert!((found.transform_a_b.translation.vector - truth.translation.vector).norm() < 1e-9);
                prop_assert!(residual(&tags(&truth), &found.transform_a_b) < 1e-9);
            }
        }
    }

    #[test]
    fn the_covariance_is_that_of_repeated_trials() {
        let truth = pose(3.0, -2.0, 0.8);
        let clean = tags(&truth);
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let normal = Normal::new(0.0, 1.0).unwrap();
        for from in ALL {
            let runs = 3000;
            let (mut seen, mut claimed) = (Matrix3::zeros(), Matrix3::zeros());
            for _ in 0..runs {
                let mut noisy = clean.clone();
                for tag in &mut noisy {
                    let deviation = tag.covariance_a[(0, 0)].sqrt();
                    for value in tag.a.iter_mut().chain(tag.b.iter_mut()) {
                        *value += deviation * normal.sample(&mut random);
                    }
                }
                let rotation = TagRotation { angle: 0.8 + 0.01 * normal.sample(&mut random), deviation: 0.01 };
                let found = translate(&noisy, &rotation, from).unwrap();
                let offset = found.transform_a_b.translation.vector - truth.translation.vector;
                let error = nalgebra::Vector3::new(offset.x, offset.y, rotation.angle - 0.8);
                seen += error * error.transpose() / f64::from(runs);
                claimed += found.covariance / f64::from(runs);
            }
            assert!((seen - claimed).norm() < 0.15 * claimed.norm(), "{from:?} {seen} {claimed}");
        }
    }

    #[test]
    fn without_tags_there_is_no_translation() {
        let rotation = TagRotation { angle: 0.0, deviation: 0.01 };
        for from in ALL {
            assert_eq!(translate(&[], &rotation, from), None);
        }
    }
}
