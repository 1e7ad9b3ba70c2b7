//! Deformation of a map: a lattice of nodes over its known part, each with a small displacement and a small turn, and
//! the smooth field between them.
//!
//! A node moves the map around it rigidly; a point takes the mean of the moves of the nodes at the corners of its
//! lattice square, weighted bilinearly (the embedded deformation of Sumner et al. 2007 on a regular lattice). Turns
//! are small, so their sines are linearized: the displacement of a point is linear in the nodes, as the estimate of
//! them requires.

use crate::shared::geometry::{Cell, Grid, Point2, is_known, quarter_turn};
use gridweave_runtime::ros::MapDeformation;
use nalgebra::{Matrix2x3, Vector2, Vector3};
use std::collections::BTreeMap;

/// A vertex of a lattice: column and row, counted from the map frame's origin.
pub type Vertex = (i32, i32);

/// Indices of the nodes at the corners of a lattice square, with their weights, which add up to 1.
pub type Corners = [(usize, f64); 4];

/// Largest distance of a node from the origin along x or y, in vertices: maps in UTM coordinates are 10,000 km from it.
const MOST_VERTICES: f64 = 1e9;
/// Cells of a row that are looked at one by one only where not all of them are in one square.
const CELLS_AT_ONCE: usize = 16;
/// Largest number of nodes of a lattice, as their equations are solved together.
const MOST_NODES: usize = 10_000;
/// Largest number of its vertices, including those without a node.
const MOST_TABLE: i64 = 1 << 22;

/// Rounds of the inverse: the error is then within a thousandth of the displacement.
const INVERSE_ROUNDS: usize = 3;

/// The nodes of a map.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lattice {
    /// Distance of nodes along x and along y, metres.
    spacing: f64,
    /// Least column and row.
    first: Vertex,
    columns: usize,
    /// For each vertex, row by row, the index of its node.
    nodes: Vec<Option<u32>>,
    /// Vertices of the nodes, row by row.
    vertices: Vec<Vertex>,
}

impl Lattice {
    /// A lattice with a node at each corner of each square of the side `spacing` in which the grid has a known cell;
    /// of twice the side, or four times and so on, where that would take too many.
    pub fn over(grid: &Grid<'_>, mut spacing: f64) -> Self {
        loop {
            let vertices = vertices_over(grid, spacing);
            if vertices.len() <= MOST_NODES && table_size(&vertices) <= MOST_TABLE {
                return Self::of(vertices, spacing);
            }
            spacing *= 2.0;
        }
    }

    /// A lattice with nodes at the given vertices, which are sorted row by row.
    fn of(vertices: Vec<Vertex>, spacing: f64) -> Self {
        let low = |part: fn(&Vertex) -> i32| vertices.iter().map(part).min().unwrap_or_default();
        let high = |part: fn(&Vertex) -> i32| vertices.iter().map(part).max().unwrap_or_default();
        let first = (low(|vertex| vertex.0), low(|vertex| vertex.1));
        let columns = (high(|vertex| vertex.0) - first.0) as usize + 1;
        let rows = (high(|vertex| vertex.1) - first.1) as usize + 1;
        let mut lattice = Self { spacing, first, columns, nodes: vec![None; columns * rows], vertices };
        for (number, vertex) in lattice.vertices.clone().into_iter().enumerate() {
            if let Some(place) = lattice.place(vertex) {
                lattice.nodes[place] = Some(number as u32);
            }
        }
        lattice
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.vertices.len()
    }

