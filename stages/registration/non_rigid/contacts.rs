//! Correspondences of the walls of two maps, as equations for the nodes around them.

use super::body::{Body, WallPoint};
use super::equations::Equations;
use crate::shared::deformation::{Corners, Deformation, node_jacobian};
use crate::shared::geometry::{Point2, PointIndex};
use crate::shared::walls::{CORRELATION_LENGTH, DEVIATION, stride};
use nalgebra::{Matrix3, RowVector3, Vector2, Vector3};
use std::collections::BTreeMap;

/// Most points of the walls of a map that are looked up in another.
const MOST_POINTS: usize = 12_000;
/// Least spacing of the points that are looked up, metres; and their spacing as a share of the reach, as matches far
/// away need not be known to a few centimetres. Both are below the length of wall that counts as one measurement.
const LEAST_SPACING: f64 = 0.25;
const SPACING_BY_REACH: f64 = 0.25;

/// Nodes of one contact: four of each map.
const NODES: usize = 8;
/// Pairs of them, each once.
const PAIRS: usize = NODES * (NODES + 1) / 2;

/// Sum of the contacts of the same nodes.
struct Sum {
    nodes: [usize; NODES],
    /// Of each node with those before it and with itself.
    information: [Matrix3<f64>; PAIRS],
    vector: [Vector3<f64>; NODES],
}

/// Contacts of the walls of map b with walls of map a within `reach`.
pub(super) struct Contacts {
    sums: Vec<Sum>,
    /// Length of wall of map b on walls of map a, metres, weighted by contact.
    pub(super) length: f64,
}

/// A map with its current deformation.
pub(super) struct DeformedBody<'a> {
    body: &'a Body<'a>,
    pub(super) deformation: Deformation,
    /// Index of its first node among those of all maps.
    pub(super) first: usize,
    /// Points of the walls, world; not a number where there is no node around.
    points: Vec<Point2>,
    /// The same points for the search of the nearest, and the place of each of them in `points`.
    index: (PointIndex, Vec<usize>),
}

impl<'a> DeformedBody<'a> {
    /// A map with a deformation, and the index of its first node among those of all maps.
    pub(super) fn new(body: &'a Body<'a>, deformation: Deformation, first: usize) -> Self {
        let in_world = |point: &WallPoint| match &point.corners {
            Some(corners) => body.transform_world_map * deformation.apply_at(&point.at, corners),
            None => Point2::new(f64::NAN, f64::NAN),
        };
        let points: Vec<Point2> = body.shape.points.iter().map(in_world).collect();
        let index = PointIndex::new(&points, body.walls.walls.buckets().side);
        Self { body, deformation, first, points, index }
    }

    /// The contact of a point of map b with a point of the index of this one; none if they are not the same face of a
    /// wall.
    fn contact<'b>(&'b self, partner: usize, b: &'b Self, place: usize) -> Option<Contact<'b>> {
        let (of_a_world, of_b_world) = (&self.body.transform_world_map, &b.body.transform_world_map);
        let point = &b.body.shape.points[place];
        let (points, order) = &self.index;
        let other = &self.body.shape.points[order[partner]];
        let normal = of_a_world * other.normal;
        let cosine = normal.dot(&(of_b_world * point.normal));
        if !other.seen.fit(point.seen, cosine) {
            return None;
        }
        Some(Contact {
            of_a: other.corners.as_ref()?,
            of_b: point.corners.as_ref()?,
            partner: other.at,
            normal,
            point: point.at,
            residual: normal.dot(&(b.points[place] - points.points()[partner])),
            target: normal.dot(&(of_a_world * other.at - of_b_world * point.at)),
        })
    }

    /// Deforms it otherwise.
    pub(super) fn deform(&mut self, deformation: Deformation) {
        *self = Self::new(self.body, deformation, self.first);
    }
}

/// Looks the walls of map b up in map a. A pair at a distance of `reach` metres counts a quarter of one at distance
/// 0, and farther ones count nothing.
pub(super) fn contacts(a: &DeformedBody<'_>, b: &DeformedBody<'_>, reach: f64) -> Contacts {
    let (length, found) = find_all(a, b, reach);
    // Both maps are looked up in each other, so each counts one half.
    let weight = 0.5 * (length / CORRELATION_LENGTH).min(1.0) / DEVIATION.powi(2);
    let mut sums: Vec<Sum> = Vec::new();
    let mut number_of: BTreeMap<[usize; NODES], usize> = BTreeMap::new();
    let mut matched = 0.0;
    for contact in found {
        let kernel = (1.0 / (1.0 + (contact.residual / reach).powi(2))).powi(2);
        matched += kernel * length;
        let nodes = contact.nodes(a.first, b.first);
        let number = *number_of.entry(nodes).or_insert(sums.len());
        if number == sums.len() {
            let information = [Matrix3::zeros(); PAIRS];
            sums.push(Sum { nodes, information, vector: [Vector3::zeros(); NODES] });
        }
        sums[number].add(&contact.row(a, b), contact.target, weight * kernel);
    }
    Contacts { sums, length: matched }
}

