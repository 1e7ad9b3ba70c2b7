//! Thinning of free space to a line one cell wide.

use super::{DistanceMap, Window};
use rayon::prelude::*;

/// Cells are taken away in the order of their distances in steps of this part of a cell.
const STEPS_PER_CELL: f32 = 4.0;
/// A cell from which the distance grows by less than this from centre to centre, to each of its neighbours, lies on a
/// ridge. Towards a square corner a ridge falls by 0.71, in a corridor of even width by 0, and on a slope there is a
/// neighbour beyond whose distance is greater by 0.92 or more.
const RIDGE_SLOPE: f32 = 0.55;

/// Rows that are sorted together.
const BAND: usize = 32;
/// Cells of a row that are looked through together.
const PIECE: usize = 16;

/// A skeleton: lines one cell wide with the connectivity of the free space.
#[derive(Clone, Debug, PartialEq)]
pub struct Skeleton {
    pub(super) window: Window,
    /// 1 for each cell of the window that is on the skeleton, 0 for others.
    pub(super) cells: Vec<u8>,
    /// Indices in `cells` that are on the skeleton, row by row.
    pub(super) places: Vec<u32>,
}

impl Skeleton {
    /// Skeleton of all cells that are at least `min_clearance` metres from cells that are not free.
    ///
    /// Cells are removed one by one, those nearest to obstacles first, as long as the connectivity is unchanged: of
    /// its pieces by sides and corners, of its holes by sides only (distance-ordered homotopic thinning: Pudney
    /// 1998). Cells of ridges stay at first, so that the lines extend as far as the ridges, and are then thinned from
    /// the four sides alternately until no cell but the end of a line could be removed.
    pub fn of(distances: &DistanceMap, min_clearance: f64) -> Self {
        let window = distances.window.clone();
        let least = (min_clearance / window.geometry.resolution).max(1.0) as f32;
        // An index in the window is kept in 32 bits; a map with more cells than that has no skeleton.
        if u32::try_from(window.cell_count()).is_err() {
            return Self { cells: vec![0; window.cell_count()], window, places: Vec::new() };
        }
        let stride = window.stride;
        let mut cells = vec![0; window.cell_count()];
        let bands = cells.par_chunks_mut(stride * BAND).enumerate();
        let sorted = |kinds: &mut Vec<u32>, (number, cells): (usize, &mut [u8])| {
            Band::of(distances, least, number, cells, kinds)
        };
        let bands: Vec<Band> = bands.map_init(Vec::new, sorted).collect();
        let mut rest = Vec::new();
        let steps = bands.iter().map(|band| band.starts.len()).max().unwrap_or_default();
        for place in (0..steps).flat_map(|step| bands.iter().flat_map(move |band| band.slopes_of(step))) {
            match is_removable(neighbourhood(&cells, *place as usize, stride)) {
                true => cells[*place as usize] = 0,
                false => rest.push(*place),
            }
        }
        rest.extend(bands.iter().flat_map(|band| &band.ridges));
        thin_from_four_sides(&mut cells, rest, stride);
        // Most of a row is empty, and passed over as a whole.
        let is_there = |place: &u32| cells[*place as usize] == 1;
        let pieces = cells.chunks(PIECE).zip((0..).step_by(PIECE));
        let places = pieces.filter(|(piece, _)| piece.iter().fold(0, |any, cell| any | cell) == 1);
        let places = places.flat_map(|(piece, first)| (first..first + piece.len() as u32).filter(is_there)).collect();
        Self { window, cells, places }
    }
}

/// What there is to do in some rows of a window.
struct Band {
    /// The places of ridges, row by row.
    ridges: Vec<u32>,
    /// The places of all other cells that have the clearance, by steps of their distances, and row by row within a
    /// step.
    slopes: Vec<u32>,
    /// Where in `slopes` each step begins, and where the last ends.
    starts: Vec<usize>,
}

/// A cell without the clearance.
const NARROW: u32 = 0;
/// A cell of a ridge. What is greater by more than a number of steps stands for a slope at so many.
const RIDGE: u32 = 1;