    /// Distance of nodes along x and along y, metres.
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.vertices.is_empty()
    }

    /// Position of a node, metres, map frame.
    pub fn position(&self, node: usize) -> Point2 {
        let (column, row) = self.vertices[node];
        Point2::new(f64::from(column), f64::from(row)) * self.spacing
    }

    /// Pairs of neighbouring nodes, each once.
    pub fn edges(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.vertices.iter().enumerate().flat_map(move |(node, &(column, row))| {
            [(column + 1, row), (column, row + 1)]
                .into_iter()
                .filter_map(move |neighbour| Some((node, self.node(neighbour)?)))
        })
    }

    /// The nodes around a point. None where the map is unknown around it.
    pub fn corners(&self, point: &Point2) -> Option<Corners> {
        let (column, row) = vertex_below(point, self.spacing)?;
        let x = (point.x / self.spacing - f64::from(column)).clamp(0.0, 1.0);
        let y = (point.y / self.spacing - f64::from(row)).clamp(0.0, 1.0);
        let corners = [
            ((column, row), (1.0 - x) * (1.0 - y)),
            ((column + 1, row), x * (1.0 - y)),
            ((column, row + 1), (1.0 - x) * y),
            ((column + 1, row + 1), x * y),
        ];
        let found = corners.map(|(vertex, weight)| (self.node(vertex), weight));
        let known: f64 = found.iter().filter(|(node, _)| node.is_some()).map(|(_, weight)| weight).sum();
        // A corner without a node has no weight, so any node can be in its place.
        let any = found.iter().find_map(|(node, _)| *node)?;
        (known > 0.0).then(|| found.map(|(node, weight)| node.map_or((any, 0.0), |node| (node, weight / known))))
    }

    fn node(&self, vertex: Vertex) -> Option<usize> {
        self.place(vertex).and_then(|place| self.nodes[place]).map(|node| node as usize)
    }

    /// Index of a vertex in the table; none if it is outside.
    fn place(&self, (column, row): Vertex) -> Option<usize> {
        // What is before the first becomes larger than all.
        let (column, row) = (column.wrapping_sub(self.first.0) as u32, row.wrapping_sub(self.first.1) as u32);
        let (column, row) = (column as usize, row as usize);
        (column < self.columns && row * self.columns < self.nodes.len()).then_some(row * self.columns + column)
    }
}

/// Corners of the squares of the side `spacing` in which the grid has a known cell, row by row.
fn vertices_over(grid: &Grid<'_>, spacing: f64) -> Vec<Vertex> {
    let geometry = &grid.geometry;
    let mut vertices = BTreeMap::new();
    let mut last = None;
    for (row, cells) in grid.cells.chunks(geometry.width.max(1)).enumerate() {
        let square_of = |column: usize| vertex_below(&geometry.centre(Cell { column, row }), spacing);
        for (number, part) in cells.chunks(CELLS_AT_ONCE).enumerate() {
            let known = |cell: &i8| is_known(*cell);
            let (Some(first), Some(behind)) = (part.iter().position(known), part.iter().rposition(known)) else {
                continue;
            };
            let start = number * CELLS_AT_ONCE;
            // Between two cells in one square all are in it.
            let is_one_square = square_of(start + first) == square_of(start + behind);
            let end = if is_one_square { first } else { behind };
            for column in (first..=end).filter(|column| is_known(part[*column])) {
                let Some(square) = square_of(start + column) else { continue };
                if last.replace(square) != Some(square) {
                    let (column, row) = square;
                    for corner in [(column, row), (column + 1, row), (column, row + 1), (column + 1, row + 1)] {
                        vertices.insert((corner.1, corner.0), corner);
                    }
                }
            }
        }
    }
    vertices.into_values().collect()
}

/// The vertex at the lower left of the square of a point; none if it is beyond all lattices.
fn vertex_below(point: &Point2, spacing: f64) -> Option<Vertex> {
    let (column, row) = (point.x / spacing, point.y / spacing);
    let fits = column.abs() < MOST_VERTICES && row.abs() < MOST_VERTICES;
    // A cast rounds towards zero, in a fraction of the time of `floor`.
    let floor = |value: f64| value as i32 - i32::from(value < f64::from(value as i32));
    fits.then(|| (floor(column), floor(row)))
}

/// Deformation of a map: a displacement field in its own frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Deformation {
    /// The nodes.
    pub lattice: Lattice,
    /// For each node: displacement along x and y, metres, and turn, radians, in the map frame.
    pub moves: Vec<Vector3<f64>>,
}

impl Deformation {
    /// The zero deformation.
    pub fn none(lattice: Lattice) -> Self {
        Self { moves: vec![Vector3::zeros(); lattice.len()], lattice }
    }

