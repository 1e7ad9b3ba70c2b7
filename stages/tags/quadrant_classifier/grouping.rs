//! The two groups of parallel walls (section 4.1.2 of Tsardoulias et al.).

use super::walls::WallDirection;
use crate::shared::geometry::turn_difference;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

/// The group of a wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WallGroup {
    /// Within 45 degrees of the first wall, up to half turns.
    First,
    /// The rest.
    Second,
}

/// Groups directions, radians, and brings each group to one quadrant by half turns: tables 1 and 2.
///
/// The first direction is unchanged and starts the first group; the second group is in the quadrant of the first
/// direction that belongs to it.
pub fn classify(angles: &[f64]) -> Vec<(WallGroup, f64)> {
    let Some(&first) = angles.first() else { return Vec::new() };
    let mut second_centre = None;
    angles
        .iter()
        .map(|&angle| {
            let offset = turn_difference(angle, first, PI);
            if offset.abs() <= FRAC_PI_4 {
                return (WallGroup::First, first + offset);
            }
            let side = turn_difference(angle, first, TAU).signum();
            let centre = *second_centre.get_or_insert(first + side * FRAC_PI_2);
            (WallGroup::Second, centre + turn_difference(angle, centre, PI))
        })
        .collect()
}

/// Directions of the two groups, radians: equation 4. `None` if no wall has a weight.
///
/// A group without walls is at a right angle to the other.
pub(super) fn group_directions(walls: &[WallDirection]) -> Option<[f64; 2]> {
    let angles: Vec<f64> = walls.iter().map(|wall| wall.angle).collect();
    let classified = classify(&angles);
    let mean = |group: WallGroup| {
        let members = || classified.iter().zip(walls).filter(move |((of, _), _)| *of == group);
        let weight: f64 = members().map(|(_, wall)| wall.weight).sum();
        let sum: f64 = members().map(|((_, angle), wall)| angle * wall.weight).sum();
        (weight > 0.0).then(|| sum / weight)
    };
    match (mean(WallGroup::First), mean(WallGroup::Second)) {
        (Some(first), Some(second)) => Some([first, second]),
        (Some(first), None) => Some([first, first + FRAC_PI_2]),
        (None, Some(second)) => Some([second - FRAC_PI_2, second]),
        (None, None) => None,
    }
}

/// Mean of the two groups' directions, the paper's direction of a map. It is half way between the two, 45 degrees
/// from either.
pub(super) fn bisector(groups: [f64; 2]) -> f64 {
    (groups[0] + groups[1]) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn walls(degrees_and_weights: &[(f64, f64)]) -> Vec<WallDirection> {
        let wall = |&(angle, weight): &(f64, f64)| WallDirection {
            angle: angle.to_radians(),
            length: weight,
            deviation: 0.01,
            weight,
        };
        degrees_and_weights.iter().map(wall).collect()
    }

    #[test]
    fn an_empty_group_is_at_a_right_angle_to_the_other() {
        let groups = group_directions(&walls(&[(10.0, 1.0), (-170.0, 1.0)])).unwrap();
        assert!((groups[0].to_degrees() - 10.0).abs() < 1e-9 && (groups[1].to_degrees() - 100.0).abs() < 1e-9);
        let groups = group_directions(&walls(&[(10.0, 0.0), (100.0, 1.0)])).unwrap();
        assert!((groups[0].to_degrees() - 10.0).abs() < 1e-9 && (groups[1].to_degrees() - 100.0).abs() < 1e-9);
        assert_eq!(group_directions(&walls(&[(10.0, 0.0)])), None);
        assert_eq!(group_directions(&[]), None);
    }

    proptest! {
        #[test]
        fn grouping_adds_half_turns_only_and_leaves_each_group_within_one_quadrant(
            angles in prop::collection::vec(-PI..PI, 1..30),
        ) {
            let classified = classify(&angles);
            for (&angle, &(group, brought)) in angles.iter().zip(&classified) {
                let half_turns = (brought - angle) / PI;
                prop_assert!((half_turns - half_turns.round()).abs() < 1e-9);
                let from_first = turn_difference(brought, angles[0], PI).abs();
                prop_assert_eq!(group == WallGroup::First, from_first <= FRAC_PI_4);
            }
            for group in [WallGroup::First, WallGroup::Second] {
                let members = || classified.iter().filter(move |(of, _)| *of == group).map(|(_, angle)| *angle);
                let span = members().fold(f64::NEG_INFINITY, f64::max) - members().fold(f64::INFINITY, f64::min);
                prop_assert!(members().count() == 0 || span <= FRAC_PI_2 + 1e-9);
            }
        }
    }
}
