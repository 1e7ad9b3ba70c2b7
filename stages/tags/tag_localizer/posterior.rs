//! Probability of a tag's position on its grid.

use super::Likelihood;
use crate::shared::geometry::Point2;
use nalgebra::Vector2;

/// Positions whose log-likelihood is this far below the best have less than a millionth of the probability together.
const NEGLIGIBLE: f64 = 20.0;
/// Level of the first nodes, which are 2^5 cells wide.
const COARSEST: i32 = 5;
/// A cell is split into parts of at least 2^-4 of its width.
const FINEST: i32 = -4;
/// The probability is resolved when a part is at most this many standard deviations wide, across the mode, where it
/// is narrowest: then sums over parts are accurate to a hundredth.
const RESOLVED: f64 = 2.0;

/// A tag's square grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridSize {
    /// Its centre, metres, map frame.
    pub centre: Point2,
    /// Cells along a side.
    pub cells: usize,
    /// Width of a cell, metres.
    pub resolution: f64,
}

impl GridSize {
    /// Centre of the cells from one column and row to before another, metres, map frame.
    pub fn middle(&self, columns: (usize, usize), rows: (usize, usize)) -> Point2 {
        let from_centre =
            |(start, end): (usize, usize)| 0.5 * self.resolution * ((start + end) as f64 - self.cells as f64);
        self.centre + Vector2::new(from_centre(columns), from_centre(rows))
    }
}

/// A cell of the grid, or a part of one, with its share of the probability.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leaf {
    /// Its centre, metres, map frame.
    pub place: Point2,
    /// Column of its cell.
    pub column: usize,
    /// Row of its cell.
    pub row: usize,
    /// Its share of the probability; the shares of all leaves add up to 1.
    pub mass: f64,
}

/// Probability of a tag's position. Negligible cells are left out.
#[derive(Clone, Debug)]
pub struct Posterior {
    /// The grid.
    pub grid: GridSize,
    /// Width of the leaves, metres.
    pub leaf_size: f64,
    /// The positions with their shares of the probability.
    pub leaves: Vec<Leaf>,
}

/// A square of the grid, 2^level cells wide.
#[derive(Clone, Copy, Debug)]
struct Node {
    column: usize,
    row: usize,
}

/// The best position so far, with its log-likelihood.
#[derive(Clone, Copy, Debug)]
struct Peak {
    place: Point2,
    value: f64,
}

/// Nodes of one size.
#[derive(Clone, Copy, Debug)]
struct Level {
    grid: GridSize,
    level: i32,
}

impl Posterior {
    /// The normalised likelihood on the grid.
    ///
    /// It is computed from squares of 32 x 32 cells to single cells by halves. A square is dropped when no position
    /// in it can be within 20 nats of the best so far, so no mode is lost. Where the probability is so narrow that
    /// single cells do not resolve it, cells are divided further: otherwise the share of a mode would depend on its
    /// position in the raster. `None` without readings.
    pub fn new(likelihood: &Likelihood, grid: GridSize) -> Option<Self> {
        if likelihood.is_empty() || grid.cells == 0 {
            return None;
        }
        let mut level = Level { grid, level: COARSEST };
        let mut nodes = level.all();
        let mut summit = level.coordinate_ascent(likelihood, &nodes)?;
        loop {
            for node in &nodes {
                if let Some(place) = level.centre_on_grid(*node)
                    && let Some(value) = likelihood.log_likelihood(&place, summit.value)
                {
                    summit = Peak { place, value };
                }
            }
            level.drop_negligible(&mut nodes, likelihood, summit.value);
            if level.level == 0 {
                break;
            }
            (level, nodes) = level.halved(&nodes);
        }
        let widest = RESOLVED * likelihood.narrowest_stddev(&summit.place);
        while level.size() > widest && level.level > FINEST {
            (level, nodes) = level.halved(&nodes);
            level.drop_negligible(&mut nodes, likelihood, summit.value);
        }
        Self::normalised(grid, level.size(), level.leaves(likelihood, &nodes))
    }

