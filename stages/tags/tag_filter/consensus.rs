//! The largest set of tags that agree on one rigid transform.

use crate::shared::geometry::{Point2, PointPair, RigidFit, fit_rigid};
use gridweave_runtime::ros::CommonTag;
use nalgebra::{Matrix2, Vector2};
use std::collections::BTreeMap;

/// Pairs among this many first tags are tried as hypotheses; all tags may join a consensus.
const MOST_SEEDS: usize = 60;
/// Most rounds; a set that still changes then oscillates.
const MOST_ROUNDS: usize = 20;

/// One tag in two maps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TagPair {
    /// Position in map a, metres.
    pub a: Point2,
    /// Position in map b, metres.
    pub b: Point2,
    /// Covariance of `a`, square metres, including that of the map.
    pub covariance_a: Matrix2<f64>,
    /// Covariance of `b`, square metres, including that of the map.
    pub covariance_b: Matrix2<f64>,
}

impl TagPair {
    /// The pair of a common tag; `map_stddev` is the standard deviation by the deformation of both maps, metres.
    pub fn new(tag: &CommonTag, map_stddev: f64) -> Self {
        let covariance = |[xx, xy, yx, yy]: [f64; 4]| {
            let cross = 0.5 * (xy + yx);
            // Half of the variance is that of each map.
            Matrix2::new(xx, cross, cross, yy) + Matrix2::from_diagonal_element(0.5 * map_stddev * map_stddev)
        };
        Self {
            a: tag.a.into(),
            b: tag.b.into(),
            covariance_a: covariance(tag.covariance_a),
            covariance_b: covariance(tag.covariance_b),
        }
    }

    /// `a - T_a_b * b`, metres.
    pub fn residual(&self, fit: &RigidFit) -> Vector2<f64> {
        self.a - fit.transform_a_b * self.b
    }

    /// Mean variance of `a - T_a_b * b` over both axes, square metres.
    pub fn variance(&self) -> f64 {
        0.5 * (self.covariance_a.trace() + self.covariance_b.trace())
    }

    /// Distance of the tag from another one, metres: in map a and in map b.
    pub fn lengths(&self, other: &Self) -> [f64; 2] {
        [(self.a - other.a).norm(), (self.b - other.b).norm()]
    }

    /// Whether the two lengths are equal up to `gate` standard deviations along the line through the two tags.
    pub fn lengths_agree(&self, other: &Self, gate: f64) -> bool {
        let [length_a, length_b] = self.lengths(other);
        let along = |arm: Vector2<f64>, covariance: Matrix2<f64>| arm.dot(&(covariance * arm)) / arm.norm_squared();
        let variance = along(self.a - other.a, self.covariance_a + other.covariance_a)
            + along(self.b - other.b, self.covariance_b + other.covariance_b);
        (length_a - length_b).powi(2) <= gate * gate * variance
    }

    /// Squared Mahalanobis distance of `a` from `T_a_b * b`, with `extra` added to the covariance. Not finite if the
    /// covariance has no inverse.
    fn mahalanobis_squared(&self, fit: &RigidFit, extra: &Matrix2<f64>) -> f64 {
        let rotation = fit.transform_a_b.rotation.to_rotation_matrix();
        let turned = rotation.matrix() * self.covariance_b * rotation.matrix().transpose();
        let residual = self.residual(fit);
        match (self.covariance_a + turned + extra).try_inverse() {
            Some(information) => residual.dot(&(information * residual)),
            None => f64::INFINITY,
        }
    }
}

/// Tags that agree on a transform.
#[derive(Clone, Debug, PartialEq)]
pub struct TagConsensus {
    /// Indices of the tags, rising.
    pub members: Vec<usize>,
    /// The transform that fits them best.
    pub fit: RigidFit,
    /// Sum of their squared Mahalanobis distances.
    pub cost: f64,
}

/// Result of the search for a consensus.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ConsensusSearch {
    /// The set with the most tags; of equals the one that fits best.
    pub best: Option<TagConsensus>,
    /// The largest set on another transform, one that moves some tag of the two sets by more than the rival distance.
    pub rival: Option<TagConsensus>,
}

