//! Translation between two maps from the votes of their edges, with its covariance.

use super::{Edge, EdgeMatcherParameters, Election, MatchRefusal, votes};
use gridweave_stages::shared::geometry::{Point2, Pose2, covariance_about};
use nalgebra::{Matrix2, Matrix3, UnitComplex, Vector2};
use std::collections::BTreeSet;

/// The translation from matched edges.
#[derive(Clone, Debug, PartialEq)]
pub struct EdgeMatch {
    /// `T_a_b`: the given rotation, and the translation.
    pub transform_a_b: Pose2,
    /// Covariance of (x, y, yaw), metres and radians.
    pub covariance: Matrix3<f64>,
    /// Edges of map a and of map b that vote for it.
    pub edges: [usize; 2],
    /// Weight of the second-best translation as a share of its votes, 0 to 1.
    pub second_best: f64,
}

impl EdgeMatch {
    /// Reason for the user.
    pub fn reason(&self) -> String {
        let [a, b] = self.edges;
        let percent = 100.0 * self.second_best;
        format!(
            "edges of the topological maps: {a} of one and {b} of the other agree on the translation, and the best other one \
             gathers {percent:.0} % of their votes"
        )
    }
}

/// Finds the translation of map b, turned by a rotation with a variance in square radians, on map a.
///
/// # Errors
/// Too few edges agree on any translation, or a second-best one has nearly as many votes.
pub fn match_edges(
    a: &[Edge],
    b: &[Edge],
    rotation: &UnitComplex<f64>,
    yaw_variance: f64,
    parameters: &EdgeMatcherParameters,
) -> Result<EdgeMatch, MatchRefusal> {
    let votes = votes(a, b, rotation, parameters);
    let too_few = |found| MatchRefusal::TooFewEdges { found, least: parameters.min_edges };
    let election = Election::of(&votes, parameters.vote_radius).ok_or(too_few(0))?;
    let taking_part = |map: usize| {
        let edges: BTreeSet<usize> = election.votes.iter().map(|vote| votes[*vote].edges[map]).collect();
        edges.len()
    };
    let edges = [taking_part(0), taking_part(1)];
    if edges[0].min(edges[1]) < parameters.min_edges {
        return Err(too_few(edges[0].min(edges[1])));
    }
    let second_best = election.second_best();
    if second_best > parameters.max_runner_up {
        return Err(MatchRefusal::Ambiguous { percent: 100.0 * second_best, most: 100.0 * parameters.max_runner_up });
    }
    let mean = |value: &dyn Fn(usize) -> Vector2<f64>| {
        let sum = election.votes.iter().fold(Vector2::zeros(), |sum, vote| sum + value(*vote) * votes[*vote].weight);
        sum / election.weight
    };
    let middle_b = mean(&|vote| b[votes[vote].edges[1]].middle.coords);
    let residual = mean(&|vote| Vector2::repeat(votes[vote].residual.powi(2))).x;
    // A vote is the mean of points at a distance of its residual; half of that variance is along each axis.
    let of_place = election.spread + Matrix2::from_diagonal_element(0.5 * residual);
    let transform_a_b = Pose2::from_parts(election.translation.into(), *rotation);
    Ok(EdgeMatch {
        transform_a_b,
        covariance: covariance_about(&transform_a_b, &Point2::from(middle_b), &of_place, yaw_variance),
        edges,
        second_best,
    })
}
