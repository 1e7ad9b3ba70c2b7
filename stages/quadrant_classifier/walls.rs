//! What the classifier needs of a wall: its direction, its length and how much it counts.

use super::parameters::Weighting;
use gridweave_runtime::ros::Segment;

/// The direction of one wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct WallDirection {
    /// Radians, in `(-pi, pi]`; a wall's two ends are alike, so it means the same as its opposite.
    pub(super) angle: f64,
    /// Metres.
    pub(super) length: f64,
    /// How much it counts.
    pub(super) weight: f64,
}

/// The longest wall that is believed, metres; it keeps sums finite.
const MAX_LENGTH: f64 = 1e6;

/// The walls' directions. Segments without length, or with values that are no numbers, are left out.
pub(super) fn wall_directions(segments: &[Segment], weighting: Weighting) -> Vec<WallDirection> {
    segments
        .iter()
        .filter_map(|segment| {
            let (dx, dy) = (segment.x2 - segment.x1, segment.y2 - segment.y1);
            let length = dx.hypot(dy);
            let share = match weighting {
                Weighting::Length => segment.reliability,
                Weighting::Equation4 => 1.0 - segment.reliability,
            };
            let usable = length > 0.0 && length <= MAX_LENGTH && (0.0..=1.0).contains(&share);
            usable.then(|| WallDirection { angle: dy.atan2(dx), length, weight: length * share })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_two_weightings_are_length_with_reliability_and_equation_4_as_printed() {
        let segment = Segment { x1: 1.0, y1: 1.0, x2: 4.0, y2: 5.0, reliability: 0.9, inliers: 3 };
        let weight = |weighting| wall_directions(&[segment], weighting)[0].weight;
        assert!((weight(Weighting::Length) - 4.5).abs() < 1e-12);
        assert!((weight(Weighting::Equation4) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn segments_that_tell_no_direction_are_left_out() {
        let good = Segment { x2: 1.0, reliability: 1.0, ..Default::default() };
        let bad = [
            Segment { x2: 0.0, ..good },
            Segment { x2: f64::NAN, ..good },
            Segment { y1: f64::INFINITY, ..good },
            Segment { x2: 1e300, ..good },
            Segment { reliability: f64::NAN, ..good },
            Segment { reliability: -1.0, ..good },
        ];
        assert!(wall_directions(&bad, Weighting::Length).is_empty());
        assert_eq!(wall_directions(&[good], Weighting::Length).len(), 1);
    }
}