    /// Turns the log-likelihoods of the leaves into shares.
    fn normalised(grid: GridSize, leaf_size: f64, mut leaves: Vec<Leaf>) -> Option<Self> {
        let best = leaves.iter().map(|leaf| leaf.mass).fold(f64::NEG_INFINITY, f64::max);
        leaves.iter_mut().for_each(|leaf| leaf.mass = (leaf.mass - best).exp());
        let total: f64 = leaves.iter().map(|leaf| leaf.mass).sum();
        leaves.iter_mut().for_each(|leaf| leaf.mass /= total);
        (total > 0.0 && total.is_finite()).then_some(Self { grid, leaf_size, leaves })
    }
}

impl Level {
    /// All nodes of this level, row by row.
    fn all(&self) -> Vec<Node> {
        let count = self.grid.cells.div_ceil(1 << self.level.max(0));
        (0..count).flat_map(|row| (0..count).map(move |column| Node { column, row })).collect()
    }

    /// Width of a node, metres.
    fn size(&self) -> f64 {
        self.grid.resolution * f64::from(self.level).exp2()
    }

    /// Coordinate ascent from the best of the nodes' centres, with steps along the axes that are halved where none
    /// improves. The better the best so far, the more can be dropped while nodes are large. `None` if no centre is on
    /// the grid.
    fn coordinate_ascent(&self, likelihood: &Likelihood, nodes: &[Node]) -> Option<Peak> {
        let value_at = |place: &Point2| likelihood.log_likelihood(place, f64::NEG_INFINITY);
        let centres = nodes.iter().filter_map(|node| self.centre_on_grid(*node));
        let values = centres.filter_map(|centre| Some((value_at(&centre)?, centre)));
        let (mut best, mut place) = values.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let half_grid = 0.5 * self.grid.cells as f64 * self.grid.resolution;
        let mut step = 0.5 * self.size();
        while step > 0.25 * self.grid.resolution {
            let around = [(step, 0.0), (-step, 0.0), (0.0, step), (0.0, -step)]
                .map(|(x, y)| place + Vector2::new(x, y))
                .into_iter()
                .filter(|next| (next - self.grid.centre).amax() <= half_grid);
            let next = around.filter_map(|next| Some((value_at(&next)?, next))).max_by(|a, b| a.0.total_cmp(&b.0));
            match next {
                Some((value, next)) if value > best => (best, place) = (value, next),
                _ => step /= 2.0,
            }
        }
        Some(Peak { place, value: best })
    }

    /// Drops the nodes in which no position is near the best.
    fn drop_negligible(&self, nodes: &mut Vec<Node>, likelihood: &Likelihood, best: f64) {
        let half_diagonal = self.size() * std::f64::consts::FRAC_1_SQRT_2;
        let bound =
            |node: &Node| likelihood.log_likelihood_within(&self.centre(*node), half_diagonal, best - NEGLIGIBLE);
        nodes.retain(|node| bound(node).is_some());
    }

    /// The nodes near the best of them as leaves, with their log-likelihood. The peak may be narrower than a node, so
    /// only their centres count.
    fn leaves(&self, likelihood: &Likelihood, nodes: &[Node]) -> Vec<Leaf> {
        let mut best = f64::NEG_INFINITY;
        let leaf = |node: &Node| {
            let place = self.centre(*node);
            let mass = likelihood.log_likelihood(&place, best - NEGLIGIBLE)?;
            best = best.max(mass);
            let (column, row) = self.cell(*node);
            Some(Leaf { place, column, row, mass })
        };
        let mut leaves: Vec<Leaf> = nodes.iter().filter_map(leaf).collect();
        leaves.retain(|leaf| leaf.mass >= best - NEGLIGIBLE);
        leaves
    }

    fn centre(&self, node: Node) -> Point2 {
        let size = self.size();
        let half_grid = 0.5 * self.grid.cells as f64 * self.grid.resolution;
        let place = |index: usize, middle: f64| middle - half_grid + (index as f64 + 0.5) * size;
        Point2::new(place(node.column, self.grid.centre.x), place(node.row, self.grid.centre.y))
    }

