//! Fusion by inverse mapping: every output cell is looked up in the maps.

use super::evidence::{CellEvidence, EvidenceTable};
use super::known::TILE;
use super::{Fused, KnownArea, PlacedGrid};
use crate::shared::deformation::Deformation;
use crate::shared::geometry::{Grid, GridGeometry, Point2, UNKNOWN, is_known};
use nalgebra::Vector2;
use rayon::prelude::*;

/// Largest length, as a share of the distance between two nodes of a deformation, that is treated as straight.
const LONGEST_STRAIGHT: f64 = 0.75;

/// Writes the fused map of `maps` and their conflicts to `fused`, the rows of `geometry`, whose axes are those of the
/// world.
///
/// Every cell takes the evidence of each map's cell that contains its centre. Rows are independent and computed in
/// parallel.
pub fn fuse(maps: &[(PlacedGrid<'_>, &KnownArea)], geometry: &GridGeometry, table: &EvidenceTable, fused: Fused<'_>) {
    let lookups: Vec<Lookup<'_>> = maps.iter().map(|(map, area)| Lookup::new(map, area, geometry)).collect();
    let width = geometry.width.max(1);
    let rows = fused.cells.par_chunks_mut(width).zip(fused.conflicts.par_chunks_mut(width));
    rows.enumerate().for_each(|(row, (cells, conflicts))| {
        let rows: Vec<LookupRow<'_>> = lookups.iter().map(|lookup| lookup.row(row, cells.len())).collect();
        for (stretch, (cells, conflicts)) in cells.chunks_mut(TILE).zip(conflicts.chunks_mut(TILE)).enumerate() {
            let mut stretches = rows.iter().filter_map(|row| row.stretch(stretch * TILE, cells.len()));
            match (stretches.next(), stretches.next()) {
                (Some(one), Some(other)) => {
                    let mut evidence = [CellEvidence::NONE; TILE];
                    for stretch in [one, other].iter().chain(&stretches.collect::<Vec<_>>()) {
                        stretch.values(&mut evidence, |evidence, value| table.add(evidence, value));
                    }
                    cells.iter_mut().zip(&evidence).for_each(|(cell, evidence)| *cell = table.value(*evidence));
                    conflicts.iter_mut().zip(&evidence).for_each(|(cell, evidence)| *cell = table.conflict(*evidence));
                }
                // Most known cells are known to one map only, and are in no conflict.
                (only, _) => {
                    cells.fill(UNKNOWN);
                    conflicts.fill(UNKNOWN);
                    if let Some(only) = only {
                        only.values(cells, |cell, value| *cell = if is_known(value) { value } else { UNKNOWN });
                    }
                }
            }
        }
    });
}

/// Lookup of output cells in one map: its column and row are linear in the output's. With a deformation they are
/// linear over the length of a stretch, over which the deformation hardly changes.
struct Lookup<'a> {
    grid: Grid<'a>,
    area: &'a KnownArea,
    deformation: Option<&'a Deformation>,
    /// Bound of the displacement by the deformation, cells.
    deformed: f64,
    /// Column and row, with fractions, of the centre of output cell (0, 0).
    start: Point2,
    /// Their change by one output column; by one output row it is the same turned by a quarter turn.
    step: Vector2<f64>,
    /// The known columns and rows: the first, and the one after the last.
    columns: (f64, f64),
    rows: (f64, f64),
}

impl<'a> Lookup<'a> {
    fn new(map: &PlacedGrid<'a>, area: &'a KnownArea, output: &GridGeometry) -> Self {
        let transform_grid_output = map.transform_world_grid().inverse() * output.origin;
        let scale = 1.0 / map.grid.geometry.resolution;
        let half = output.resolution / 2.0;
        let (first_row, behind_rows) = area.row_range();
        Self {
            grid: map.grid,
            area,
            deformation: map.deformation,
            deformed: map
                .deformation
                .map_or(0.0, |deformation| (deformation.largest_move() / map.grid.geometry.resolution).ceil()),
            start: (transform_grid_output * Point2::new(half, half)) * scale,
            step: transform_grid_output.rotation * Vector2::new(output.resolution, 0.0) * scale,
            columns: (area.columns.0 as f64, area.columns.1 as f64),
            rows: (first_row as f64, behind_rows as f64),
        }
    }

    /// The part of an output row of `count` cells on the known part of the map.
    fn row(&self, row: usize, count: usize) -> LookupRow<'_> {
        let row = row as f64;
        let start = Point2::new(self.start.x - row * self.step.y, self.start.y + row * self.step.x);
        let widened = |(low, high): (f64, f64)| (low - self.deformed, high + self.deformed);
        let by_column = range_within(start.x, self.step.x, widened(self.columns), count);
        let by_row = range_within(start.y, self.step.y, widened(self.rows), count);
        let (from, to) = (by_column.0.max(by_row.0), by_column.1.min(by_row.1));
        let ends = self.deformation.filter(|_| from < to).map_or_else(Vec::new, |deformation| {
            let ends = (from / TILE + 1..to.div_ceil(TILE)).map(|stretch| stretch * TILE);
            let ends = std::iter::once(from).chain(ends).chain([to]);
            ends.map(|index| self.undeformed(&(start + self.step * index as f64), deformation)).collect()
        });
        LookupRow { lookup: self, start, from, to, ends }
    }

    /// Inverts the deformation of a point, both in cells.
    fn undeformed(&self, place: &Point2, deformation: &Deformation) -> Point2 {
        let GridGeometry { resolution, origin, .. } = self.grid.geometry;
        let point = deformation.inverse(&(origin * (place * resolution)));
        origin.inverse_transform_point(&point) / resolution
    }

    fn value(&self, place: &Point2) -> i8 {
        // Rounding can put the ends of a row's range outside.
        if place.x < self.columns.0 || place.x >= self.columns.1 || place.y < self.rows.0 || place.y >= self.rows.1 {
            return UNKNOWN;
        }
        let index = place.y as usize * self.grid.geometry.width + place.x as usize;
        self.grid.cells.get(index).copied().unwrap_or(UNKNOWN)
    }
}

