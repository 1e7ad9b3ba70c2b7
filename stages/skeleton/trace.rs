//! From the cells of a skeleton to nodes and the chains of cells between them.

use super::{DistanceMap, NodeKind, Skeleton};

/// Nodes and paths by the places of their cells in the window.
#[derive(Default)]
pub(super) struct Traced {
    pub(super) nodes: Vec<(usize, NodeKind)>,
    /// The numbers of the first and the last node, and the cells from the one to the other.
    pub(super) paths: Vec<([usize; 2], Vec<usize>)>,
}

/// A cell that belongs to no node, and to no path yet.
const FREE: u32 = u32::MAX;
/// A cell that belongs to a path.
const ON_PATH: u32 = u32::MAX - 1;

struct Tracer<'a> {
    cells: &'a [u8],
    stride: usize,
    /// For each cell of the window the number of its node, [`FREE`] or [`ON_PATH`].
    owners: Vec<u32>,
    /// The cells of each node.
    node_cells: Vec<Vec<usize>>,
    traced: Traced,
}

/// Finds the ends, the junctions, the cells that stand alone, and the ways between them. Cells that touch by a side are
/// neighbours, and cells that touch by a corner unless both touch a third by a side. Cells with three neighbours or more that
/// are neighbours of each other make one junction.
pub(super) fn trace(skeleton: &Skeleton, distances: &DistanceMap) -> Traced {
    let mut tracer = Tracer {
        cells: &skeleton.cells,
        stride: skeleton.window.stride,
        owners: vec![FREE; skeleton.cells.len()],
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
        if tracer.owners[place] == FREE {
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
        if tracer.owners[place] == FREE {
            let ring = tracer.ring(place);
            tracer.add_node(vec![widest(&ring)], NodeKind::Loop, widest);
            ring.iter().for_each(|place| tracer.owners[*place] = FREE);
            let node = tracer.node_cells.len() - 1;
            tracer.owners[tracer.node_cells[node][0]] = node as u32;
            tracer.follow_from(node);
        }
    }
    tracer.traced
}

impl<'a> Tracer<'a> {
    /// The cells that follow on a cell.
    fn neighbours(&self, place: usize) -> impl Iterator<Item = usize> + use<'a> {
        let (cells, stride) = (self.cells, self.stride);
        let [left, right, above, below] = [place - 1, place + 1, place - stride, place + stride];
        let is_there = move |place: &usize| cells[*place] == 1;
        let by_side = [above, left, right, below].into_iter().filter(is_there);
        let corners = [(above, left), (above, right), (below, left), (below, right)];
        let by_corner = corners.into_iter().filter(move |(one, other)| cells[*one] == 0 && cells[*other] == 0);
        by_side.chain(by_corner.map(move |(one, other)| one + other - place).filter(is_there))
    }

    fn add_node(&mut self, cells: Vec<usize>, kind: NodeKind, widest: impl Fn(&[usize]) -> usize) {
        let number = self.node_cells.len() as u32;
        cells.iter().for_each(|place| self.owners[*place] = number);
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
            for neighbour in self.neighbours(cell) {
                match self.owners[neighbour] {
                    ON_PATH => {}
                    FREE => self.follow(node, cell, neighbour),
                    // Nodes side by side; each pair of cells is met from both of its ends.
                    other if other as usize > node => self.add_path(node, other as usize, Vec::new()),
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
            self.owners[place] = ON_PATH;
            let next = self.neighbours(place).find(|next| *next != before && self.owners[*next] != ON_PATH);
            match next {
                // A cell of the path has two neighbours; where the other one is on a path, that is this path itself.
                None => return self.add_path(node, node, passed),
                Some(next) if self.owners[next] != FREE => {
                    return self.add_path(node, self.owners[next] as usize, passed);
                }
                Some(next) => (before, place) = (place, next),
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
        self.owners[first] = ON_PATH;
        let mut place = first;
        while let Some(next) = self.neighbours(place).find(|next| self.owners[*next] == FREE) {
            self.owners[next] = ON_PATH;
            ring.push(next);
            place = next;
        }
        ring
    }
}
