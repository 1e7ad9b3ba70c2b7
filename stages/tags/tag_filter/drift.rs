//! Tags in maps with drift.

use gridweave_runtime::ros::CommonTag;
use nalgebra::Vector2;

/// The tags with the uncertainty of maps with drift: it grows with the distance from the centroid of all, by `drift`
/// metres per square root of a metre.
pub(super) fn of_deformed_maps(tags: &[CommonTag], drift: f64) -> Vec<CommonTag> {
    let count = tags.len().max(1) as f64;
    let middle = |place: fn(&CommonTag) -> [f64; 2]| {
        tags.iter().fold(Vector2::zeros(), |sum, tag| sum + Vector2::from(place(tag)) / count)
    };
    let (middle_a, middle_b) = (middle(|tag| tag.a), middle(|tag| tag.b));
    let drifted = |[xx, xy, yx, yy]: [f64; 4], from_middle: Vector2<f64>| {
        let variance = drift * drift * from_middle.norm();
        [xx + variance, xy, yx, yy + variance]
    };
    let tags = tags.iter().map(|tag| CommonTag {
        covariance_a: drifted(tag.covariance_a, Vector2::from(tag.a) - middle_a),
        covariance_b: drifted(tag.covariance_b, Vector2::from(tag.b) - middle_b),
        ..tag.clone()
    });
    tags.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_uncertainty_grows_with_the_distance_from_the_centroid() {
        let tag = |x: f64| CommonTag { a: [x, 0.0], b: [0.0, 2.0 * x], ..Default::default() };
        let drifted = of_deformed_maps(&[tag(-9.0), tag(0.0), tag(9.0)], 0.1);
        for (tag, expected) in drifted.iter().zip([0.09, 0.0, 0.09]) {
            assert!((tag.covariance_a[0] - expected).abs() < 1e-12, "{tag:?}");
        }
        assert!((drifted[0].covariance_b[3] - 0.18).abs() < 1e-12 && drifted[0].covariance_b[1] == 0.0);
        assert_eq!(of_deformed_maps(&[], 0.1), []);
    }
}