/// Finds the largest set of tags whose positions agree under one rigid transform, each within `gate` standard
/// deviations.
///
/// Every two tags with the same distance in both maps make a hypothesis, which is fitted to all that agree with it
/// until the set is stable. So the result is deterministic, and a set is missed only if no two of its members
/// converge to it. Two transforms are different when they move a tag by more than `rival_distance` metres.
pub fn find_consensus(pairs: &[TagPair], gate: f64, rival_distance: f64) -> ConsensusSearch {
    let seeds = pairs.len().min(MOST_SEEDS);
    let mut found: BTreeMap<Vec<usize>, TagConsensus> = BTreeMap::new();
    for second in 1..seeds {
        for first in 0..second {
            if lengths_may_agree(&pairs[first], &pairs[second], gate)
                && let Some(consensus) = settle(pairs, first, second, gate)
            {
                found.insert(consensus.members.clone(), consensus);
            }
        }
    }
    let rank = |one: &&TagConsensus, other: &&TagConsensus| {
        let size = one.members.len().cmp(&other.members.len());
        size.then(other.cost.total_cmp(&one.cost)).then_with(|| other.members.cmp(&one.members))
    };
    let best = found.values().max_by(rank).cloned();
    let rival = best.as_ref().and_then(|best| {
        let differs = |other: &&TagConsensus| {
            let members = best.members.iter().chain(&other.members);
            let separation = |index: &usize| {
                let b = pairs[*index].b;
                (best.fit.transform_a_b * b - other.fit.transform_a_b * b).norm()
            };
            members.map(separation).any(|distance| distance > rival_distance)
        };
        found.values().filter(differs).max_by(rank).cloned()
    });
    ConsensusSearch { best, rival }
}

/// Necessary condition that two tags are as far from each other in map a as in map b: a bound that rejects no pair
/// within the gate.
fn lengths_may_agree(one: &TagPair, other: &TagPair, gate: f64) -> bool {
    let [length_a, length_b] = one.lengths(other);
    let difference = length_a - length_b;
    // Along any direction the variance of a position is at most the trace of its covariance.
    let variance = 2.0 * (one.variance() + other.variance());
    difference * difference <= gate * gate * variance
}

/// Fits the transform of two tags to all that agree with it, until the set is stable.
fn settle(pairs: &[TagPair], first: usize, second: usize, gate: f64) -> Option<TagConsensus> {
    let mut members = vec![first, second];
    let mut fit = fit_members(pairs, &members)?;
    let mut next = agreeing(pairs, gate, |pair| pair.mahalanobis_squared(&fit, &fit.point_covariance(&pair.b)));
    for _ in 0..MOST_ROUNDS {
        if next == members {
            break;
        }
        members = next;
        fit = fit_members(pairs, &members)?;
        next = agreeing(pairs, gate, |pair| pair.mahalanobis_squared(&fit, &Matrix2::zeros()));
    }
    let cost = members.iter().map(|&index| pairs[index].mahalanobis_squared(&fit, &Matrix2::zeros())).sum();
    Some(TagConsensus { members, fit, cost })
}

fn agreeing(pairs: &[TagPair], gate: f64, distance_squared: impl Fn(&TagPair) -> f64) -> Vec<usize> {
    let agrees = |pair: &TagPair| distance_squared(pair) <= gate * gate;
    pairs.iter().enumerate().filter(|(_, pair)| agrees(pair)).map(|(index, _)| index).collect()
}

