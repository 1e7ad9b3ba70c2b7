//! Paths that could coincide at a turn, and how many do at a translation.

use super::Topology;
use nalgebra::Vector2;
use std::ops::Range;

/// Two paths that coincide at some translation: those that align their first and their second ends.
#[derive(Clone, Copy)]
struct Candidate {
    first: Vector2<f64>,
    second: Vector2<f64>,
    /// The translation that aligns their middles.
    middle: Vector2<f64>,
}

/// A trial at which paths coincide.
#[derive(Clone, Copy)]
pub(super) struct Trial {
    pub(super) translation: Vector2<f64>,
    pub(super) similarity: usize,
    /// Of the ends of the paths that coincide, squared and summed up.
    pub(super) distance: f64,
}

/// The pairs of paths that coincide at some translation.
///
/// They lie in columns of the translation in their middle, each as wide as what lies within the tolerance of a point:
/// if both ends are within the tolerance, so is their midpoint, so that a trial looks at parts of two columns.
pub(super) struct Candidates {
    /// By column, then by y.
    sorted: Vec<Candidate>,
    /// The number of each column and the end of its candidates, ascending.
    columns: Vec<(i64, usize)>,
    tolerance: f64,
}

impl Candidates {
    /// Those of the paths of map a and of map b, whose nodes are `turned`.
    pub(super) fn new(a: &Topology, b: &Topology, turned: &[Vector2<f64>], tolerance: f64) -> Self {
        let mut found = Vec::new();
        each_candidate(a, b, turned, tolerance, |candidate| found.push(candidate));
        let column_of = |candidate: &Candidate| column(candidate.middle.x, tolerance);
        found.sort_by(|one, other| column_of(one).cmp(&column_of(other)).then(one.middle.y.total_cmp(&other.middle.y)));
        let mut columns: Vec<(i64, usize)> = Vec::new();
        for (at, candidate) in found.iter().enumerate() {
            match columns.last_mut() {
                Some((number, end)) if *number == column_of(candidate) => *end = at + 1,
                _ => columns.push((column_of(candidate), at + 1)),
            }
        }
        Self { sorted: found, columns, tolerance }
    }

    /// The most paths that can coincide at a translation: those whose middles lie within the tolerance along x, rounded
    /// up to columns, and along y.
    pub(super) fn most_at(&self, translation: &Vector2<f64>) -> usize {
        self.near(translation).map(|near| near.len()).sum()
    }

    /// Counts the paths that coincide at a translation.
    pub(super) fn trial(&self, translation: Vector2<f64>) -> Trial {
        let mut trial = Trial { translation, similarity: 0, distance: 0.0 };
        let most = self.tolerance * self.tolerance;
        for candidate in self.near(&translation).flatten() {
            let first = (candidate.first - translation).norm_squared();
            let second = (candidate.second - translation).norm_squared();
            if first <= most && second <= most {
                trial.similarity += 1;
                trial.distance += first + second;
            }
        }
        trial
    }

    /// The candidates of the columns that a trial reaches, as far as it reaches along y.
    fn near(&self, translation: &Vector2<f64>) -> impl Iterator<Item = &[Candidate]> {
        let [left, right] = [-1.0, 1.0].map(|side| column(translation.x + side * self.tolerance, self.tolerance));
        let [lowest, highest] = [-1.0, 1.0].map(|side| translation.y + side * self.tolerance);
        (left..=right).map(move |number| {
            let column = &self.sorted[self.column(number)];
            let start = column.partition_point(|candidate| candidate.middle.y < lowest);
            let end = column.partition_point(|candidate| candidate.middle.y <= highest);
            &column[start..end.max(start)]
        })
    }

    /// The candidates of a column.
    fn column(&self, number: i64) -> Range<usize> {
        let at = self.columns.partition_point(|(before, _)| *before < number);
        let start = at.checked_sub(1).map_or(0, |before| self.columns[before].1);
        let end = self.columns.get(at).filter(|(found, _)| *found == number).map_or(start, |(_, end)| *end);
        start..end
    }
}

/// The most paths that can coincide at any translation: the number of candidates in a square of four cells, as a trial
/// reaches no more than those.
pub(super) fn most_anywhere(a: &Topology, b: &Topology, turned: &[Vector2<f64>], tolerance: f64) -> usize {
    let mut cells: Vec<[i64; 2]> = Vec::new();
    each_candidate(a, b, turned, tolerance, |candidate| {
        cells.push([column(candidate.middle.x, tolerance), column(candidate.middle.y, tolerance)]);
    });
    cells.sort_unstable();
    let counts: Vec<([i64; 2], usize)> = cells.chunk_by(PartialEq::eq).map(|same| (same[0], same.len())).collect();
    let count = |cell: [i64; 2]| counts.binary_search_by_key(&cell, |(cell, _)| *cell).map_or(0, |at| counts[at].1);
    let square = |[x, y]: [i64; 2]| -> usize {
        let [right, above] = [x, y].map(|number| number.saturating_add(1));
        [[x, y], [right, y], [x, above], [right, above]].into_iter().map(count).sum()
    };
    let squares = counts.iter().flat_map(|([x, y], _)| {
        let [left, below] = [x, y].map(|number| number.saturating_sub(1));
        [[*x, *y], [left, *y], [*x, below], [left, below]]
    });
    squares.map(square).max().unwrap_or(0)
}

/// Each pair of paths whose ends can be aligned within the tolerance.
fn each_candidate(a: &Topology, b: &Topology, turned: &[Vector2<f64>], tolerance: f64, mut add: impl FnMut(Candidate)) {
    let paths_a: Vec<[usize; 2]> = a.long_paths(tolerance).collect();
    for [start, end] in b.long_paths(tolerance) {
        let along = turned[end] - turned[start];
        for ends in &paths_a {
            let [first, second] = ends.map(|node| a.nodes[node].coords);
            let across = second - first;
            let mut align = |start: usize, end: usize| {
                let (first, second) = (first - turned[start], second - turned[end]);
                add(Candidate { first, second, middle: 0.5 * (first + second) });
            };
            if (across - along).norm() <= 2.0 * tolerance {
                align(start, end);
            }
            if (across + along).norm() <= 2.0 * tolerance {
                align(end, start);
            }
        }
    }
}

/// The number of the column of an x.
fn column(x: f64, tolerance: f64) -> i64 {
    (x / (2.0 * tolerance)).floor() as i64
}