/// One output row on one map.
struct LookupRow<'a> {
    lookup: &'a Lookup<'a>,
    /// Position of the centre of the row's first cell.
    start: Point2,
    /// The cells of the row that may be on the known part of the map: the first, and the one after the last.
    from: usize,
    to: usize,
    /// Positions of its first cell, of those at which further stretches begin, and of the one after the last, if there
    /// is a deformation: without it.
    ends: Vec<Point2>,
}

impl LookupRow<'_> {
    /// The part of the `count` output cells from `first` on that may be on known cells of the map: a tile, or what is
    /// left of the row. `None` if no cell is.
    fn stretch(&self, first: usize, count: usize) -> Option<Stretch<'_>> {
        let (from, to) = (self.from.max(first), self.to.min(first + count));
        if from >= to {
            return None;
        }
        let (mut start, mut step, mut deformation) = (self.start, self.lookup.step, None);
        if let Some(deformed) = self.lookup.deformation {
            let [one, other] = [from, to].map(|index| start + step * index as f64);
            let length = (other - one).norm() * self.lookup.grid.geometry.resolution;
            // The deformation may change within a long stretch.
            if length > LONGEST_STRAIGHT * deformed.lattice.spacing() {
                deformation = Some(deformed);
            } else {
                let number = first / TILE - self.from / TILE;
                let (one, other) = (self.ends[number], self.ends[number + 1]);
                step = (other - one) / (to - from) as f64;
                start = one - step * from as f64;
            }
        }
        let middle = start + step * ((from + to) as f64 / 2.0);
        // A stretch stays within a tile's length of its middle, if a step is no longer than two map cells.
        let may_be_known = deformation.is_some() || step.norm() > 2.0 || self.lookup.area.is_near(middle.x, middle.y);
        may_be_known.then_some(Stretch { lookup: self.lookup, first, from, to, start, step, deformation })
    }
}

/// A few cells of one output row on one map.
struct Stretch<'a> {
    lookup: &'a Lookup<'a>,
    /// The first cell of the stretch.
    first: usize,
    /// Its cells that may be on the known part of the map: the first, and the one after the last.
    from: usize,
    to: usize,
    /// Position of the centre of the row's first cell if the whole row were linear as this stretch, and its change by
    /// one cell.
    start: Point2,
    step: Vector2<f64>,
    /// Deformation by which each cell is looked up individually, if it is.
    deformation: Option<&'a Deformation>,
}

impl Stretch<'_> {
    /// Visits every cell of the stretch that may be on the known part of the map.
    fn values<T>(&self, cells: &mut [T], take: impl Fn(&mut T, i8)) {
        for (index, cell) in (self.from..self.to).zip(&mut cells[self.from - self.first..]) {
            let place = self.start + self.step * index as f64;
            let place = self.deformation.map_or(place, |deformation| self.lookup.undeformed(&place, deformation));
            take(cell, self.lookup.value(&place));
        }
    }
}

/// The indices from 0 to `count` for which `start + index * step` is within the bounds, and maybe one more at both
/// ends: the first, and the one after the last.
fn range_within(start: f64, step: f64, (low, high): (f64, f64), count: usize) -> (usize, usize) {
    if step.abs() < 1e-12 {
        return if start >= low && start < high { (0, count) } else { (0, 0) };
    }
    let (one, other) = ((low - start) / step, (high - start) / step);
    let (first, last) = (one.min(other).floor().max(0.0), (one.max(other).ceil() + 1.0).clamp(0.0, count as f64));
    if first < last { (first as usize, last as usize) } else { (0, 0) }
}

#[cfg(test)]
mod tests {
    use super::super::layout::{CellLattice, layout_of};
    use super::*;
    use crate::shared::geometry::{Pose2, is_free, is_occupied, pose};
    use proptest::prelude::*;