    /// The deformation of a message; none if its nodes are not on a lattice.
    pub fn from_message(message: &MapDeformation) -> Option<Self> {
        let spacing = message.spacing;
        let is_finite = |value: &f64| value.is_finite();
        let mut nodes = BTreeMap::new();
        for node in &message.nodes {
            let (column, row) = (node.x / spacing, node.y / spacing);
            let fits = spacing > 0.0 && [column, row].iter().all(|value| value.abs() < MOST_VERTICES);
            if !fits || ![node.dx, node.dy, node.dyaw].iter().all(is_finite) {
                return None;
            }
            let vertex = (column.round() as i32, row.round() as i32);
            nodes.insert((vertex.1, vertex.0), (vertex, Vector3::new(node.dx, node.dy, node.dyaw)));
        }
        let (vertices, moves): (Vec<Vertex>, _) = nodes.into_values().unzip();
        let fits = !vertices.is_empty() && table_size(&vertices) <= MOST_TABLE;
        fits.then(|| Self { lattice: Lattice::of(vertices, spacing), moves })
    }

    /// Deformed position of a point of the map, map frame.
    pub fn apply(&self, point: &Point2) -> Point2 {
        let Some(corners) = self.lattice.corners(point) else { return *point };
        self.apply_at(point, &corners)
    }

    /// The same for a point whose corners are known.
    pub fn apply_at(&self, point: &Point2, corners: &Corners) -> Point2 {
        point
            + corners.iter().filter(|(_, weight)| *weight > 0.0).fold(Vector2::zeros(), |sum, &(node, weight)| {
                let arm = point - self.lattice.position(node);
                let by = self.moves[node];
                sum + weight * (by.xy() + by.z * quarter_turn(&arm))
            })
    }

    /// Turn of the map around a point, radians.
    pub fn turn(&self, point: &Point2) -> f64 {
        let corners = self.lattice.corners(point);
        corners.map_or(0.0, |corners| corners.iter().map(|&(node, weight)| weight * self.moves[node].z).sum())
    }

    /// The point of the map whose deformed position is `place`, map frame.
    pub fn inverse(&self, place: &Point2) -> Point2 {
        (0..INVERSE_ROUNDS).fold(*place, |point, _| place - (self.apply(&point) - point))
    }

    /// Bound of the displacement of all points, metres.
    pub fn largest_move(&self) -> f64 {
        let of_node = |by: &Vector3<f64>| by.xy().norm() + by.z.abs() * std::f64::consts::SQRT_2 * self.lattice.spacing;
        self.moves.iter().map(of_node).fold(0.0, f64::max)
    }
}

fn table_size(vertices: &[Vertex]) -> i64 {
    let extent = |part: fn(&Vertex) -> i32| {
        let (low, high) = (vertices.iter().map(part).min(), vertices.iter().map(part).max());
        i64::from(high.unwrap_or_default()) - i64::from(low.unwrap_or_default()) + 1
    };
    extent(|vertex| vertex.0).saturating_mul(extent(|vertex| vertex.1))
}

