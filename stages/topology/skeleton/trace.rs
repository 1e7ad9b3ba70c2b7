//! Traces the cells of a skeleton to nodes and chains of cells between them.

use super::{DistanceMap, NodeKind, Skeleton};
use std::collections::BTreeMap;

/// Nodes and paths by the places of their cells in the window.
#[derive(Default)]
pub(super) struct Traced {
    pub(super) nodes: Vec<(usize, NodeKind)>,
    /// The numbers of the first and the last node, and the cells from the one to the other.
    pub(super) paths: Vec<([usize; 2], Vec<usize>)>,
}

/// A cell that is not on the skeleton.
const EMPTY: u8 = 0;
/// A cell of the skeleton that belongs to no node, and to no path yet.
const FREE: u8 = 1;
/// A cell that belongs to a path.
const ON_PATH: u8 = 2;
/// A cell that belongs to a node.
const OF_NODE: u8 = 3;

struct Tracer {
    /// For each cell of the window one of the above.
    cells: Vec<u8>,
    stride: usize,
    /// The number of the node that a cell belongs to. Few cells do: a list of all that has their numbers would take
    /// most of the time.
    nodes: BTreeMap<usize, usize>,
    /// The cells of each node.
    node_cells: Vec<Vec<usize>>,
    traced: Traced,
}

/// Finds the ends, the junctions, the isolated cells, and the paths between them. Cells that touch by a side are
/// neighbours, and cells that touch by a corner unless both touch a third by a side. Cells with three neighbours or
/// more that are neighbours of each other make one junction.
pub(super) fn trace(skeleton: &Skeleton, distances: &DistanceMap) -> Traced {
    let mut tracer = Tracer {
        cells: skeleton.cells.clone(),
        stride: skeleton.window.stride,
        nodes: BTreeMap::new(),
        node_cells: Vec::new(),
        traced: Traced::default(),
    };
    let places = || skeleton.places.iter().map(|place| *place as usize);
    // Of several, the one that is farthest from obstacles; the first of equals.
    let widest = |of: &[usize]| {
        let farther = |best: usize, place: &usize| match distances.distances[*place] > distances.distances[best] {
            true => *place,
            false => best,
        };
        of.iter().fold(of[0], farther)
    };
    for place in places() {
        if tracer.cells[place] == FREE {
            match tracer.neighbours(place).count() {
                0 | 1 => tracer.add_node(vec![place], NodeKind::End, widest),
                2 => {}
                _ => {
                    let cells = tracer.junction_cells(place);
                    tracer.add_node(cells, NodeKind::Junction, widest);
                }
            }
        }
    }
    (0..tracer.node_cells.len()).for_each(|node| tracer.follow_from(node));
    for place in places() {
        if tracer.cells[place] == FREE {
            let ring = tracer.ring(place);
            ring.iter().for_each(|place| tracer.cells[*place] = FREE);
            tracer.add_node(vec![widest(&ring)], NodeKind::Loop, widest);
            tracer.follow_from(tracer.node_cells.len() - 1);
        }
    }
    tracer.traced
}

impl Tracer {
    /// The cells that follow on a cell.
    fn neighbours(&self, place: usize) -> impl Iterator<Item = usize> + use<'_> {
        let (cells, stride) = (&self.cells, self.stride);
        let [left, right, above, below] = [place - 1, place + 1, place - stride, place + stride];
        let is_there = move |place: &usize| cells[*place] != EMPTY;
        let by_side = [above, left, right, below].into_iter().filter(is_there);
        let corners = [(above, left), (above, right), (below, left), (below, right)];
        let by_corner = corners.into_iter().filter(move |(one, other)| cells[*one] == EMPTY && cells[*other] == EMPTY);
        by_side.chain(by_corner.map(move |(one, other)| one + other - place).filter(is_there))
    }

    fn add_node(&mut self, cells: Vec<usize>, kind: NodeKind, widest: impl Fn(&[usize]) -> usize) {
        let number = self.node_cells.len();
        for &place in &cells {
            self.cells[place] = OF_NODE;
            self.nodes.insert(place, number);
        }
        self.traced.nodes.push((widest(&cells), kind));
        self.node_cells.push(cells);
    }

    /// All cells of the junction that a cell belongs to.
    fn junction_cells(&self, place: usize) -> Vec<usize> {
        let mut found = vec![place];
        let mut next = 0;
        while let Some(&place) = found.get(next) {
            for neighbour in self.neighbours(place) {
                if !found.contains(&neighbour) && self.neighbours(neighbour).count() > 2 {
                    found.push(neighbour);
                }
            }
            next += 1;
        }
        found
    }

    /// Adds all paths that begin at a node and that are not there yet.
    fn follow_from(&mut self, node: usize) {
        for cell in self.node_cells[node].clone() {
            for neighbour in self.neighbours(cell).collect::<Vec<_>>() {
                match self.nodes.get(&neighbour) {
                    None if self.cells[neighbour] == FREE => self.follow(node, cell, neighbour),
                    // Nodes side by side; each pair of cells is met from both of its ends.
                    Some(&other) if other > node => self.add_path(node, other, Vec::new()),
                    _ => {}
                }
            }
        }
    }

    fn follow(&mut self, node: usize, cell: usize, first: usize) {
        let (mut before, mut place) = (cell, first);
        let mut passed = Vec::new();
        loop {
            passed.push(place);
            self.cells[place] = ON_PATH;
            let next = self.neighbours(place).find(|next| *next != before && self.cells[*next] != ON_PATH);
            match next.map(|next| (next, self.nodes.get(&next))) {
                // A cell of the path has two neighbours; where the other one is on a path, that is this path itself.
                None => return self.add_path(node, node, passed),
                Some((_, Some(&end))) => return self.add_path(node, end, passed),
                Some((next, None)) => (before, place) = (place, next),
            }
        }
    }

    fn add_path(&mut self, start: usize, end: usize, passed: Vec<usize>) {
        let mut cells = Vec::with_capacity(passed.len() + 2);
        cells.push(self.traced.nodes[start].0);
        cells.extend(passed);
        cells.push(self.traced.nodes[end].0);
        self.traced.paths.push(([start, end], cells));
    }

    /// The cells of a way that leads back to itself.
    fn ring(&mut self, first: usize) -> Vec<usize> {
        let mut ring = vec![first];
        self.cells[first] = ON_PATH;
        let mut place = first;
        loop {
            let next = self.neighbours(place).find(|next| self.cells[*next] == FREE);
            let Some(next) = next else { return ring };
            self.cells[next] = ON_PATH;
            ring.push(next);
            place = next;
        }
    }
}
