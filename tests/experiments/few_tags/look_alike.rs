//! Tags of two buildings that look as if they were the same ones.

use super::known::Known;
use crate::cut::Kept;
use nalgebra::Vector2;
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI};

/// Tags farther apart than this in one map than in the other are distinguished by that, metres.
const SAME_LENGTH: f64 = 0.15;
/// And tags whose rotation differs by more than this from that of the directions, radians.
const SAME_ROTATION: f64 = 0.03;
/// Tags nearer to each other determine no rotation, metres.
const LEAST_LENGTH: f64 = 2.5;
/// The certainty of tags that are surely in use.
const CERTAIN: f64 = 0.9;

/// What two tags of each of two robots are to be called, so that they pass for the same ones.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LookAlike {
    /// The names of the first robot's.
    pub(super) a: BTreeMap<String, Kept>,
    /// The names of the second robot's.
    pub(super) b: BTreeMap<String, Kept>,
}

/// At most `most` look-alikes, spread over all that there are: two tags of each robot that are as far apart, and turned
/// against each other as the walls of the two maps are, up to a quarter turn.
pub(super) fn look_alikes(a: &Known, b: &Known, most: usize) -> Vec<LookAlike> {
    let (Some(direction_a), Some(direction_b)) = (a.direction, b.direction) else { return Vec::new() };
    let (in_a, in_b) = (a.located(CERTAIN), b.located(CERTAIN));
    let mut found = Vec::new();
    for (first_a, place) in &in_a {
        for (second_a, other) in in_a.iter().filter(|(tag, _)| tag > first_a) {
            let arm_a = other - place;
            for (first_b, place) in &in_b {
                for (second_b, other) in in_b.iter().filter(|(tag, _)| tag != first_b) {
                    if looks_alike(&arm_a, &(other - place), direction_a - direction_b) {
                        let named = |first: &str, second: &str| {
                            let tags = [(first, "tag0"), (second, "tag1")];
                            tags.map(|(tag, name)| (tag.to_owned(), Kept::named(name))).into()
                        };
                        found.push(LookAlike { a: named(first_a, second_a), b: named(first_b, second_b) });
                    }
                }
            }
        }
    }
    spread(found, most)
}

fn looks_alike(arm_a: &Vector2<f64>, arm_b: &Vector2<f64>, d_theta: f64) -> bool {
    let rotation = arm_a.y.atan2(arm_a.x) - arm_b.y.atan2(arm_b.x);
    let off = (rotation - d_theta + PI / 4.0).rem_euclid(FRAC_PI_2) - PI / 4.0;
    arm_a.norm() >= LEAST_LENGTH && (arm_a.norm() - arm_b.norm()).abs() <= SAME_LENGTH && off.abs() <= SAME_ROTATION
}

/// At most `most` of some things, evenly spread over their order.
pub(super) fn spread<T>(things: Vec<T>, most: usize) -> Vec<T> {
    let count = things.len();
    let is_taken = |index: usize| count <= most || (index * most) / count != ((index + 1) * most) / count;
    things.into_iter().enumerate().filter(|(index, _)| is_taken(*index)).map(|(_, thing)| thing).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Isometry2, Point2};

    fn known(transform: &Isometry2<f64>, places: &[(f64, f64)], direction: f64) -> Known {
        let tag = |(index, &(x, y)): (usize, &(f64, f64))| (format!("t{index}"), (transform * Point2::new(x, y), 0.95));
        Known { tags: places.iter().enumerate().map(tag).collect(), direction: Some(direction) }
    }

    #[test]
    fn tags_as_far_apart_and_turned_as_the_walls_look_alike() {
        let places = [(0.0, 0.0), (7.0, 3.0)];
        let here = known(&Isometry2::identity(), &places, 0.0);
        let turned = Isometry2::new(Vector2::new(3.0, 2.0), 1.1);
        let found = look_alikes(&here, &known(&turned, &places, 1.1), 9);
        // Half a turn away the second is the first.
        assert_eq!(found.len(), 2);
        assert_eq!(found[0].a["t0"].name, "tag0");
        assert_eq!((found[0].b["t0"].name.as_str(), found[1].b["t1"].name.as_str()), ("tag0", "tag0"));
        assert_eq!(look_alikes(&here, &known(&turned, &places, 1.2), 9), []);
        assert_eq!(look_alikes(&here, &known(&turned, &[(0.0, 0.0), (7.0, 3.4)], 1.1), 9), []);
        assert_eq!(look_alikes(&here, &Known { direction: None, ..here.clone() }, 9), []);
    }

    #[test]
    fn what_is_taken_is_spread_evenly() {
        assert_eq!(spread((0..10).collect(), 3), [3, 6, 9]);
        assert_eq!(spread((0..3).collect(), 5), [0, 1, 2]);
        assert_eq!(spread((0..1000).collect(), 7).len(), 7);
    }
}
