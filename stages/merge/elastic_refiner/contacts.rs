//! Correspondences of the walls of two maps, as equations for the nodes around them.

use super::body::Body;
use super::equations::Equations;
use crate::shared::deformation::{Corners, Deformation, node_jacobian};
use crate::shared::geometry::Point2;
use crate::shared::walls::{CORRELATION_LENGTH, DEVIATION, stride};
use nalgebra::{RowVector3, SMatrix, SVector, Vector2};
use std::collections::BTreeMap;

/// Most points of the walls of a map that are looked up in another.
const MOST_POINTS: usize = 12_000;
/// Least spacing of the points that are looked up, metres; and their spacing as a share of the reach, as matches far
/// away need not be known to a few centimetres. Both are below the length of wall that counts as one measurement.
const LEAST_SPACING: f64 = 0.25;
const SPACING_BY_REACH: f64 = 0.25;

/// Nodes of one contact: four of each map.
const NODES: usize = 8;
const UNKNOWNS: usize = 3 * NODES;

/// Sum of the contacts of the same nodes.
struct Sum {
    nodes: [usize; NODES],
    information: SMatrix<f64, UNKNOWNS, UNKNOWNS>,
    vector: SVector<f64, UNKNOWNS>,
}

/// Contacts of the walls of map b with walls of map a within `reach`.
pub(super) struct Contacts {
    sums: Vec<Sum>,
    /// Length of wall of map b on walls of map a, metres, weighted by contact.
    pub(super) length: f64,
}

/// A map with its current deformation, and the index of its first node among those of all maps.
#[derive(Clone, Copy)]
pub(super) struct DeformedBody<'a> {
    pub(super) body: &'a Body<'a>,
    pub(super) deformation: &'a Deformation,
    pub(super) first: usize,
}

impl DeformedBody<'_> {
    /// Position of a point of the walls, world, and the nodes around it.
    fn in_world(&self, index: usize) -> Option<(Point2, Corners)> {
        let corners = self.body.shape.corners[index]?;
        let point = self.body.walls.walls.points()[index];
        Some((self.body.transform_world_map * self.deformation.apply_at(&point, &corners), corners))
    }

    /// Lower and upper corner of the bounding box of everything within `reach` of the walls, wherever they are
    /// deformed to, map frame.
    fn bounds(&self, reach: f64) -> Option<[Point2; 2]> {
        let margin = Vector2::repeat(reach + self.deformation.largest_move());
        self.body.shape.bounds.map(|[low, high]| [low - margin, high + margin])
    }
}

/// Looks the walls of map b up in map a. A pair at a distance of `reach` metres counts a quarter of one at distance
/// 0, and farther ones count nothing.
pub(super) fn contacts(a: DeformedBody<'_>, b: DeformedBody<'_>, reach: f64) -> Contacts {
    let (length, found) = find_all(a, b, reach);
    // Both maps are looked up in each other, so each counts one half.
    let weight = 0.5 * (length / CORRELATION_LENGTH).min(1.0) / DEVIATION.powi(2);
    let mut sums: BTreeMap<[usize; NODES], Sum> = BTreeMap::new();
    let mut matched = 0.0;
    for (point, contact) in found {
        let kernel = (1.0 / (1.0 + (contact.residual / reach).powi(2))).powi(2);
        matched += kernel * length;
        let nodes = contact.nodes(a.first, b.first);
        let row = contact.row(a, b, &point);
        let sum =
            sums.entry(nodes).or_insert_with(|| Sum { nodes, information: SMatrix::zeros(), vector: SVector::zeros() });
        sum.information.ger(weight * kernel, &row, &row, 1.0);
        sum.vector.axpy(weight * kernel * contact.target, &row, 1.0);
    }
    Contacts { sums: sums.into_values().collect(), length: matched }
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
pub(super) fn apart<'a>(a: DeformedBody<'a>, b: DeformedBody<'a>, reach: f64) -> (f64, impl Iterator<Item = Apart>) {
    let (length, found) = find_all(a, b, reach);
    (length, found.map(|(_, contact)| Apart { rigid: contact.target.abs(), deformed: contact.residual.abs() }))
}

