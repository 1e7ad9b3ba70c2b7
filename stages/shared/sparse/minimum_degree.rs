//! Elimination order of nodes by the number of their neighbours.

/// Degree of a node that is eliminated.
const ELIMINATED: usize = usize::MAX;

/// Computes the position of each node in an elimination order with a sparse factor: the next node is always one of
/// those with the fewest neighbours. The neighbours of an eliminated node become neighbours of each other, a clique
/// (approximate minimum degree; Amestoy, Davis and Duff 1996). `neighbours` are for each node those with a common
/// equation.
///
/// Where nodes have many neighbours, and not in the plane alone, as at places that many maps show or where a robot comes by
/// again and again, the factor is sparser than after a dissection of the plane.
pub(crate) fn minimum_degree(neighbours: Vec<Vec<usize>>) -> Vec<usize> {
    let count = neighbours.len();
    let mut elimination = Elimination::new(neighbours);
    while let Some(node) = elimination.next_node() {
        elimination.eliminate(node);
    }
    places(&elimination.steps, count)
}

/// Nodes that are eliminated together.
struct Step {
    nodes: Vec<usize>,
    /// The neighbours that they leave, which are neighbours of each other; none once a later step has joined them.
    clique: Vec<usize>,
    /// Earlier steps whose cliques were joined.
    children: Vec<usize>,
}

/// State while nodes are ordered.
struct Elimination {
    steps: Vec<Step>,
    /// Neighbours of each node with which it is in no clique.
    neighbours: Vec<Vec<usize>>,
    /// Steps whose cliques each node is in.
    cliques: Vec<Vec<usize>>,
    /// Bound of the number of neighbours of each node.
    degrees: Vec<usize>,
    /// Nodes by degree, among them some that have another one by now.
    waiting: Vec<Vec<usize>>,
    /// Least degree for which nodes may wait.
    least: usize,
    /// Latest step in which each node became a member of a clique.
    joined_in: Vec<usize>,
    /// For each step, the latest step that counted members of its clique, and how many of them are outside of that
    /// one's.
    outside: Vec<(usize, usize)>,
}

impl Elimination {
    fn new(neighbours: Vec<Vec<usize>>) -> Self {
        let count = neighbours.len();
        let degrees: Vec<usize> = neighbours.iter().map(Vec::len).collect();
        let mut waiting = vec![Vec::new(); count];
        degrees.iter().enumerate().rev().for_each(|(node, degree)| waiting[*degree].push(node));
        Self {
            steps: Vec::new(),
            neighbours,
            cliques: vec![Vec::new(); count],
            degrees,
            waiting,
            least: 0,
            joined_in: vec![usize::MAX; count],
            outside: vec![(usize::MAX, 0); count],
        }
    }

    /// A node with the fewest neighbours. None if all are eliminated.
    fn next_node(&mut self) -> Option<usize> {
        while let Some(waiting) = self.waiting.get_mut(self.least) {
            match waiting.pop() {
                Some(node) if self.degrees[node] == self.least => return Some(node),
                Some(_) => {}
                None => self.least += 1,
            }
        }
        None
    }

    /// Eliminates a node, and with it those that have no neighbours beyond its own.
    fn eliminate(&mut self, node: usize) {
        let step = self.steps.len();
        let children = std::mem::take(&mut self.cliques[node]);
        let mut clique = std::mem::take(&mut self.neighbours[node]);
        self.joined_in[node] = step;
        clique.iter().for_each(|&member| self.joined_in[member] = step);
        for &child in &children {
            for member in std::mem::take(&mut self.steps[child].clique) {
                if std::mem::replace(&mut self.joined_in[member], step) != step {
                    clique.push(member);
                }
            }
        }
        for &member in &clique {
            self.neighbours[member].retain(|&other| self.joined_in[other] != step);
            self.cliques[member].retain(|&other| !self.steps[other].clique.is_empty());
            for &other in &self.cliques[member] {
                let (counted_in, outside) = &mut self.outside[other];
                if std::mem::replace(counted_in, step) != step {
                    *outside = self.steps[other].clique.len();
                }
                *outside -= 1;
            }
        }
        let (mut nodes, mut left) = (vec![node], Vec::with_capacity(clique.len()));
        for member in clique {
            let has_others = !(self.neighbours[member].is_empty() && self.cliques[member].is_empty());
            if has_others { left.push(member) } else { nodes.push(member) }
        }
        nodes.iter().for_each(|&node| self.degrees[node] = ELIMINATED);
        for &member in &left {
            // Members of several other cliques are counted several times.
            let outside = self.cliques[member].iter().map(|&other| self.outside[other].1);
            let degree = left.len() - 1 + self.neighbours[member].len() + outside.sum::<usize>();
            let degree = degree.min(self.waiting.len() - 1);
            self.cliques[member].push(step);
            if std::mem::replace(&mut self.degrees[member], degree) != degree {
                self.waiting[degree].push(member);
                self.least = self.least.min(degree);
            }
        }
        self.steps.push(Step { nodes, clique: left, children });
    }
}

