//! The rounds in which the deformations of all maps are estimated together.

use super::DeformationParameters;
use super::body::Body;
use super::contacts::{Contacts, DeformedBody, contacts};
use super::equations::{Equations, Solution, Unknowns};
use crate::shared::deformation::Deformation;
use crate::shared::geometry::Point2;
use crate::shared::sparse::minimum_degree;
use nalgebra::Vector2;
use rayon::prelude::*;
use std::sync::Arc;

/// Largest distance of walls in each round, as a share of the reach: wide at first, when the maps are rigid, and at
/// the end about the error with which a wall is drawn.
const ROUNDS: [f64; 8] = [1.0, 1.0, 0.7, 0.5, 0.35, 0.25, 0.18, 0.15];
/// Rounds of all maps together, where only some of them had to be aligned first.
const LAST_ROUNDS: usize = 2;

/// Result of the last round.
pub(super) struct Estimate<'a> {
    pub(super) bodies: Vec<DeformedBody<'a>>,
    /// Whether it depends on deformations that were known before.
    pub(super) started_from_known: bool,
    pub(super) last: Round,
}

/// Result of one round.
pub(super) struct Round {
    /// Contacts of the walls, for each pair of maps.
    pub(super) walls: Vec<Contacts>,
    /// Length of wall of each body on walls of others, metres.
    pub(super) matched: Vec<f64>,
    /// The prior, without walls.
    pub(super) of_deformations: Equations,
    /// The solution of both.
    pub(super) solution: Solution,
}

/// Estimates the deformations of all bodies. Where most of them are known from before, the others are first aligned
/// with them, and then all together. `None` if the equations have no solution, or one that is not finite.
pub(super) fn estimate<'a>(bodies: &'a [Body<'a>], parameters: &DeformationParameters) -> Option<Estimate<'a>> {
    let rounds = Rounds::new(bodies, parameters);
    let nodes = |is_counted: fn(&Body<'_>) -> bool| -> usize {
        bodies.iter().filter(|body| is_counted(body)).map(|body| body.shape.lattice.len()).sum()
    };
    let started_from_known =
        nodes(|body| body.known.is_some() && !body.is_kept) > nodes(|body| body.known.is_none() && !body.is_kept);
    let mut first = 0;
    let deformed = bodies.iter().map(|body| {
        let known = body.known.clone().filter(|_| started_from_known || body.is_kept);
        let deformation = known.unwrap_or_else(|| Deformation::none(body.shape.lattice.clone()));
        first += deformation.moves.len();
        DeformedBody::new(body, deformation, first - body.shape.lattice.len())
    });
    let mut deformed: Vec<DeformedBody<'_>> = deformed.collect();
    let is_kept: Vec<bool> = bodies.iter().map(|body| body.is_kept).collect();
    let mut shares = &ROUNDS[..];
    if started_from_known {
        let is_given: Vec<bool> = bodies.iter().map(|body| body.is_kept || body.known.is_some()).collect();
        if is_given.contains(&false) {
            for share in ROUNDS {
                rounds.round(&mut deformed, &is_given, share)?;
            }
        }
        shares = &ROUNDS[ROUNDS.len() - LAST_ROUNDS..];
    }
    let mut last = None;
    for share in shares {
        last = Some(rounds.round(&mut deformed, &is_kept, *share)?);
    }
    let started_from_known = started_from_known || bodies.iter().any(Body::is_held);
    Some(Estimate { bodies: deformed, started_from_known, last: last? })
}

/// What all rounds have in common.
struct Rounds<'a> {
    bodies: &'a [Body<'a>],
    parameters: &'a DeformationParameters,
    /// Bodies that are near each other, in both orders.
    pairs: Vec<(usize, usize)>,
}

