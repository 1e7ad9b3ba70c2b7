//! Pattern of a factor: which of its columns are dense together, and in which order they are computed.

use super::Columns;
use std::ops::Range;

/// Largest share of blocks of a front that are zero: neighbouring columns of slightly different rows are joined up to
/// it, as one large front costs less than two small ones (Ashcraft and Grimes 1989, "The influence of relaxed
/// supernode partitions on the multifrontal method").
const MOST_ZEROS: f64 = 0.05;

/// Neighbouring columns of a factor with the same rows: a dense matrix.
#[derive(Clone, Debug)]
pub(super) struct Front {
    pub(super) columns: Range<usize>,
    /// Rows below those of the columns, ascending.
    pub(super) rows: Vec<usize>,
    /// Fronts whose first row below is among the columns.
    pub(super) children: Vec<usize>,
    /// Number of blocks of its columns, without the zeros that joining columns has added.
    filled: usize,
}

impl Front {
    /// Number of its columns.
    pub(super) fn own(&self) -> usize {
        self.columns.len()
    }

    /// Number of its rows.
    pub(super) fn size(&self) -> usize {
        self.columns.len() + self.rows.len()
    }

    /// The row at a place.
    pub(super) fn row(&self, place: usize) -> usize {
        if place < self.own() { self.columns.start + place } else { self.rows[place - self.own()] }
    }

    /// The place of a row, which the front has. None for others.
    pub(super) fn place(&self, row: usize) -> Option<usize> {
        if self.columns.contains(&row) {
            return Some(row - self.columns.start);
        }
        self.rows.binary_search(&row).ok().map(|place| self.own() + place)
    }

    /// The places in this front of the rows of a child below its columns.
    pub(super) fn places_of(&self, child: &Self) -> Vec<usize> {
        // Both are ascending.
        let mut place = 0;
        let place_of = |&row: &usize| {
            while self.row(place) < row {
                place += 1;
            }
            place
        };
        child.rows.iter().map(place_of).collect()
    }

    /// Whether one more column with the rows `rows` below it leaves the front dense enough.
    fn fits(&self, rows: usize) -> bool {
        let columns = self.own() + 1;
        let blocks = columns * (columns + 1) / 2 + columns * rows;
        (blocks - self.filled - rows - 1) as f64 <= MOST_ZEROS * blocks as f64
    }
}

/// The fronts of a factor. What a front leaves for later columns is added to one other front, its parent (the
/// multifrontal method; Liu 1992, "The multifrontal method for sparse matrix solution: theory and practice").
#[derive(Clone, Debug)]
pub(super) struct AssemblyTree {
    /// By their columns, so that each comes before its parent.
    pub(super) fronts: Vec<Front>,
    /// Parent of each front.
    pub(super) parents: Vec<Option<usize>>,
    /// Fronts without a parent, their children, and so on: those of one level are independent.
    pub(super) levels: Vec<Vec<usize>>,
    /// Front of each column.
    pub(super) front_of: Vec<usize>,
}

impl AssemblyTree {
    /// Computes the fronts of a matrix. A column of the factor has the rows of the matrix, and those of the fronts
    /// whose first row below is its own.
    pub(super) fn new(matrix: &Columns) -> Self {
        let mut fronts: Vec<Front> = Vec::new();
        let mut waiting: Vec<Vec<usize>> = vec![Vec::new(); matrix.len()];
        let mut front_of = Vec::with_capacity(matrix.len());
        let mut seen_in = vec![usize::MAX; matrix.len()];
        for (column, entries) in matrix.iter().enumerate() {
            let mut children = std::mem::take(&mut waiting[column]);
            let mut rows = Vec::new();
            let of_children = children.iter().flat_map(|&child| &fronts[child].rows);
            for &row in entries.iter().map(|(row, _)| row).chain(of_children).filter(|row| **row > column) {
                if std::mem::replace(&mut seen_in[row], column) != column {
                    rows.push(row);
                }
            }
            rows.sort_unstable();
            let last = fronts.len().wrapping_sub(1);
            let is_joined = children.last() == Some(&last) && fronts[last].fits(rows.len());
            if is_joined {
                children.pop();
                let front = &mut fronts[last];
                front.columns.end += 1;
                front.filled += rows.len() + 1;
                front.rows = rows;
                front.children.append(&mut children);
            } else {
                let filled = rows.len() + 1;
                fronts.push(Front { columns: column..column + 1, rows, children, filled });
            }
            let front = fronts.len() - 1;
            front_of.push(front);
            if let Some(&parent) = fronts[front].rows.first() {
                waiting[parent].push(front);
            }
        }
        let parents: Vec<Option<usize>> =
            fronts.iter().map(|front| front.rows.first().map(|&row| front_of[row])).collect();
        let levels = levels(&parents);
        Self { fronts, parents, levels, front_of }
    }
}

/// Fronts by the number of those above them.
fn levels(parents: &[Option<usize>]) -> Vec<Vec<usize>> {
    let mut depths = vec![0; parents.len()];
    let mut levels: Vec<Vec<usize>> = Vec::new();
    for front in (0..parents.len()).rev() {
        let depth = parents[front].map_or(0, |parent| depths[parent] + 1);
        depths[front] = depth;
        if levels.len() <= depth {
            levels.push(Vec::new());
        }
        levels[depth].push(front);
    }
    levels
}