impl Contacts {
    /// Adds the contacts to the equations.
    pub(super) fn add_to(&self, equations: &mut Equations) {
        for Sum { nodes, information, vector } in &self.sums {
            for (i, &row) in nodes.iter().enumerate() {
                equations.add_vector(row, &vector.fixed_rows::<3>(3 * i).into_owned());
                for (j, &column) in nodes.iter().enumerate() {
                    equations.add(row, column, || information.fixed_view::<3, 3>(3 * i, 3 * j).into_owned());
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
struct Contact {
    of_a: Corners,
    of_b: Corners,
    /// Point of the wall of map a, map frame, and its normal, world.
    partner: Point2,
    normal: Vector2<f64>,
    /// Signed distance of the point from the wall with the current deformation, metres.
    residual: f64,
    /// The same without deformation, which the moves of the nodes are to explain.
    target: f64,
}

/// Points of the walls of map b with their partners in map a, and the length of wall per point, metres.
fn find_all<'a>(
    a: DeformedBody<'a>,
    b: DeformedBody<'a>,
    reach: f64,
) -> (f64, impl Iterator<Item = (Point2, Contact)>) {
    let points = b.body.walls.walls.points();
    let spacing = LEAST_SPACING.max((SPACING_BY_REACH * reach).min(CORRELATION_LENGTH));
    let every = stride(points.len(), MOST_POINTS).max((spacing / b.body.walls.spacing).round() as usize);
    let bounds = a.bounds(reach);
    let found = points.iter().enumerate().step_by(every);
    let found = found.filter_map(move |(index, point)| Some((*point, find((a, &bounds?), b, index, point, reach)?)));
    (every as f64 * b.body.walls.spacing, found)
}

/// Partner of a point of the walls of map b within `reach` in map a, whose walls are all within the rectangle.
fn find(
    (a, [low, high]): (DeformedBody<'_>, &[Point2; 2]),
    b: DeformedBody<'_>,
    index: usize,
    point: &Point2,
    reach: f64,
) -> Option<Contact> {
    let (of_a_world, of_b_world) = (&a.body.transform_world_map, &b.body.transform_world_map);
    let (in_world, of_b) = b.in_world(index)?;
    let in_a = of_a_world.inverse_transform_point(&in_world);
    if !(*low <= in_a && in_a <= *high) {
        return None;
    }
    let partner = a.body.walls.walls.nearest(&a.deformation.inverse(&in_a), reach)?.index;
    let normal = of_a_world * a.body.walls.normals[partner];
    let cosine = normal.dot(&(of_b_world * b.body.walls.normals[index]));
    if !a.body.shape.seen[partner].fit(b.body.shape.seen[index], cosine) {
        return None;
    }
    let place = a.body.walls.walls.points()[partner];
    let (place_in_world, of_a) = a.in_world(partner)?;
    Some(Contact {
        of_a,
        of_b,
        partner: place,
        normal,
        residual: normal.dot(&(in_world - place_in_world)),
        target: normal.dot(&(of_a_world * place - of_b_world * point)),
    })
}

impl Contact {
    /// Indices of its nodes among those of all maps.
    fn nodes(&self, first_a: usize, first_b: usize) -> [usize; NODES] {
        std::array::from_fn(|place| match place < 4 {
            true => first_a + self.of_a[place].0,
            false => first_b + self.of_b[place - 4].0,
        })
    }

    /// Derivative of the distance of the point from the wall with respect to the moves of the nodes.
    fn row(&self, a: DeformedBody<'_>, b: DeformedBody<'_>, point: &Point2) -> SVector<f64, UNKNOWNS> {
        let mut row = SVector::<f64, UNKNOWNS>::zeros();
        let ends = [(a, &self.of_a, &self.partner, -1.0), (b, &self.of_b, point, 1.0)];
        for (end, (deformed, corners, point, sign)) in ends.into_iter().enumerate() {
            let normal = deformed.body.transform_world_map.inverse_transform_vector(&self.normal).transpose();
            for (place, &(node, weight)) in corners.iter().enumerate() {
                let arm = point - deformed.body.shape.lattice.position(node);
                let by_node: RowVector3<f64> = normal * node_jacobian(&arm);
                row.fixed_rows_mut::<3>(12 * end + 3 * place).copy_from(&(sign * weight * by_node).transpose());
            }
        }
        row
    }
}