impl Band {
    /// Sorts the cells of the rows from `number * BAND` on that have a clearance of `least`, and marks them in `cells`.
    /// The memory of `kinds` is used again.
    fn of(distances: &DistanceMap, least: f32, number: usize, cells: &mut [u8], kinds: &mut Vec<u32>) -> Self {
        let (stride, all) = (distances.window.stride, &distances.distances);
        kinds.clear();
        kinds.resize(cells.len(), NARROW);
        for (row, kinds) in (number * BAND..).zip(kinds.chunks_exact_mut(stride)) {
            // The rim is never free.
            if let Some(rows) = row.checked_sub(1).and_then(|above| all.get(above * stride..(row + 2) * stride)) {
                classify(rows, least, kinds);
            }
        }
        for (cell, kind) in cells.iter_mut().zip(&*kinds) {
            *cell = u8::from(*kind != NARROW);
        }
        let steps = kinds.iter().fold(RIDGE, |most, kind| most.max(*kind)) as usize - RIDGE as usize;
        // By kind at first: one place more than there are steps.
        let mut counts = vec![0; steps + 2];
        kinds.iter().filter(|kind| **kind != NARROW).for_each(|kind| counts[*kind as usize] += 1);
        let mut ridges = Vec::with_capacity(counts[RIDGE as usize]);
        let mut starts = vec![0; steps + 1];
        for step in 0..steps {
            starts[step + 1] = starts[step] + counts[step + 2];
        }
        let mut slopes = vec![0; starts[steps]];
        let next = &mut counts;
        next[2..].copy_from_slice(&starts[..steps]);
        let first = (number * BAND * stride) as u32;
        for (place, &kind) in (first..).zip(&*kinds).filter(|(_, kind)| **kind != NARROW) {
            match kind {
                RIDGE => ridges.push(place),
                _ => {
                    let next = &mut next[kind as usize];
                    slopes[*next] = place;
                    *next += 1;
                }
            }
        }
        Self { ridges, slopes, starts }
    }

    /// The places of a step.
    fn slopes_of(&self, step: usize) -> &[u32] {
        match self.starts.get(step..step + 2) {
            Some(&[start, end]) => &self.slopes[start..end],
            _ => &[],
        }
    }
}

/// Classifies the cells of the middle one of three rows of distances: [`NARROW`] with less clearance than `least`,
/// [`RIDGE`], or beyond that a step of the distance.
fn classify(rows: &[f32], least: f32, kinds: &mut [u32]) {
    let (stride, inner) = (kinds.len(), kinds.len() - 2);
    // The cells to the left of those within the rim, these, and those to the right.
    let three = |row: usize| [0, 1, 2].map(|from| &rows[row * stride + from..][..inner]);
    let ([above_left, above, above_right], [left, here, right], [below_left, below, below_right]) =
        (three(0), three(1), three(2));
    let greater = |one: f32, other: f32| if one > other { one } else { other };
    for (column, kind) in kinds[1..].iter_mut().take(inner).enumerate() {
        let at = here[column];
        let beside = greater(greater(above[column], below[column]), greater(left[column], right[column]));
        let at_corners =
            greater(greater(above_left[column], above_right[column]), greater(below_left[column], below_right[column]));
        let is_ridge = (beside - at < RIDGE_SLOPE) & (at_corners - at < RIDGE_SLOPE * std::f32::consts::SQRT_2);
        let slope = RIDGE + 1 + (at * STEPS_PER_CELL) as u32;
        let with_clearance = if is_ridge { RIDGE } else { slope };
        *kind = if at >= least { with_clearance } else { NARROW };
    }
}

/// Removes from `rest` all removable cells except the ends of lines.
fn thin_from_four_sides(cells: &mut [u8], mut rest: Vec<u32>, stride: usize) {
    let mut side_cells: Vec<u32> = Vec::new();
    loop {
        let before = rest.len();
        for side in [-(stride as isize), stride as isize, -1, 1] {
            // Only cells that are open to this side now, or a line two cells wide would be removed from its end.
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

/// Which of the eight neighbours of a cell are there: a bit each, column by column.
pub(super) fn neighbourhood(cells: &[u8], place: usize, stride: usize) -> u8 {
    // Three cells of a row, in the lowest bits of three bytes. What reaches beyond the last cell is the rim, where
    // nothing is.
    let three = |place: usize| match cells.get(place - 1..place + 3) {
        Some(&[before, at, behind, _]) => u32::from_le_bytes([before, at, behind, 0]),
        _ => 0,
    };
    let nine = three(place - stride) | three(place) << 1 | three(place + stride) << 2;
    (nine & 0b111 | nine >> 5 & 0b1000 | nine >> 6 & 0b1_0000 | nine >> 11 & 0b1110_0000) as u8
}

/// Whether the connectivity is unchanged without a cell with these neighbours.
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

/// The connectivity number of a cell for lines that hang together by sides and corners (Yokoi, Toriwaki and Fukumura
/// 1975): 0 for one that stands alone or is surrounded, 1 for one that can be taken away, more for one that ties pieces
/// together.
const fn connectivity_number(neighbours: usize) -> usize {
    // The bits of the eight neighbours on the way round the cell, from the right one.
    const ROUND: [usize; 8] = [6, 5, 3, 0, 1, 2, 4, 7];
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