impl<'a> Rounds<'a> {
    fn new(bodies: &'a [Body<'a>], parameters: &'a DeformationParameters) -> Self {
        let boxes: Vec<Option<[Point2; 2]>> = bodies.iter().map(|body| known_box(body, parameters.reach)).collect();
        let is_below = |low: &Point2, high: &Point2| low.x <= high.x && low.y <= high.y;
        let meet = |a: usize, b: usize| {
            a != b && boxes[a].zip(boxes[b]).is_some_and(|(a, b)| is_below(&a[0], &b[1]) && is_below(&b[0], &a[1]))
        };
        let pairs = (0..bodies.len()).flat_map(|a| (0..bodies.len()).map(move |b| (a, b)));
        let pairs = pairs.filter(|&(a, b)| meet(a, b)).collect();
        Self { bodies, parameters, pairs }
    }

    /// Deforms the bodies again, but for those that are given, so that walls that are near each other are aligned.
    /// `None` if the equations have no solution, or one that is not finite.
    fn round(&self, deformed: &mut [DeformedBody<'_>], is_given: &[bool], share: f64) -> Option<Round> {
        let Self { bodies, parameters, pairs } = self;
        let pairs: Vec<(usize, usize)> =
            pairs.iter().copied().filter(|&(a, b)| !(is_given[a] && is_given[b])).collect();
        let find = |&(a, b): &(usize, usize)| contacts(&deformed[a], &deformed[b], share * parameters.reach);
        let walls: Vec<Contacts> = pairs.par_iter().map(find).collect();
        let given = deformed.iter().flat_map(|body| body.deformation.moves.iter().copied()).collect();
        // Contacts change from round to round, and with them the order that leaves the factor sparse.
        let unknowns = Arc::new(Unknowns::new(order(deformed, is_given, &walls), given));
        let of_deformations = Equations::of_deformations(bodies, &unknowns, parameters);
        let mut equations = of_deformations.clone();
        walls.iter().for_each(|contacts| contacts.add_to(&mut equations));
        let solution = equations.solve()?;
        if !solution.moves.iter().all(|by| by.iter().all(|value| value.is_finite())) {
            return None;
        }
        deformed.par_iter_mut().zip(is_given).filter(|(_, is_given)| !**is_given).for_each(|(body, _)| {
            let lattice = body.deformation.lattice.clone();
            let moves = solution.moves[body.first..body.first + lattice.len()].to_vec();
            body.deform(Deformation { lattice, moves });
        });
        let mut matched = vec![0.0; bodies.len()];
        pairs.iter().zip(&walls).for_each(|(&(_, b), contacts)| matched[b] += contacts.length);
        Some(Round { walls, matched, of_deformations, solution })
    }
}

/// Place of each node in the elimination order. None for those of bodies that are given.
fn order(deformed: &[DeformedBody<'_>], is_given: &[bool], walls: &[Contacts]) -> Vec<Option<usize>> {
    let mut numbers = Vec::new();
    let mut count = 0;
    for (body, is_given) in deformed.iter().zip(is_given) {
        for _ in &body.deformation.moves {
            numbers.push((!is_given).then_some(count));
            count += usize::from(!is_given);
        }
    }
    // Nodes with a common equation.
    let edges = deformed
        .iter()
        .flat_map(|body| body.deformation.lattice.edges().map(|(i, j)| [body.first + i, body.first + j]));
    let edges: Vec<[usize; 2]> = edges.collect();
    let groups =
        edges.iter().map(|nodes| &nodes[..]).chain(walls.iter().flat_map(Contacts::nodes).map(|nodes| &nodes[..]));
    let mut groups_of: Vec<Vec<&[usize]>> = vec![Vec::new(); count];
    for group in groups {
        group.iter().filter_map(|&node| numbers[node]).for_each(|number| groups_of[number].push(group));
    }
    let mut seen_by = vec![usize::MAX; count];
    let neighbours_of = |(number, groups): (usize, &Vec<&[usize]>)| {
        seen_by[number] = number;
        let others = groups.iter().flat_map(|group| *group).filter_map(|&node| numbers[node]);
        others.filter(|&other| std::mem::replace(&mut seen_by[other], number) != number).collect()
    };
    let places = minimum_degree(groups_of.iter().enumerate().map(neighbours_of).collect());
    numbers.into_iter().map(|number| number.map(|number| places[number])).collect()
}

/// Lower and upper corner of a rectangle of the world that holds everything within `reach` of the walls of a body.
fn known_box(body: &Body<'_>, reach: f64) -> Option<[Point2; 2]> {
    let mut points = body.walls.walls.points().iter().map(|point| body.transform_world_map * point);
    let first = points.next()?;
    let [low, high] = points.fold([first; 2], |[low, high], point| [low.inf(&point), high.sup(&point)]);
    let margin = Vector2::repeat(reach);
    Some([low - margin, high + margin])
}
