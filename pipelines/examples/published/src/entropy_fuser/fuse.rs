//! The entropy filter on cells and on maps.

use crate::log_odds::LogOdds;
use gridweave_stages::shared::geometry::{Grid, GridGeometry, UNKNOWN, is_known, most_cells_over, pose};
use rayon::prelude::*;

/// Largest distance of cells of two maps that count as the same, in cells: the rounding errors of coordinates.
const SAME_CELL: f64 = 0.01;

/// Log-odds of a cell with the log-odds `a` and `b` in two maps: their sum if its entropy is not above that of the
/// better one, else the better one; the first of equally good ones.
///
/// The entropy of a cell falls with the absolute value of its log-odds, so these are compared.
pub fn entropy_filter(a: f32, b: f32) -> f32 {
    let (sum, better) = (a + b, if b.abs() > a.abs() { b } else { a });
    if sum.abs() >= better.abs() { sum } else { better }
}

/// Why a map is not in the fused one.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LeftOut {
    /// Its cells are not on the lattice of the others.
    #[error("its cells are not on the lattice of the earlier maps; is it a map of `uncertain_transform`?")]
    OtherLattice,
    /// The fused map would have too many cells.
    #[error("the fused map would have more than {0:.0} cells; is the pose of the map right?")]
    TooLarge(f64),
}

/// Offset of the cells of a map in another one on the same lattice: column and row of its first cell, in cells of the
/// other.
fn offset(of: &GridGeometry, within: &GridGeometry) -> Result<(i64, i64), LeftOut> {
    let relative = within.origin.inverse() * of.origin;
    let longest = of.width.max(of.height).max(1) as f64;
    let is_turned = relative.rotation.angle().abs() * longest > SAME_CELL;
    let is_scaled = (of.resolution / within.resolution - 1.0).abs() * longest > SAME_CELL;
    let cells = relative.translation.vector / within.resolution;
    let is_off = cells.iter().any(|place| !((place - place.round()).abs() <= SAME_CELL && place.abs() < 1e9));
    match is_turned || is_scaled || is_off {
        true => Err(LeftOut::OtherLattice),
        false => Ok((cells.x.round() as i64, cells.y.round() as i64)),
    }
}

/// The grid over all maps on the lattice of the first, and whether each of them is on it. `None` without a map.
pub fn common_grid(maps: &[Grid<'_>], max_cells: u64) -> (Option<GridGeometry>, Vec<Result<(), LeftOut>>) {
    let mut over: Option<GridGeometry> = None;
    let mut known = 0.0;
    let join = |map: &Grid<'_>| {
        let Some(covered) = &over else {
            over = Some(map.geometry);
            return Ok(());
        };
        let (column, row) = offset(&map.geometry, covered)?;
        let (left, low) = (column.min(0), row.min(0));
        let right = (covered.width as i64).max(column + map.geometry.width as i64);
        let high = (covered.height as i64).max(row + map.geometry.height as i64);
        let (width, height) = ((right - left) as usize, (high - low) as usize);
        known += map.geometry.cell_count() as f64 + covered.cell_count() as f64;
        let most = most_cells_over(known).min(max_cells as f64);
        if width as f64 * height as f64 > most {
            return Err(LeftOut::TooLarge(most));
        }
        let corner = pose(left as f64 * covered.resolution, low as f64 * covered.resolution, 0.0);
        over = Some(GridGeometry { width, height, resolution: covered.resolution, origin: covered.origin * corner });
        Ok(())
    };
    let takes_part = maps.iter().map(join).collect();
    (over, takes_part)
}

/// Fuses maps, earlier ones first, into the cells of `geometry`, which covers all of them: see [`common_grid`]. A map
/// off its lattice is left out.
pub fn fuse(maps: &[Grid<'_>], geometry: &GridGeometry, table: &LogOdds, fused: &mut [i8]) {
    let placed: Vec<(i64, i64, &Grid<'_>)> =
        maps.iter().filter_map(|map| offset(&map.geometry, geometry).ok().map(|(x, y)| (x, y, map))).collect();
    let width = geometry.width.max(1);
    // Unknown cells are NaN.
    let row_of_sums = || vec![f32::NAN; width];
    fused.par_chunks_mut(width).enumerate().for_each_init(row_of_sums, |sums, (row, cells)| {
        sums.fill(f32::NAN);
        for (left, low, map) in &placed {
            let Ok(row) = usize::try_from(row as i64 - low) else { continue };
            if row >= map.geometry.height {
                continue;
            }
            let values = &map.cells[row * map.geometry.width..(row + 1) * map.geometry.width];
            // A map on the lattice that extends beyond the grid is cropped.
            let (skip, first) = ((-left).max(0) as usize, (*left).max(0) as usize);
            for (sum, value) in sums.iter_mut().skip(first).zip(values.iter().skip(skip)) {
                if is_known(*value) {
                    let log_odds = table.of(*value);
                    *sum = if sum.is_nan() { log_odds } else { entropy_filter(*sum, log_odds) };
                }
            }
        }
        for (cell, sum) in cells.iter_mut().zip(sums.iter()) {
            *cell = if sum.is_nan() { UNKNOWN } else { table.value(*sum) };
        }
    });
}