fn fit_members(pairs: &[TagPair], members: &[usize]) -> Option<RigidFit> {
    let weighted = |index: &usize| {
        let pair = pairs.get(*index)?;
        Some(PointPair { a: pair.a, b: pair.b, weight: 1.0 / pair.variance() })
    };
    fit_rigid(&members.iter().filter_map(weighted).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::{Pose2, pose};
    use proptest::prelude::*;

    const SHAPE: [(f64, f64); 8] =
        [(0.0, 0.0), (5.0, 1.0), (9.0, -2.0), (3.0, 7.0), (-4.0, 6.0), (-8.0, -1.0), (2.0, -9.0), (11.0, 8.0)];

    fn pairs(transform_a_b: &Pose2, points: &[(f64, f64)]) -> Vec<TagPair> {
        let covariance = Matrix2::from_diagonal_element(0.03 * 0.03);
        let pair = |&(x, y): &(f64, f64)| {
            let b = Point2::new(x, y);
            TagPair { a: transform_a_b * b, b, covariance_a: covariance, covariance_b: covariance }
        };
        points.iter().map(pair).collect()
    }

    proptest! {
        #[test]
        fn moved_tags_are_left_out(
            x in -50.0..50.0, y in -50.0..50.0, yaw in -4.0..4.0, moved in prop::collection::vec(0usize..8, 0..4),
            noise in prop::collection::vec((-0.04..0.04, -0.04..0.04), 8),
        ) {
            let mut pairs = pairs(&pose(x, y, yaw), &SHAPE);
            for (pair, (dx, dy)) in pairs.iter_mut().zip(noise) {
                pair.a += Vector2::new(dx, dy);
            }
            for &index in &moved {
                // Each to a different position.
                pairs[index].a = Point2::new(x + 100.0 + 7.0 * (index * index) as f64, y - 3.0 * index as f64);
            }
            let best = find_consensus(&pairs, 3.5, 0.5).best.unwrap();
            let expected: Vec<usize> = (0..8).filter(|index| !moved.contains(index)).collect();
            prop_assert_eq!(&best.members, &expected);
            let error = best.fit.transform_a_b.inverse() * pose(x, y, yaw);
            prop_assert!(error.translation.vector.norm() < 0.2 && error.rotation.angle().abs() < 0.03);
        }
    }

    #[test]
    fn lengths_are_compared_along_the_line_through_two_tags() {
        let mut two = pairs(&pose(1.0, 2.0, 0.5), &[(0.0, 0.0), (8.0, 0.0)]);
        let along = two[1].a - two[0].a;
        two[1].a += along.normalize() * 0.2;
        // Four times 0.03 m squared: a standard deviation of 0.06 m.
        assert!(two[0].lengths_agree(&two[1], 3.5) && !two[0].lengths_agree(&two[1], 3.0));
        let [length_a, length_b] = two[0].lengths(&two[1]);
        assert!((length_a - length_b - 0.2).abs() < 1e-9);
        // A large variance across the line does not matter.
        two.iter_mut().for_each(|pair| pair.covariance_b.m22 = 1.0);
        assert!(!two[0].lengths_agree(&two[1], 3.0));
        two.iter_mut().for_each(|pair| pair.covariance_b.m11 = 1.0);
        assert!(two[0].lengths_agree(&two[1], 3.0));
    }

    #[test]
    fn tags_on_a_line_agree() {
        let line = [(0.0, 0.0), (2.0, 1.0), (4.0, 2.0), (10.0, 5.0)];
        let best = find_consensus(&pairs(&pose(1.0, 2.0, 0.5), &line), 3.5, 0.5).best.unwrap();
        assert_eq!(best.members, [0, 1, 2, 3]);
    }

    #[test]
    fn two_halves_on_two_transforms_are_rivals() {
        let mut all = pairs(&pose(1.0, 2.0, 0.5), &SHAPE[..4]);
        all.extend(pairs(&pose(9.0, 2.0, 1.5), &SHAPE[4..]));
        let search = find_consensus(&all, 3.5, 0.5);
        assert_eq!(search.best.unwrap().members.len(), 4);
        assert_eq!(search.rival.unwrap().members.len(), 4);
    }

    #[test]
    fn less_than_two_tags_have_no_consensus() {
        assert_eq!(find_consensus(&[], 3.5, 0.5), ConsensusSearch::default());
        for count in [1, 5] {
            let same = vec![(1.0, 1.0); count];
            assert_eq!(find_consensus(&pairs(&pose(0.0, 0.0, 0.0), &same), 3.5, 0.5), ConsensusSearch::default());
        }
    }
}