/// Places of all nodes, each step directly after those whose cliques it has joined: columns with nearly the same rows
/// are then neighbours.
fn places(steps: &[Step], count: usize) -> Vec<usize> {
    let mut sizes: Vec<usize> = Vec::with_capacity(steps.len());
    for step in steps {
        sizes.push(step.nodes.len() + step.children.iter().map(|&child| sizes[child]).sum::<usize>());
    }
    let mut places = vec![0; count];
    let mut ends: Vec<Option<usize>> = vec![None; steps.len()];
    let mut end_of_all = count;
    for (number, step) in steps.iter().enumerate().rev() {
        let mut end = ends[number].unwrap_or_else(|| {
            end_of_all -= sizes[number];
            end_of_all + sizes[number]
        });
        for &node in step.nodes.iter().rev() {
            end -= 1;
            places[node] = end;
        }
        for &child in step.children.iter().rev() {
            ends[child] = Some(end);
            end -= sizes[child];
        }
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_node_has_its_place_and_leaves_come_before_what_they_hang_on() {
        // Node 0 with 5 others around it, and a pair on its own.
        let mut neighbours: Vec<Vec<usize>> = vec![vec![0]; 6];
        neighbours[0] = (1..6).collect();
        neighbours.extend([vec![7], vec![6]]);
        let places = minimum_degree(neighbours);
        let mut all = places.clone();
        all.sort_unstable();
        assert_eq!(all, (0..8).collect::<Vec<_>>(), "each once");
        let before = (1..6).filter(|&leaf| places[leaf] < places[0]).count();
        assert!(before >= 4, "{places:?}");
        assert!(minimum_degree(Vec::new()).is_empty());
    }

    /// Number of blocks of the factor below the diagonal.
    fn blocks_below(neighbours: &[Vec<usize>]) -> usize {
        let places = minimum_degree(neighbours.to_vec());
        let mut rows: Vec<Vec<usize>> = vec![Vec::new(); places.len()];
        for (node, neighbours) in neighbours.iter().enumerate() {
            rows[places[node]] = neighbours.iter().map(|&other| places[other]).collect();
        }
        let mut blocks = 0;
        for column in 0..places.len() {
            let mut below: Vec<usize> = rows[column].iter().copied().filter(|&row| row > column).collect();
            below.sort_unstable();
            below.dedup();
            blocks += below.len();
            if let Some(&parent) = below.first() {
                rows[parent].extend(below);
            }
        }
        blocks
    }

    #[test]
    fn the_factor_of_a_drive_that_comes_by_few_places_again_and_again_grows_with_its_length_alone() {
        let drive = |scans: usize| {
            let mut neighbours: Vec<Vec<usize>> = vec![Vec::new(); 12 + scans];
            let mut tie = |one: usize, other: usize| {
                neighbours[one].push(other);
                neighbours[other].push(one);
            };
            for scan in 12..12 + scans {
                (0..4).for_each(|nearest| tie(scan, (scan + 3 * nearest) % 12));
                if scan > 12 {
                    tie(scan - 1, scan);
                }
            }
            blocks_below(&neighbours)
        };
        let [short, long] = [400, 800].map(drive);
        assert!(long < 800 * 16 && long as f64 <= 2.1 * short as f64, "{short} {long}");
    }

    #[test]
    fn the_factor_of_a_strip_has_no_more_than_its_band() {
        // 40 x 3 nodes, each connected with those beside it; in the order of a band each column has 3 blocks below.
        let at = |node: usize| ((node / 3) as i32, (node % 3) as i32);
        let is_near = |one: usize, other: usize| {
            let (a, b) = (at(one), at(other));
            (a.0 - b.0).abs() + (a.1 - b.1).abs() == 1
        };
        let neighbours: Vec<Vec<usize>> =
            (0..120).map(|one| (0..120).filter(|&other| is_near(one, other)).collect()).collect();
        let blocks = blocks_below(&neighbours);
        assert!(blocks <= 3 * 120, "{blocks}");
    }
}
