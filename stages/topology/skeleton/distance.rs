//! Distance transform of the free space.

use super::{FreeSpace, Window};
use crate::shared::geometry::Cell;
use rayon::prelude::*;

/// Rows that one thread takes at a time.
const ROWS: usize = 32;
/// Cells of a row whose distances are found together.
const CHUNK: usize = 32;
/// The greatest distance, in cells, whose square is less than [`i16::MAX`].
const MOST_NARROW: u16 = 181;
/// So many steps along the row are made before it is asked whether more are needed.
const TOGETHER: usize = 4;

/// Distance from the centre of each free cell to the centre of the nearest cell that is not free. Cells beyond the
/// grid are not free.
#[derive(Clone, Debug, PartialEq)]
pub struct DistanceMap {
    pub(super) window: Window,
    /// For each cell of the window, in cells; 0 where it is not free.
    pub(super) distances: Vec<f32>,
}

impl DistanceMap {
    /// Computes the exact distances: along columns first, and from these along rows. That is the separation of
    /// Felzenszwalb and Huttenlocher ("Distance transforms of sampled functions", 2012); but the least along a row is
    /// searched directly, as far as the distance extends and many cells at a time, which for the distances of
    /// buildings is several times as fast as the envelope of parabolas.
    pub fn of(space: FreeSpace) -> Self {
        let FreeSpace { window, cells } = space;
        let along_columns = distances_along_columns(&cells, window.stride);
        let mut distances = vec![0.0; cells.len()];
        let rows = distances.par_chunks_mut(window.stride * ROWS).zip(along_columns.par_chunks(window.stride * ROWS));
        rows.for_each_init(Squares::default, |squares, (into, from)| {
            for (into, from) in into.chunks_exact_mut(window.stride).zip(from.chunks_exact(window.stride)) {
                distances_of_row(from, into, squares);
            }
        });
        Self { window, distances }
    }

    /// Distance at a cell, metres; 0 where it is not free, or not on the grid.
    pub fn distance(&self, cell: Cell) -> f64 {
        self.window.index(cell).map_or(0.0, |index| self.at(index))
    }

    /// Distance at a cell of the window, metres.
    pub(super) fn at(&self, index: usize) -> f64 {
        f64::from(self.distances[index]) * self.window.geometry.resolution
    }
}

/// Distance of each cell from the nearest one of its column that is not free, in cells.
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

/// Squared distances along columns of one row, padded by as many cells that are not free before and after the row as
/// the row has, and [`CHUNK`] more after it. Beyond the cells that bound a stretch of free ones, nothing is nearer
/// than they.
#[derive(Default)]
struct Squares {
    /// Cut at [`i16::MAX`]: twice as many are looked at together as of `wide`.
    narrow: Vec<i16>,
    /// As they are; empty where no distance of the row called for them.
    wide: Vec<f32>,
}

impl Squares {
    fn fill(&mut self, along_columns: &[u16]) {
        let stride = along_columns.len();
        self.wide.clear();
        self.narrow.clear();
        self.narrow.resize(3 * stride + CHUNK, 0);
        for (square, distance) in self.narrow[stride..].iter_mut().zip(along_columns) {
            *square = (*distance).min(MOST_NARROW + 1).pow(2).min(i16::MAX.cast_unsigned()).cast_signed();
        }
    }

    fn wide(&mut self, along_columns: &[u16]) -> &[f32] {
        let stride = along_columns.len();
        if self.wide.is_empty() {
            self.wide.resize(3 * stride + CHUNK, 0.0);
            for (square, distance) in self.wide[stride..].iter_mut().zip(along_columns) {
                *square = f32::from(*distance) * f32::from(*distance);
            }
        }
        &self.wide
    }
}

/// Distances in the plane for a row, from those along columns: for each cell the least over all cells of the row.
/// Farther cells are tested only as long as they can be nearer than the best so far, several at a time.
fn distances_of_row(along_columns: &[u16], distances: &mut [f32], squares: &mut Squares) {
    let stride = along_columns.len();
    squares.fill(along_columns);
    for (number, (into, along)) in distances.chunks_mut(CHUNK).zip(along_columns.chunks(CHUNK)).enumerate() {
        if along.iter().all(|distance| *distance == 0) {
            continue;
        }
        let first = stride + number * CHUNK;
        let least = least_narrow(&squares.narrow, first, stride);
        if least.contains(&i16::MAX) {
            let least = least_wide(squares.wide(along_columns), first, stride);
            into.iter_mut().zip(least).for_each(|(distance, least)| *distance = least.sqrt());
        } else {
            into.iter_mut().zip(least).for_each(|(distance, least)| *distance = f32::from(least).sqrt());
        }
    }
}

/// The least squares for the cells from `first` on; [`i16::MAX`] where it is that or more.
fn least_narrow(squares: &[i16], first: usize, stride: usize) -> [i16; CHUNK] {
    let mut least = [0; CHUNK];
    least.copy_from_slice(&squares[first..first + CHUNK]);
    let greatest = |least: &[i16; CHUNK]| least.iter().fold(0, |most, square| (*square).max(most));
    let (mut most, mut apart) = (greatest(&least), 1);
    let farthest = stride.min(usize::from(MOST_NARROW));
    while apart <= farthest && apart * apart < usize::from(most.cast_unsigned()) {
        for apart in apart..(apart + TOGETHER).min(farthest + 1) {
            let square = (apart * apart) as i16;
            let (before, behind) = (&squares[first - apart..][..CHUNK], &squares[first + apart..][..CHUNK]);
            for ((least, before), behind) in least.iter_mut().zip(before).zip(behind) {
                *least = (*least).min(square.saturating_add((*before).min(*behind)));
            }
        }
        most = greatest(&least);
        apart += TOGETHER;
    }
    least
}

/// The least squares for the cells from `first` on.
fn least_wide(squares: &[f32], first: usize, stride: usize) -> [f32; CHUNK] {
    let mut least = [0.0; CHUNK];
    least.copy_from_slice(&squares[first..first + CHUNK]);
    let greatest =
        |least: &[f32; CHUNK]| least.iter().fold(0.0, |most: f32, square| if *square > most { *square } else { most });
    let (mut most, mut apart) = (greatest(&least), 1);
    while apart <= stride && ((apart * apart) as f32) < most {
        for apart in apart..(apart + TOGETHER).min(stride + 1) {
            let square = (apart * apart) as f32;
            let (before, behind) = (&squares[first - apart..][..CHUNK], &squares[first + apart..][..CHUNK]);
            for ((least, before), behind) in least.iter_mut().zip(before).zip(behind) {
                *least = lesser(*least, square + lesser(*before, *behind));
            }
        }
        most = greatest(&least);
        apart += TOGETHER;
    }
    least
}

/// The lesser of two numbers, neither of which is NaN: one instruction, many at a time.
fn lesser(one: f32, other: f32) -> f32 {
    if one < other { one } else { other }
}