/// Derivative of [`Deformation::apply`] with respect to the move of a node, for a weight of 1.
pub fn node_jacobian(arm: &Vector2<f64>) -> Matrix2x3<f64> {
    Matrix2x3::new(1.0, 0.0, -arm.y, 0.0, 1.0, arm.x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::{GridGeometry, pose};
    use gridweave_runtime::ros::DeformationNode;
    use proptest::prelude::*;

    /// A map of 20 x 12 m, a corner of which is unknown.
    fn deformation(moves: impl Fn(Point2) -> Vector3<f64>) -> Deformation {
        let geometry = GridGeometry { width: 40, height: 24, resolution: 0.5, origin: pose(-7.0, -5.0, 0.0) };
        let cells: Vec<i8> = (0..40 * 24).map(|i| if i % 40 > 30 && i / 40 > 15 { -1 } else { 0 }).collect();
        let lattice = Lattice::over(&Grid::new(geometry, &cells).unwrap(), 4.0);
        let moves = (0..lattice.len()).map(|node| moves(lattice.position(node))).collect();
        Deformation { lattice, moves }
    }

    #[test]
    fn nodes_are_at_the_corners_of_squares_with_known_cells() {
        let lattice = deformation(|_| Vector3::zeros()).lattice;
        // Columns -2 to 4 and rows -2 to 2; nothing is known where x > 8.5 and y > 3.
        assert_eq!(lattice.len(), 7 * 5 - 1);
        assert!(
            lattice.corners(&Point2::new(13.0, 5.0)).is_some_and(|corners| corners[3].1 == 0.0),
            "the last has none"
        );
        assert!(lattice.corners(&Point2::new(99.0, 0.0)).is_none());
        let edges = lattice.edges().count();
        assert_eq!(edges, 6 * 5 + 7 * 4 - 2);
    }

    #[test]
    fn a_map_that_is_moved_and_turned_as_a_whole_stays_rigid() {
        let turn = 1e-3;
        let deformation = deformation(|node| {
            let moved = Vector2::new(0.2, -0.1) + turn * quarter_turn(&node.coords);
            Vector3::new(moved.x, moved.y, turn)
        });
        for point in [Point2::new(0.3, 1.7), Point2::new(-6.9, -4.9), Point2::new(9.0, 2.0)] {
            let expected = point + Vector2::new(0.2, -0.1) + turn * quarter_turn(&point.coords);
            assert!((deformation.apply(&point) - expected).norm() < 1e-12);
        }
    }

    #[test]
    fn a_map_of_absurdly_large_cells_takes_no_more_nodes_than_others() {
        let geometry = GridGeometry { width: 200, height: 200, resolution: 2000.0, origin: pose(0.0, 0.0, 0.0) };
        let cells = vec![0; 200 * 200];
        let lattice = Lattice::over(&Grid::new(geometry, &cells).unwrap(), 3.0);
        assert!((4..=MOST_NODES).contains(&lattice.len()) && lattice.spacing() > 1000.0, "{}", lattice.len());
    }

    #[test]
    fn a_map_in_utm_coordinates_is_deformed_as_one_at_the_origin() {
        let cells = [0; 16];
        let grid = |x: f64, y: f64| {
            let origin = pose(x, y, 0.0);
            Grid::new(GridGeometry { width: 4, height: 4, resolution: 1.0, origin }, &cells).unwrap()
        };
        let lattice = Lattice::over(&grid(500_000.0, 4_649_776.0), 1.0);
        assert_eq!(lattice.len(), Lattice::over(&grid(0.0, 0.0), 1.0).len());
        let moves = vec![Vector3::new(0.1, -0.2, 0.0); lattice.len()];
        let nodes = (0..lattice.len()).map(|number| {
            let place = lattice.position(number);
            DeformationNode { x: place.x, y: place.y, dx: 0.1, dy: -0.2, ..Default::default() }
        });
        let message = MapDeformation { spacing: 1.0, nodes: nodes.collect(), ..Default::default() };
        let deformation = Deformation { lattice, moves };
        assert_eq!(Deformation::from_message(&message).as_ref(), Some(&deformation));
        let point = Point2::new(500_001.5, 4_649_778.2);
        assert!((deformation.apply(&point) - point - Vector2::new(0.1, -0.2)).norm() < 1e-8);
    }

    #[test]
    fn a_message_without_a_lattice_is_refused() {
        let node = |x: f64, y: f64| DeformationNode { x, y, ..Default::default() };
        let message = |spacing, nodes| MapDeformation { spacing, nodes, robot: "robot1".into(), ..Default::default() };
        assert!(Deformation::from_message(&message(4.0, vec![node(0.0, 4.0), node(-4.0, 8.0)])).is_some());
        for bad in [
            message(4.0, vec![]),
            message(0.0, vec![node(1.0, 1.0)]),
            message(f64::NAN, vec![node(1.0, 1.0)]),
            message(1.0, vec![node(f64::INFINITY, 1.0)]),
            message(1e-300, vec![node(1.0, 1.0)]),
            message(1.0, vec![node(-9e5, -9e5), node(9e5, 9e5)]),
        ] {
            assert_eq!(Deformation::from_message(&bad), None, "{bad:?}");
        }
    }

    proptest! {
        #[test]
        fn the_inverse_of_a_deformation_returns_the_point(x in -7.0..13.0, y in -5.0..3.0, seed in 0.0..6.0f64) {
            let deformed = deformation(|node: Point2| {
                let (x, y): (f64, f64) = (node.x, node.y);
                Vector3::new(0.3 * (x / 5.0 + seed).sin(), 0.2 * (y / 7.0).cos(), 0.02 * (x / 9.0).sin())
            });
            let point = Point2::new(x, y);
            prop_assert!((deformed.inverse(&deformed.apply(&point)) - point).norm() < 1e-3);
        }
    }
}
