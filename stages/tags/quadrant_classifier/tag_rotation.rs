//! Rotation between two maps from their common tags.

use super::parameters::TagRotationFrom;
use crate::shared::geometry::{Point2, PointPair, fit_rigid, wrap_angle};
use crate::tags::tag_filter::TagPair;
use gridweave_runtime::ros::CommonTag;
use nalgebra::Matrix2;

/// Largest valid coordinate, metres; it keeps squares finite.
const MAX_COORDINATE: f64 = 1e7;
/// Largest valid variance, square metres.
const MAX_VARIANCE: f64 = 1e4;

/// The pair of a common tag. `None` if its position is invalid. `deviation`, metres, is added to the covariances of the
/// estimates; an invalid covariance counts as zero.
pub(super) fn tag_pair(tag: &CommonTag, deviation: f64) -> Option<TagPair> {
    let usable = tag.a.iter().chain(&tag.b).all(|value| value.abs() <= MAX_COORDINATE);
    let floor = Matrix2::identity() * deviation * deviation;
    let covariance = |values: &[f64; 4]| floor + believable(values).unwrap_or_else(Matrix2::zeros);
    usable.then(|| TagPair {
        a: Point2::from(tag.a),
        b: Point2::from(tag.b),
        covariance_a: covariance(&tag.covariance_a),
        covariance_b: covariance(&tag.covariance_b),
    })
}

/// A valid covariance: symmetric, positive semi-definite and not too large.
fn believable(values: &[f64; 4]) -> Option<Matrix2<f64>> {
    let [xx, xy, yx, yy] = *values;
    let xy = (xy + yx) / 2.0;
    let good = (0.0..=MAX_VARIANCE).contains(&xx) && (0.0..=MAX_VARIANCE).contains(&yy) && xy * xy <= xx * yy;
    good.then(|| Matrix2::new(xx, xy, xy, yy))
}

/// A rotation with its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TagRotation {
    /// Rotation of `T_a_b`, radians.
    pub(super) angle: f64,
    /// Its standard deviation, radians.
    pub(super) deviation: f64,
}

/// The rotation from the tags' positions in map b to those in map a. `None` if there are too few tags, or all are at
/// one position.
pub(super) fn tag_rotation(tags: &[TagPair], from: TagRotationFrom) -> Option<TagRotation> {
    let rotation = match from {
        TagRotationFrom::LeastSquares => least_squares(tags),
        TagRotationFrom::Triplet => triplet(tags),
    }?;
    (rotation.angle.is_finite() && rotation.deviation.is_finite()).then_some(rotation)
}

/// The rotation of the weighted least squares fit.
fn least_squares(tags: &[TagPair]) -> Option<TagRotation> {
    let pair = |tag: &TagPair| PointPair { a: tag.a, b: tag.b, weight: 1.0 / tag.variance() };
    let fit = fit_rigid(&tags.iter().map(pair).collect::<Vec<_>>())?;
    Some(TagRotation { angle: fit.transform_a_b.rotation.angle(), deviation: fit.yaw_stddev() })
}

/// `theta_hat` of equations 5 and 6: the direction from the midpoint of tags 1 and 2 to tag 3, in map a less in map
/// b.
fn triplet(tags: &[TagPair]) -> Option<TagRotation> {
    let [first, second, third, ..] = tags else { return None };
    let arm = |place: fn(&TagPair) -> Point2| place(third) - nalgebra::center(&place(first), &place(second));
    let (a, b) = (arm(|tag| tag.a), arm(|tag| tag.b));
    let length = a.norm().min(b.norm());
    let variance = third.variance() + (first.variance() + second.variance()) / 4.0;
    (length > 1e-9).then(|| TagRotation {
        angle: wrap_angle(a.y.atan2(a.x) - b.y.atan2(b.x)),
        deviation: variance.sqrt() / length,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::{pose, turn_difference};
    use proptest::prelude::*;
    use std::f64::consts::TAU;

    fn pair(a: Point2, b: Point2) -> TagPair {
        let covariance = Matrix2::identity() * 0.0025;
        TagPair { a, b, covariance_a: covariance, covariance_b: covariance }
    }

    proptest! {
        #[test]
        fn the_rotation_of_exact_tags_is_recovered(x in -50.0..50.0, y in -50.0..50.0, yaw in -4.0..4.0) {
            let transform_a_b = pose(x, y, yaw);
            let places = [[1.0, 2.0], [5.0, -3.0], [-2.0, 6.0]].map(Point2::from);
            let tags = places.map(|b| pair(transform_a_b * b, b));
            for from in [TagRotationFrom::LeastSquares, TagRotationFrom::Triplet] {
                let rotation = tag_rotation(&tags, from).unwrap();
                prop_assert!(turn_difference(rotation.angle, yaw, TAU).abs() < 1e-9);
                prop_assert!(rotation.deviation > 0.005 && rotation.deviation < 0.05);
            }
        }
    }

    #[test]
    fn too_few_tags_or_tags_at_one_position_determine_no_rotation() {
        let place = pair(Point2::new(1.0, 2.0), Point2::new(3.0, 4.0));
        for from in [TagRotationFrom::LeastSquares, TagRotationFrom::Triplet] {
            for count in 0..5 {
                assert_eq!(tag_rotation(&vec![place; count], from), None);
            }
        }
    }

    #[test]
    fn an_invalid_position_is_left_out_and_an_invalid_covariance_is_replaced() {
        let good = CommonTag { covariance_a: [0.01, 0.0, 0.0, 0.01], ..Default::default() };
        assert!(tag_pair(&CommonTag { a: [f64::NAN, 0.0], ..good.clone() }, 0.03).is_none());
        assert!(tag_pair(&CommonTag { b: [0.0, 1e300], ..good.clone() }, 0.03).is_none());
        assert!((tag_pair(&good, 0.03).unwrap().covariance_a[(0, 0)] - 0.0109).abs() < 1e-12);
        for covariance_a in [[f64::NAN; 4], [-1.0, 0.0, 0.0, 1.0], [0.1, 5.0, 5.0, 0.1], [f64::INFINITY, 0.0, 0.0, 1.0]]
        {
            let pair = tag_pair(&CommonTag { covariance_a, ..good.clone() }, 0.03).unwrap();
            assert!((pair.covariance_a[(0, 0)] - 0.0009).abs() < 1e-12);
        }
    }
}
