//! From free space to a line one cell wide.

use super::{DistanceMap, Window};
use rayon::prelude::*;

/// Cells are taken away in the order of their distances in steps of this part of a cell.
const STEPS_PER_CELL: f32 = 4.0;
/// A cell from which the distance grows by less than this from centre to centre, to each of its neighbours, lies on a ridge. Towards
/// a square corner a ridge falls by 0.71, in a corridor of even width by 0, and on a slope there is a neighbour beyond whose
/// distance is greater by 0.92 or more.
const RIDGE_SLOPE: f32 = 0.55;

/// A skeleton: lines one cell wide that hang together as the free space did.
#[derive(Clone, Debug, PartialEq)]
pub struct Skeleton {
    pub(super) window: Window,
    /// 1 for each cell of the window that is on the skeleton, 0 for others.
    pub(super) cells: Vec<u8>,
    /// The places in `cells` that are on the skeleton, row by row.
    pub(super) places: Vec<u32>,
}

impl Skeleton {
    /// The skeleton of all cells that are at least `min_clearance` metres from what is not free.
    ///
    /// Cells are taken away one by one, those nearest to obstacles first, as long as the rest hangs together as before: its
    /// pieces by sides and corners, its holes by sides alone (distance-ordered homotopic thinning: Pudney 1998). Cells
    /// of ridges stay at first, so that the lines reach as far as the ridges, and are then thinned from four
    /// sides by turns until no cell but the end of a line could be taken away.
    pub fn of(distances: &DistanceMap, min_clearance: f64) -> Self {
        let window = distances.window.clone();
        let least = (min_clearance / window.geometry.resolution).max(1.0) as f32;
        // A place in the window is kept in 32 bits; a map with more cells than that has no skeleton.
        if u32::try_from(window.cell_count()).is_err() {
            return Self { cells: vec![0; window.cell_count()], window, places: Vec::new() };
        }
        let mut cells: Vec<u8> = distances.distances.iter().map(|distance| u8::from(*distance >= least)).collect();
        let ridges = ridges(distances, least);
        let is_ridge = |place: u32| ridges[place as usize] == 1;
        let mut rest = Vec::new();
        for place in by_distance(&distances.distances, &cells, &ridges) {
            match is_removable(neighbourhood(&cells, place as usize, window.stride)) {
                true => cells[place as usize] = 0,
                false => rest.push(place),
            }
        }
        rest.extend((0..cells.len() as u32).filter(|place| is_ridge(*place)));
        thin_from_four_sides(&mut cells, rest, window.stride);
        let places = (0..cells.len() as u32).filter(|place| cells[*place as usize] == 1).collect();
        Self { window, cells, places }
    }
}

/// Which cells with a clearance of `least` lie on a ridge of the distances.
fn ridges(distances: &DistanceMap, least: f32) -> Vec<u8> {
    let (stride, all) = (distances.window.stride, &distances.distances);
    let mut ridges = vec![0; all.len()];
    let rows = ridges.par_chunks_mut(stride).enumerate().skip(1);
    rows.filter(|(row, _)| (row + 2) * stride <= all.len()).for_each(|(row, ridges)| {
        let row_of = |row: usize| &all[row * stride..(row + 1) * stride];
        let (above, here, below) = (row_of(row - 1), row_of(row), row_of(row + 1));
        for column in 1..stride - 1 {
            let at = here[column];
            let beside = above[column].max(below[column]).max(here[column - 1]).max(here[column + 1]);
            let at_corners = above[column - 1].max(above[column + 1]).max(below[column - 1]).max(below[column + 1]);
            let is_ridge = beside - at < RIDGE_SLOPE && at_corners - at < RIDGE_SLOPE * std::f32::consts::SQRT_2;
            ridges[column] = u8::from(is_ridge & (at >= least));
        }
    });
    ridges
}

/// The places of all cells that are no ridges, by rising distance and row by row.
fn by_distance(distances: &[f32], cells: &[u8], ridges: &[u8]) -> Vec<u32> {
    let step = |place: usize| (distances[place] * STEPS_PER_CELL) as usize;
    let chosen = || (0..cells.len()).filter(|place| cells[*place] > ridges[*place]);
    let most = distances.iter().fold(0.0f32, |most, distance| most.max(*distance));
    let mut starts = vec![0usize; (most * STEPS_PER_CELL) as usize + 2];
    chosen().for_each(|place| starts[step(place) + 1] += 1);
    for number in 1..starts.len() {
        starts[number] += starts[number - 1];
    }
    let mut ordered = vec![0; starts.last().copied().unwrap_or_default()];
    for place in chosen() {
        let next = &mut starts[step(place)];
        ordered[*next] = place as u32;
        *next += 1;
    }
    ordered
}

/// Takes away of `rest` all that can be but the ends of lines.
fn thin_from_four_sides(cells: &mut [u8], mut rest: Vec<u32>, stride: usize) {
    let mut side_cells: Vec<u32> = Vec::new();
    loop {
        let before = rest.len();
        for side in [-(stride as isize), stride as isize, -1, 1] {
            // Only what is open to this side now, or a line two cells wide would be taken away from its end.
            side_cells.clear();
            side_cells.extend(rest.iter().filter(|place| cells[(**place as usize).wrapping_add_signed(side)] == 0));
            for &place in &side_cells {
                let around = neighbourhood(cells, place as usize, stride);
                if is_removable(around) && around.count_ones() > 1 {
                    cells[place as usize] = 0;
                }
            }
            rest.retain(|place| cells[*place as usize] == 1);
        }
        if rest.len() == before {
            return;
        }
    }
}

/// Which of the eight neighbours of a cell are there: a bit each, row by row.
pub(super) fn neighbourhood(cells: &[u8], place: usize, stride: usize) -> u8 {
    let above = &cells[place - stride - 1..place - stride + 2];
    let here = &cells[place - 1..place + 2];
    let below = &cells[place + stride - 1..place + stride + 2];
    above[0]
        | above[1] << 1
        | above[2] << 2
        | here[0] << 3
        | here[2] << 4
        | below[0] << 5
        | below[1] << 6
        | below[2] << 7
}

/// Whether all hangs together as before without a cell that has these neighbours.
pub(super) fn is_removable(neighbours: u8) -> bool {
    REMOVABLE[neighbours as usize]
}

const REMOVABLE: [bool; 256] = {
    let mut removable = [false; 256];
    let mut neighbours = 0;
    while neighbours < 256 {
        removable[neighbours] = connectivity_number(neighbours) == 1;
        neighbours += 1;
    }
    removable
};

/// The connectivity number of a cell for lines that hang together by sides and corners (Yokoi, Toriwaki and Fukumura 1975): 0
/// for one that stands alone or is surrounded, 1 for one that can be taken away, more for one that ties pieces together.
const fn connectivity_number(neighbours: usize) -> usize {
    // The bits of the eight neighbours on the way round the cell, from the right one.
    const ROUND: [usize; 8] = [4, 2, 1, 0, 3, 5, 6, 7];
    let mut number = 0;
    let mut side = 0;
    while side < 8 {
        let missing = [
            neighbours >> ROUND[side] & 1 == 0,
            neighbours >> ROUND[side + 1] & 1 == 0,
            neighbours >> ROUND[(side + 2) % 8] & 1 == 0,
        ];
        if missing[0] && !(missing[1] && missing[2]) {
            number += 1;
        }
        side += 2;
    }
    number
}
