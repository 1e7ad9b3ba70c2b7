//! Directions of walls for the classifier, with their weights.

use super::parameters::{QuadrantClassifierParameters, Weighting};
use gridweave_runtime::ros::Segment;
use std::f64::consts::FRAC_PI_4;

/// The direction of one wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct WallDirection {
    /// Radians, in `(-pi, pi]`, up to half turns.
    pub(super) angle: f64,
    /// Length, metres.
    pub(super) length: f64,
    /// Standard deviation of the angle, radians.
    pub(super) deviation: f64,
    /// Weight in the mean.
    pub(super) weight: f64,
}

/// Longest valid wall, metres; it keeps sums finite.
const MAX_LENGTH: f64 = 1e6;

/// Directions of the walls. Segments without length, or with values that are not finite, are left out.
pub(super) fn wall_directions(segments: &[Segment], parameters: &QuadrantClassifierParameters) -> Vec<WallDirection> {
    segments
        .iter()
        .filter_map(|segment| {
            let (dx, dy) = (segment.x2 - segment.x1, segment.y2 - segment.y1);
            let length = dx.hypot(dy);
            let usable = length > 0.0 && length <= MAX_LENGTH && (0.0..=1.0).contains(&segment.reliability);
            // The largest deviation is that of a uniform distribution over the quadrant.
            let deviation = (parameters.end_deviation / length).hypot(parameters.wall_deviation).min(FRAC_PI_4);
            let weight = match parameters.weighting {
                Weighting::Precision => segment.reliability / deviation.powi(2),
                Weighting::Length => length * segment.reliability,
                Weighting::Equation4 => length * (1.0 - segment.reliability),
            };
            usable.then(|| WallDirection { angle: dy.atan2(dx), length, deviation, weight })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn walls_weigh_by_their_precision_or_their_length_or_equation_4_as_printed() {
        let segment = Segment { x1: 1.0, y1: 1.0, x2: 4.0, y2: 5.0, reliability: 0.9, inliers: 3 };
        let weight = |weighting| {
            let parameters = QuadrantClassifierParameters { weighting, wall_deviation: 0.003, ..Default::default() };
            wall_directions(&[segment], &parameters)[0].weight
        };
        assert!((weight(Weighting::Precision) - 0.9 / (0.004_f64.powi(2) + 0.003_f64.powi(2))).abs() < 1e-6);
        assert!((weight(Weighting::Length) - 4.5).abs() < 1e-12);
        assert!((weight(Weighting::Equation4) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn segments_without_a_direction_are_left_out() {
        let good = Segment { x2: 1.0, reliability: 1.0, ..Default::default() };
        let bad = [
            Segment { x2: 0.0, ..good },
            Segment { x2: f64::NAN, ..good },
            Segment { y1: f64::INFINITY, ..good },
            Segment { x2: 1e300, ..good },
            Segment { reliability: f64::NAN, ..good },
            Segment { reliability: -1.0, ..good },
        ];
        assert!(wall_directions(&bad, &QuadrantClassifierParameters::default()).is_empty());
        assert_eq!(wall_directions(&[good], &QuadrantClassifierParameters::default()).len(), 1);
    }
}