impl Sum {
    /// Adds an equation: the product of its row with the moves of the nodes is to be `target`.
    fn add(&mut self, row: &[Vector3<f64>; NODES], target: f64, weight: f64) {
        let mut pairs = self.information.iter_mut();
        for (node, of_node) in row.iter().enumerate() {
            let weighted = weight * of_node;
            self.vector[node] += target * weighted;
            for (of_other, information) in row[..=node].iter().zip(pairs.by_ref()) {
                *information += weighted * of_other.transpose();
            }
        }
    }
}

/// Distance between two drawings of a wall, across the wall, metres.
pub(super) struct Apart {
    /// With rigid maps.
    pub(super) rigid: f64,
    /// With deformed maps.
    pub(super) deformed: f64,
}

/// Points of the walls of map b within `reach` of walls of map a, with deformation: the length of wall per point,
/// metres, and the distances.
pub(super) fn apart<'a>(
    a: &'a DeformedBody<'a>,
    b: &'a DeformedBody<'a>,
    reach: f64,
) -> (f64, impl Iterator<Item = Apart>) {
    let (length, found) = find_all(a, b, reach);
    (length, found.map(|contact| Apart { rigid: contact.target.abs(), deformed: contact.residual.abs() }))
}

impl Contacts {
    /// Adds the contacts to the equations.
    pub(super) fn add_to(&self, equations: &mut Equations) {
        for Sum { nodes, information, vector } in &self.sums {
            let mut pairs = information.iter();
            for (place, (&node, part)) in nodes.iter().zip(vector).enumerate() {
                equations.add_vector(node, part);
                for (&other, block) in nodes[..=place].iter().zip(pairs.by_ref()) {
                    equations.add(node, other, block);
                }
            }
        }
    }

    /// Indices of the nodes of each equation.
    pub(super) fn nodes(&self) -> impl Iterator<Item = &[usize; NODES]> {
        self.sums.iter().map(|sum| &sum.nodes)
    }
}

/// A point of map b on a wall of map a.
struct Contact<'a> {
    of_a: &'a Corners,
    of_b: &'a Corners,
    /// Point of the wall of map a, map frame, and its normal, world.
    partner: Point2,
    normal: Vector2<f64>,
    /// Point of map b, map frame.
    point: Point2,
    /// Signed distance of the point from the wall with the current deformation, metres.
    residual: f64,
    /// The same without deformation, which the moves of the nodes are to explain.
    target: f64,
}

/// Points of the walls of map b with their partners in map a, and the length of wall per point, metres.
fn find_all<'a>(
    a: &'a DeformedBody<'a>,
    b: &'a DeformedBody<'a>,
    reach: f64,
) -> (f64, impl Iterator<Item = Contact<'a>>) {
    let points = &b.body.shape.points;
    let spacing = LEAST_SPACING.max((SPACING_BY_REACH * reach).min(CORRELATION_LENGTH));
    let every = stride(points.len(), MOST_POINTS).max((spacing / b.body.walls.spacing).round() as usize);
    // All partners first: what is read of them then waits for each other less. That of the point before may be near.
    let mut partners = Vec::with_capacity(points.len() / every + 1);
    let mut last_partner = usize::MAX;
    for (place, in_world) in b.points.iter().enumerate().step_by(every) {
        if let Some(nearest) = a.index.0.nearest_from(in_world, reach, last_partner) {
            last_partner = nearest.index;
            partners.push((place, last_partner));
        }
    }
    let found = partners.into_iter().filter_map(|(place, partner)| a.contact(partner, b, place));
    (every as f64 * b.body.walls.spacing, found)
}

impl Contact<'_> {
    /// Indices of its nodes among those of all maps.
    fn nodes(&self, first_a: usize, first_b: usize) -> [usize; NODES] {
        std::array::from_fn(|place| match place < 4 {
            true => first_a + self.of_a[place].0,
            false => first_b + self.of_b[place - 4].0,
        })
    }

    /// Derivative of the distance of the point from the wall with respect to the move of each node.
    fn row(&self, a: &DeformedBody<'_>, b: &DeformedBody<'_>) -> [Vector3<f64>; NODES] {
        let of_end = |deformed: &DeformedBody<'_>, corners: &Corners, point: &Point2, sign: f64| {
            let normal = deformed.body.transform_world_map.inverse_transform_vector(&self.normal).transpose();
            corners.map(|(node, weight)| {
                let arm = point - deformed.body.shape.lattice.position(node);
                let by_node: RowVector3<f64> = normal * node_jacobian(&arm);
                (sign * weight * by_node).transpose()
            })
        };
        let (of_a, of_b) = (of_end(a, self.of_a, &self.partner, -1.0), of_end(b, self.of_b, &self.point, 1.0));
        std::array::from_fn(|place| if place < 4 { of_a[place] } else { of_b[place - 4] })
    }
}