    fn geometry(width: usize, height: usize, resolution: f64, origin: Pose2) -> GridGeometry {
        GridGeometry { width, height, resolution, origin }
    }

    /// Fuses maps onto the lattice of the first.
    fn fuse_all(maps: &[PlacedGrid<'_>]) -> (GridGeometry, Vec<i8>) {
        let areas: Vec<KnownArea> = maps.iter().map(|map| KnownArea::of(&map.grid)).collect();
        let maps: Vec<_> = maps.iter().copied().zip(&areas).collect();
        let anchor = Point2::from(maps[0].0.transform_world_grid().translation.vector);
        let resolution = maps.iter().map(|(map, _)| map.grid.geometry.resolution).fold(f64::INFINITY, f64::min);
        let lattice = CellLattice { anchor, resolution, max_extent: 100.0, max_cells: 1_000_000 };
        let geometry = layout_of(&maps, &lattice).geometry.unwrap();
        let (mut cells, mut conflicts) = (vec![0; geometry.cell_count()], vec![0; geometry.cell_count()]);
        let fused = Fused { cells: &mut cells, conflicts: &mut conflicts };
        fuse(&maps, &geometry, &EvidenceTable::new(0.1192, 0.971), fused);
        assert!(cells.iter().zip(&conflicts).all(|(cell, conflict)| *cell != UNKNOWN || *conflict == UNKNOWN));
        (geometry, cells)
    }

    /// Cells of a made-up map; the corners are known, so that nothing is cropped.
    fn cells(width: usize, height: usize) -> impl Strategy<Value = Vec<i8>> {
        let cell = prop_oneof![Just(-1i8), Just(0), Just(100), 0i8..=100];
        prop::collection::vec(cell, width * height).prop_map(|mut cells| {
            let last = cells.len() - 1;
            (cells[0], cells[last]) = (0, 100);
            cells
        })
    }

    proptest! {
        #[test]
        fn the_reference_map_is_unchanged(cells in cells(13, 9), x in -99.0..99.0, y in -99.0..99.0) {
            let source = geometry(13, 9, 0.05, pose(x, y, 0.0));
            let grid = Grid::new(source, &cells).unwrap();
            let (fused_geometry, fused) = fuse_all(&[PlacedGrid::rigid(grid, Pose2::identity())]);
            prop_assert_eq!(fused_geometry, source);
            prop_assert_eq!(fused, cells);
        }

        #[test]
        fn a_map_fused_with_itself_keeps_free_and_occupied(cells in cells(13, 9), x in -9.0..9.0) {
            let grid = Grid::new(geometry(13, 9, 0.05, pose(x, 1.0, 0.0)), &cells).unwrap();
            let map = PlacedGrid::rigid(grid, Pose2::identity());
            let (_, fused) = fuse_all(&[map, map]);
            for (one, two) in cells.iter().zip(fused) {
                prop_assert_eq!(*one == UNKNOWN, two == UNKNOWN);
                prop_assert!(!is_free(*one) || is_free(two));
                prop_assert!(!is_occupied(*one) || is_occupied(two));
            }
        }

        #[test]
        fn the_order_of_the_maps_does_not_matter(
            first in cells(13, 9), second in cells(7, 8), third in cells(5, 4), x in -0.5..0.5, yaw in -4.0..4.0,
        ) {
            let map = |cells, geometry, transform_world_map|
                PlacedGrid::rigid(Grid::new(geometry, cells).unwrap(), transform_world_map);
            let first = map(&first, geometry(13, 9, 0.05, Pose2::identity()), Pose2::identity());
            let second = map(&second, geometry(7, 8, 0.07, pose(0.1, 0.2, 0.4)), pose(x, 0.1, yaw));
            let third = map(&third, geometry(5, 4, 0.1, Pose2::identity()), pose(0.1, x, 2.0 * yaw));
            let forward = fuse_all(&[first, second, third]);
            prop_assert_eq!(&forward, &fuse_all(&[first, third, second]));
        }

        #[test]
        fn a_turned_area_has_no_gaps(x in -9.0..9.0, y in -9.0..9.0, yaw in -4.0..4.0) {
            let cells = vec![0; 20 * 20];
            let grid = Grid::new(geometry(20, 20, 0.05, pose(0.3, -0.2, 0.7)), &cells).unwrap();
            let map = PlacedGrid::rigid(grid, pose(x, y, yaw));
            let (fused_geometry, fused) = fuse_all(&[map]);
            for row in fused.chunks(fused_geometry.width) {
                let first = row.iter().position(|value| *value == 0).unwrap_or(0);
                let behind = row.iter().rposition(|value| *value == 0).map_or(0, |last| last + 1);
                prop_assert!(row.get(first..behind).unwrap_or_default().iter().all(|value| *value == 0));
            }
            let known = fused.iter().filter(|value| **value == 0).count();
            prop_assert!((385..=415).contains(&known), "the area stays: {known} cells");
        }
    }
}