    /// The centre, unless it is beyond the end of the grid, as is possible in the last row and column.
    fn centre_on_grid(&self, node: Node) -> Option<Point2> {
        let limit = self.grid.cells as f64 * self.grid.resolution;
        let on_grid = |index: usize| (index as f64 + 0.5) * self.size() < limit;
        (on_grid(node.column) && on_grid(node.row)).then(|| self.centre(node))
    }

    /// Column and row of the cell of a node of at most a cell's size.
    fn cell(&self, node: Node) -> (usize, usize) {
        let parts = (-self.level).max(0);
        (node.column >> parts, node.row >> parts)
    }

    /// The next level, and the four quarters of each node that begin on the grid.
    fn halved(&self, nodes: &[Node]) -> (Self, Vec<Node>) {
        let next = Self { grid: self.grid, level: self.level - 1 };
        let limit = match next.level >= 0 {
            true => self.grid.cells.div_ceil(1 << next.level),
            false => self.grid.cells << -next.level,
        };
        let quarters = |node: &Node| {
            let (column, row) = (2 * node.column, 2 * node.row);
            [(column, row), (column + 1, row), (column, row + 1), (column + 1, row + 1)]
        };
        let on_grid = |(column, row): (usize, usize)| (column < limit && row < limit).then_some(Node { column, row });
        (next, nodes.iter().flat_map(quarters).filter_map(on_grid).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::super::Ring;
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    fn product(tag: Point2, positions: &[(f64, f64)], errors: &[f64], outlier_share: f64) -> Likelihood {
        let rings = positions.iter().zip(errors.iter().cycle()).map(|(&(x, y), error)| {
            let centre = Point2::new(x, y);
            Ring { centre, radius: (tag - centre).norm() + error, variance: 0.05 * 0.05 }
        });
        Likelihood::of_rings(rings.collect::<Vec<_>>().into_iter(), outlier_share, 3.0)
    }

    /// Every part of every cell of the grid, one by one.
    fn plain(product: &Likelihood, grid: GridSize, leaf_size: f64) -> BTreeMap<(usize, usize), f64> {
        let parts = (grid.resolution / leaf_size).round() as usize;
        let corner = 0.5 * grid.cells as f64 * grid.resolution;
        let mut values = Vec::new();
        for row in 0..grid.cells * parts {
            for column in 0..grid.cells * parts {
                let x = grid.centre.x - corner + (column as f64 + 0.5) * leaf_size;
                let y = grid.centre.y - corner + (row as f64 + 0.5) * leaf_size;
                let value = product.log_likelihood(&Point2::new(x, y), f64::NEG_INFINITY).unwrap();
                values.push(((column / parts, row / parts), value));
            }
        }
        let best = values.iter().map(|(_, value)| *value).max_by(f64::total_cmp).unwrap();
        let total: f64 = values.iter().map(|(_, value)| (value - best).exp()).sum();
        let mut masses = BTreeMap::new();
        for (cell, value) in values {
            *masses.entry(cell).or_insert(0.0) += (value - best).exp() / total;
        }
        masses
    }

    fn assert_equals_plain(product: &Likelihood, grid: GridSize) -> Posterior {
        let posterior = Posterior::new(product, grid).unwrap();
        let mut masses = plain(product, grid, posterior.leaf_size);
        for leaf in &posterior.leaves {
            *masses.get_mut(&(leaf.column, leaf.row)).unwrap() -= leaf.mass;
        }
        let difference: f64 = masses.values().map(|difference| difference.abs()).sum();
        assert!(difference < 1e-5, "{difference}");
        posterior
    }

    const GRID: GridSize = GridSize { centre: Point2::new(0.4, -0.2), cells: 150, resolution: 0.04 };

    #[test]
    fn one_reading_is_a_whole_ring() {
        let posterior = assert_equals_plain(&product(Point2::new(1.0, 1.0), &[(0.0, 0.0)], &[0.0], 0.0), GRID);
        assert!(posterior.leaves.len() > 1000);
    }

    #[test]
    fn with_outliers_one_reading_leaves_the_whole_grid() {
        let posterior = assert_equals_plain(&product(Point2::new(1.0, 1.0), &[(0.0, 0.0)], &[0.0], 0.05), GRID);
        assert_eq!(posterior.leaves.len(), 150 * 150);
    }

    #[test]
    fn a_straight_drive_leaves_both_modes() {
        let drive: Vec<_> = (0..60).map(|step| (-1.0 + 0.04 * f64::from(step), 0.0)).collect();
        let posterior = assert_equals_plain(&product(Point2::new(0.5, 1.2), &drive, &[0.03, -0.02, -0.01], 0.02), GRID);
        let above: f64 = posterior.leaves.iter().filter(|leaf| leaf.place.y > 0.0).map(|leaf| leaf.mass).sum();
        assert!((above - 0.5).abs() < 1e-6, "{above}");
    }

    #[test]
    fn a_spot_narrower_than_a_cell_is_resolved() {
        let circle: Vec<_> = (0..300).map(|step| (0.4 + f64::from(step).cos(), -0.2 + f64::from(step).sin())).collect();
        let tag = Point2::new(0.513, -0.291);
        let posterior = assert_equals_plain(&product(tag, &circle, &[0.05, -0.05], 0.0), GRID);
        assert!(posterior.leaf_size <= 0.005);
        let mean =
            posterior.leaves.iter().fold(nalgebra::Vector2::zeros(), |sum, leaf| sum + leaf.place.coords * leaf.mass);
        assert!((mean - tag.coords).norm() < 1e-3, "{mean}");
    }

    #[test]
    fn a_narrow_mode_across_the_raster_is_resolved() {
        // Seen from far away, the mode is eight times as long as it is wide, and at 45 degrees to the raster.
        let drive: Vec<_> =
            (0..200).map(|step| 0.0314 * f64::from(step)).map(|a| (0.4 * a.cos(), 0.4 * a.sin())).collect();
        for shift in [0.0, 0.007, 0.013] {
            let tag = Point2::new(1.6 + shift, 1.6 - shift);
            let product = product(tag, &drive, &[0.05, -0.05], 0.0);
            let posterior = Posterior::new(&product, GRID).unwrap();
            let mean = posterior.leaves.iter().map(|leaf| leaf.place.coords * leaf.mass).sum::<Vector2<f64>>();
            let along = |direction: Vector2<f64>| -> f64 {
                let square = |leaf: &Leaf| direction.dot(&(leaf.place.coords - mean)).powi(2) * leaf.mass;
                posterior.leaves.iter().map(square).sum::<f64>().sqrt()
            };
            let (away, across) =
                (along(Vector2::new(0.5f64.sqrt(), 0.5f64.sqrt())), along(Vector2::new(0.5f64.sqrt(), -0.5f64.sqrt())));
            // By the Fisher information: 0.05 m / sqrt(200), and that over the spread of the directions.
            let expected = 0.05 / 200f64.sqrt();
            let spread = 0.4 / 2f64.sqrt() / tag.coords.norm();
            assert!((away / expected - 1.0).abs() < 0.03, "{away} {expected}");
            assert!((across / (expected / spread) - 1.0).abs() < 0.05, "{across} {}", expected / spread);
            assert!((mean - tag.coords).norm() < 0.1 * expected / spread, "{mean}");
        }
    }

    #[test]
    fn no_rings_give_no_posterior() {
        assert!(Posterior::new(&Likelihood::of_rings(std::iter::empty(), 0.0, 3.0), GRID).is_none());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]
        #[test]
        fn it_equals_the_whole_grid(
            x in -2.0..2.0, y in -2.0..2.0,
            positions in prop::collection::vec((-2.0..2.0, -2.0..2.0), 1..20),
            errors in prop::collection::vec(-0.2..0.2, 1..5),
            pure: bool, cells in 20usize..80,
        ) {
            let product = product(Point2::new(x, y), &positions, &errors, if pure { 0.0 } else { 0.02 });
            let grid = GridSize { centre: Point2::new(0.1, 0.1), cells, resolution: 6.0 / cells as f64 };
            let posterior = Posterior::new(&product, grid).unwrap();
            // The parts of a cell that the plain evaluation visits are few enough.
            prop_assume!(grid.resolution / posterior.leaf_size * cells as f64 <= 200.0);
            assert_equals_plain(&product, grid);
        }
    }
}
