//! Mean of directions that are known up to quarter turns, robust against walls at an angle.

use super::walls::WallDirection;
use crate::shared::geometry::turn_difference;
use std::f64::consts::FRAC_PI_2;

/// Number of reweightings of walls by their distance from the mean.
const REWEIGHTINGS: usize = 10;
/// Outlier bound of walls, in multiples of their deviation and the scatter.
const OUTLIER_DEVIATIONS: f64 = 4.0;
/// Ratio of the standard deviation of a normal distribution to the median of the distances from its mean.
const NORMAL_MEDIAN: f64 = 1.4826;

/// Weighted circular mean of the walls near the mode, with these walls and their final weights.
///
/// Walls are weighted by Tukey's biweight of their distance from the mean, so that a wall at an angle has no weight
/// and none is included or excluded abruptly: first within `tolerance`, then within the scatter of the walls.
pub(super) fn circular_mean(walls: &[WallDirection], tolerance: f64) -> Option<(f64, Vec<WallDirection>)> {
    let (mean, _) = mean_of_near(walls, mode(walls, tolerance)?, |_| tolerance)?;
    let scatter = scatter(walls, mean, tolerance);
    mean_of_near(walls, mean, |wall| tolerance.min(OUTLIER_DEVIATIONS * scatter * wall.deviation))
}

/// Scatter of the walls' directions about a mean, relative to their own deviations; at least 1.
///
/// It is the weighted median of the walls within `tolerance`, so outliers have no influence.
pub(super) fn scatter(walls: &[WallDirection], mean: f64, tolerance: f64) -> f64 {
    let mut ratios: Vec<(f64, f64)> = walls
        .iter()
        .map(|wall| (turn_difference(wall.angle, mean, FRAC_PI_2).abs(), wall))
        .filter(|(distance, _)| *distance < tolerance)
        .map(|(distance, wall)| (distance / wall.deviation, wall.length))
        .collect();
    ratios.sort_by(|a, b| a.0.total_cmp(&b.0));
    (NORMAL_MEDIAN * weighted_median(&ratios)).max(1.0)
}

/// Weighted median of rising values with their weights; 0 for none.
///
/// Each value is at the middle of its weight, and between neighbours the median is linear, so that it is continuous
/// where half of the weight is reached exactly.
fn weighted_median(values: &[(f64, f64)]) -> f64 {
    let half = values.iter().map(|(_, weight)| weight).sum::<f64>() / 2.0;
    let mut before: Option<(f64, f64)> = None;
    let mut sum = 0.0;
    for &(value, weight) in values {
        let place = sum + weight / 2.0;
        if place >= half {
            return match before {
                Some((low, from)) if place > from => low + (value - low) * (half - from) / (place - from),
                _ => value,
            };
        }
        before = Some((value, place));
        sum += weight;
    }
    before.map_or(0.0, |(value, _)| value)
}

/// Weighted circular mean of the walls within `limit` of it, from an initial guess.
fn mean_of_near(
    walls: &[WallDirection],
    mut mean: f64,
    limit: impl Fn(&WallDirection) -> f64,
) -> Option<(f64, Vec<WallDirection>)> {
    let mut members = Vec::new();
    for _ in 0..REWEIGHTINGS {
        members = weighted_near(walls, mean, &limit);
        let (sine, cosine) = members.iter().fold((0.0, 0.0), |(sine, cosine), wall| {
            let angle = 4.0 * turn_difference(wall.angle, mean, FRAC_PI_2);
            (sine + wall.weight * angle.sin(), cosine + wall.weight * angle.cos())
        });
        mean += sine.atan2(cosine) / 4.0;
    }
    (!members.is_empty()).then_some((mean, members))
}

/// The walls within their limits of a direction, up to quarter turns, with their weights reduced by the biweight.
fn weighted_near(walls: &[WallDirection], direction: f64, limit: impl Fn(&WallDirection) -> f64) -> Vec<WallDirection> {
    walls
        .iter()
        .filter_map(|wall| {
            let distance = turn_difference(wall.angle, direction, FRAC_PI_2) / limit(wall);
            let weight = wall.weight * (1.0 - distance * distance).powi(2);
            (distance.abs() < 1.0 && weight > 0.0).then_some(WallDirection { weight, ..*wall })
        })
        .collect()
}

