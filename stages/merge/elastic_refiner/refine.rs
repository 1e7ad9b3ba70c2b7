//! Estimates the deformations of all maps together.

use super::ElasticRefinerParameters;
use super::body::Body;
use super::contacts::{Contacts, DeformedBody, contacts};
use super::drift::{Drift, drift};
use super::equations::{Equations, deformation_cost};
use super::evidence::{Round, gain};
use crate::shared::deformation::Deformation;
use crate::shared::geometry::Point2;
use crate::shared::sparse::Dissection;
use nalgebra::Matrix3;
use rayon::prelude::*;
use std::sync::Arc;

/// Largest distance of walls in each round, as a share of the reach: wide at first, when the maps are rigid, and at
/// the end about the error with which a wall is drawn.
const ROUNDS: [f64; 8] = [1.0, 1.0, 0.7, 0.5, 0.35, 0.25, 0.18, 0.15];

/// Deformation of one map.
#[derive(Clone, Debug)]
pub struct RefinedMap {
    /// The deformation.
    pub deformation: Deformation,
    /// Covariance of each node: (x, y, turn), metres and radians.
    pub covariances: Vec<Matrix3<f64>>,
    /// Length of its walls on walls of others, metres.
    pub wall_matched: f64,
    /// Cost of the deformation: the logarithm of how much likelier none is, half the squared deformations between
    /// neighbouring nodes in standard deviations.
    pub cost: f64,
    /// Drift of the map; none if its walls constrain it too little.
    pub drift: Option<Drift>,
}

/// Deformations of all maps.
#[derive(Clone, Debug)]
pub struct Refinement {
    /// One for each body.
    pub maps: Vec<RefinedMap>,
    /// Logarithm of the evidence ratio of deformed to rigid maps. If it is not above 0, `maps` fits the noise of
    /// walls.
    pub gain: f64,
}

impl Refinement {
    /// The deformations if the evidence supports them; else none, with the same covariances.
    #[must_use]
    pub fn if_supported(self) -> Vec<RefinedMap> {
        if self.gain > 0.0 { self.maps } else { self.maps.into_iter().map(RefinedMap::undeformed).collect() }
    }
}

impl RefinedMap {
    fn undeformed(self) -> Self {
        let deformation = Deformation::none(self.deformation.lattice);
        Self { deformation, cost: 0.0, drift: None, ..self }
    }
}

/// Deforms placed maps so that walls that several of them have are aligned. `None` if the equations have no solution,
/// because numbers are too large.
pub fn refine(bodies: &[Body<'_>], parameters: &ElasticRefinerParameters) -> Option<Refinement> {
    let mut deformations: Vec<Deformation> =
        bodies.iter().map(|body| Deformation::none(body.shape.lattice.clone())).collect();
    let boxes: Vec<Option<[Point2; 2]>> = bodies.iter().map(|body| known_box(body, parameters.reach)).collect();
    let is_below = |low: &Point2, high: &Point2| low.x <= high.x && low.y <= high.y;
    let meet = |a: usize, b: usize| {
        a != b && boxes[a].zip(boxes[b]).is_some_and(|(a, b)| is_below(&a[0], &b[1]) && is_below(&b[0], &a[1]))
    };
    let pairs: Vec<(usize, usize)> =
        (0..bodies.len()).flat_map(|a| (0..bodies.len()).map(move |b| (a, b))).filter(|&(a, b)| meet(a, b)).collect();
    let firsts: Vec<usize> =
        bodies.iter().scan(0, |next, body| Some(std::mem::replace(next, *next + body.shape.lattice.len()))).collect();
    let find = |deformations: &[Deformation], share: f64| -> Vec<Contacts> {
        let deformed =
            |body: usize| DeformedBody { body: &bodies[body], deformation: &deformations[body], first: firsts[body] };
        pairs.par_iter().map(|&(a, b)| contacts(deformed(a), deformed(b), share * parameters.reach)).collect()
    };
    let mut last: Option<Round> = None;
    for share in ROUNDS {
        let walls = find(&deformations, share);
        // Contacts change from round to round, and with them the order that leaves the factor sparse.
        let order = Arc::new(order(bodies, &firsts, &walls));
        let of_deformations = Equations::of_deformations(bodies, &order, parameters);
        let mut equations = of_deformations.clone();
        walls.iter().for_each(|contacts| contacts.add_to(&mut equations));
        let solution = equations.solve()?;
        for (deformation, &first) in deformations.iter_mut().zip(&firsts) {
            let count = deformation.moves.len();
            deformation.moves.copy_from_slice(&solution.moves[first..first + count]);
        }
        last = Some(Round { walls, of_deformations, solution });
    }
    let last = last?;
    let gain = gain(bodies, &last, parameters)?;
    let mut matched = vec![0.0; bodies.len()];
    pairs.iter().zip(&last.walls).for_each(|(&(_, b), contacts)| matched[b] += contacts.length);
    let covariances = last.solution.covariances();
    let refined = |((deformation, wall_matched), &first): ((Deformation, f64), &usize)| RefinedMap {
        covariances: (first..first + deformation.moves.len()).map(|node| covariances.of(node, node)).collect(),
        cost: deformation_cost(&deformation, parameters),
        drift: drift(&deformation, first, &covariances, parameters),
        deformation,
        wall_matched,
    };
    let is_finite = deformations
        .iter()
        .flat_map(|deformation| &deformation.moves)
        .all(|by| by.iter().all(|value| value.is_finite()));
    is_finite
        .then(|| Refinement { maps: deformations.into_iter().zip(matched).zip(&firsts).map(refined).collect(), gain })
}

/// Lower and upper corner of a rectangle of the world that holds everything within `reach` of the walls of a body.
fn known_box(body: &Body<'_>, reach: f64) -> Option<[Point2; 2]> {
    let mut points = body.walls.walls.points().iter().map(|point| body.transform_world_map * point);
    let first = points.next()?;
    let [low, high] = points.fold([first; 2], |[low, high], point| [low.inf(&point), high.sup(&point)]);
    let margin = nalgebra::Vector2::repeat(reach);
    Some([low - margin, high + margin])
}

/// Elimination order of the nodes of all bodies.
fn order(bodies: &[Body<'_>], firsts: &[usize], walls: &[Contacts]) -> Dissection {
    let in_world = |body: &Body<'_>, node: usize| body.transform_world_map * body.shape.lattice.position(node);
    let at: Vec<Point2> =
        bodies.iter().flat_map(|body| (0..body.shape.lattice.len()).map(|node| in_world(body, node))).collect();
    let mut neighbours = vec![Vec::new(); at.len()];
    for (body, first) in bodies.iter().zip(firsts) {
        for (i, j) in body.shape.lattice.edges() {
            neighbours[first + i].push(first + j);
            neighbours[first + j].push(first + i);
        }
    }
    for nodes in walls.iter().flat_map(Contacts::nodes) {
        for &one in nodes {
            neighbours[one].extend(nodes.iter().filter(|&&other| other != one));
        }
    }
    for of_node in &mut neighbours {
        of_node.sort_unstable();
        of_node.dedup();
    }
    Dissection::new(&at, &neighbours)
}
