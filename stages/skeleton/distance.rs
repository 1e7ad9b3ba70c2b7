//! The distance from free cells to what is not free.

use super::{FreeSpace, Window};
use crate::geometry::Cell;
use rayon::prelude::*;

/// Rows that one thread takes at a time.
const ROWS: usize = 32;

/// The distance from the centre of each free cell to the centre of the nearest cell that is not free. What lies beyond the
/// grid is not free.
#[derive(Clone, Debug, PartialEq)]
pub struct DistanceMap {
    pub(super) window: Window,
    /// For each cell of the window, in cells; 0 where it is not free.
    pub(super) distances: Vec<f32>,
}

impl DistanceMap {
    /// The exact distances, in a time that grows with the number of cells: along columns first, and from these along rows by
    /// the lower envelope of parabolas (Felzenszwalb and Huttenlocher, "Distance transforms of sampled functions", 2012).
    pub fn of(space: FreeSpace) -> Self {
        let FreeSpace { window, cells } = space;
        let along_columns = distances_along_columns(&cells, window.stride);
        let mut distances = vec![0.0; cells.len()];
        let rows = distances.par_chunks_mut(window.stride * ROWS).zip(along_columns.par_chunks(window.stride * ROWS));
        rows.for_each_init(Vec::new, |envelope, (into, from)| {
            for (into, from) in into.chunks_exact_mut(window.stride).zip(from.chunks_exact(window.stride)) {
                distances_of_row(from, into, envelope);
            }
        });
        Self { window, distances }
    }

    /// The distance at a cell, metres; 0 where it is not free, or not on the grid.
    pub fn distance(&self, cell: Cell) -> f64 {
        self.window.index(cell).map_or(0.0, |index| self.at(index))
    }

    /// The distance at a cell of the window, metres.
    pub(super) fn at(&self, index: usize) -> f64 {
        f64::from(self.distances[index]) * self.window.geometry.resolution
    }
}

/// How many cells each is from the nearest one of its column that is not free.
fn distances_along_columns(cells: &[u8], stride: usize) -> Vec<u16> {
    let mut distances = vec![0u16; cells.len()];
    for start in (stride..cells.len()).step_by(stride) {
        let (above, row) = distances[start - stride..].split_at_mut(stride);
        for ((distance, before), cell) in row.iter_mut().zip(above).zip(&cells[start..]) {
            *distance = before.saturating_add(1) * u16::from(*cell);
        }
    }
    for start in (stride..cells.len()).step_by(stride).rev() {
        let (above, row) = distances[start - stride..].split_at_mut(stride);
        for (distance, after) in above.iter_mut().zip(row) {
            *distance = (*distance).min(after.saturating_add(1));
        }
    }
    distances
}

/// A parabola of the lower envelope: the distances, squared, that one cell of the row stands for.
#[derive(Clone, Copy)]
struct Parabola {
    column: f64,
    /// Its value at its own column.
    least: f64,
    /// From where on it is the lowest.
    from: f64,
}

/// Distances in the plane for a row, from those along columns. Beyond the cells that bound a stretch of free ones, nothing is
/// nearer than they.
fn distances_of_row(along_columns: &[u16], distances: &mut [f32], envelope: &mut Vec<Parabola>) {
    let mut column = 1;
    while let Some(start) = along_columns[column.min(along_columns.len())..].iter().position(|distance| *distance > 0) {
        let start = column + start;
        let length = along_columns[start..].iter().position(|distance| *distance == 0);
        let end = start + length.unwrap_or(along_columns.len() - start);
        envelope.clear();
        for (column, distance) in (start - 1..).zip(&along_columns[start - 1..(end + 1).min(along_columns.len())]) {
            let distance = f64::from(*distance);
            append_parabola(envelope, column as f64, distance * distance);
        }
        read_envelope(envelope, start, &mut distances[start..end]);
        column = end + 1;
    }
}

fn append_parabola(envelope: &mut Vec<Parabola>, column: f64, least: f64) {
    let mut from = f64::NEG_INFINITY;
    while let Some(last) = envelope.last() {
        let apart = column - last.column;
        from = 0.5 * (column + last.column) + 0.5 * (least - last.least) / apart;
        if from > last.from {
            break;
        }
        envelope.pop();
        from = f64::NEG_INFINITY;
    }
    envelope.push(Parabola { column, least, from });
}

fn read_envelope(envelope: &[Parabola], start: usize, distances: &mut [f32]) {
    let mut number = 0;
    for (column, distance) in (start..).zip(distances) {
        let column = column as f64;
        while envelope.get(number + 1).is_some_and(|next| next.from < column) {
            number += 1;
        }
        let Parabola { column: of, least, .. } = envelope[number];
        *distance = ((column - of) * (column - of) + least).sqrt() as f32;
    }
}