/// Middle of the window of twice `tolerance` with most weight, among angles up to quarter turns.
fn mode(walls: &[WallDirection], tolerance: f64) -> Option<f64> {
    let mut folded: Vec<(f64, f64)> =
        walls.iter().map(|wall| (wall.angle.rem_euclid(FRAC_PI_2), wall.weight)).collect();
    folded.sort_by(|a, b| a.0.total_cmp(&b.0));
    let count = folded.len();
    folded.extend_from_within(..);
    folded[count..].iter_mut().for_each(|(angle, _)| *angle += FRAC_PI_2);

    let (mut end, mut weight, mut moment) = (0, 0.0, 0.0);
    let mut best: Option<(f64, f64)> = None;
    for start in 0..count {
        while end < start + count && folded[end].0 <= folded[start].0 + 2.0 * tolerance {
            weight += folded[end].1;
            moment += folded[end].0 * folded[end].1;
            end += 1;
        }
        if weight > 0.0 && best.is_none_or(|(most, _)| weight > most) {
            best = Some((weight, moment / weight));
        }
        weight -= folded[start].1;
        moment -= folded[start].0 * folded[start].1;
    }
    best.map(|(_, angle)| angle)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_median_has_half_of_the_weight_on_either_side() {
        assert_eq!(weighted_median(&[]), 0.0);
        assert_eq!(weighted_median(&[(3.0, 2.0)]), 3.0);
        assert_eq!(weighted_median(&[(1.0, 1.0), (2.0, 1.0), (9.0, 1.0)]), 2.0);
        assert_eq!(weighted_median(&[(1.0, 1.0), (2.0, 1.0)]), 1.5);
        assert_eq!(weighted_median(&[(1.0, 1.0), (2.0, 100.0), (9.0, 1.0)]), 2.0);
    }

    fn wall(degrees: f64, length: f64) -> WallDirection {
        WallDirection { angle: degrees.to_radians(), length, deviation: 0.02 / length, weight: length * length }
    }

    #[test]
    fn consistent_walls_have_a_scatter_of_one_and_inconsistent_ones_more() {
        let walls = |degrees: f64| -> Vec<WallDirection> {
            (0..40).map(|i| wall(degrees * (f64::from(i) * 2.4).sin() + 90.0 * f64::from(i % 4), 4.0)).collect()
        };
        assert_eq!(scatter(&walls(0.2), 0.0, 0.1), 1.0);
        let deformed = scatter(&walls(2.0), 0.0, 0.1);
        assert!(deformed > 5.0 && deformed < 9.0, "{deformed}");
        assert_eq!(scatter(&[], 0.0, 0.1), 1.0);
    }

    #[test]
    fn a_long_wall_at_an_odd_angle_has_no_weight_among_walls_that_agree() {
        let mut walls: Vec<WallDirection> = (0..10).map(|i| wall(10.0 + 0.02 * f64::from(i % 3), 4.0)).collect();
        walls.push(wall(12.0, 6.0));
        let (mean, members) = circular_mean(&walls, 0.09).unwrap();
        assert!((mean.to_degrees() - 10.02).abs() < 0.01, "{}", mean.to_degrees());
        assert_eq!(members.len(), 10);
        // Where all walls scatter by as much, it is one of them.
        let deformed: Vec<WallDirection> = (0..10).map(|i| wall(9.0 + 0.3 * f64::from(i), 4.0)).collect();
        assert_eq!(circular_mean(&deformed, 0.09).unwrap().1.len(), 10);
    }

    proptest! {
        #[test]
        fn the_median_is_one_of_the_values_or_between_two(
            mut values in prop::collection::vec((0.0..9.0f64, 0.1..3.0f64), 1..20),
        ) {
            values.sort_by(|a, b| a.0.total_cmp(&b.0));
            let median = weighted_median(&values);
            let weight = |wanted: &dyn Fn(f64) -> bool| -> f64 {
                values.iter().filter(|(value, _)| wanted(*value)).map(|(_, weight)| weight).sum()
            };
            let half = weight(&|_| true) / 2.0 + 1e-9;
            prop_assert!(weight(&|value| value < median - 1e-9) <= half + 1.5);
            prop_assert!(weight(&|value| value > median + 1e-9) <= half + 1.5);
            prop_assert!(median >= values[0].0 && median <= values[values.len() - 1].0);
        }
    }
}
