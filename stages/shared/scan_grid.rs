//! An occupancy grid in log-odds, built from scans: cells that a beam passes are free, and the cell at its end is
//! occupied.

use crate::shared::geometry::{Cell, GridGeometry, Point2, UNKNOWN, pose};
use nalgebra::Vector2;

/// Log-odds that beams add to cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BeamEvidence {
    /// Added to the cell at the end of a beam.
    pub hit: f32,
    /// Added to a cell that a beam has passed; below 0.
    pub miss: f32,
    /// Lower bound of a cell, so that it can still change.
    pub least: f32,
    /// Upper bound of a cell.
    pub most: f32,
}

/// A beam over a grid, in cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellBeam {
    /// Origin of the beam, from the outer corner of cell (0, 0).
    pub origin: Point2,
    /// Vector from there to its end.
    pub way: Vector2<f64>,
    /// Whether it has hit something at its end.
    pub is_hit: bool,
}

/// An occupancy grid that is built from scans.
#[derive(Clone, Debug)]
pub struct ScanGrid {
    geometry: GridGeometry,
    evidence: BeamEvidence,
    log_odds: Vec<f32>,
    /// Cells in which the beams of the last scan end: kept to spare the allocations.
    ends: Vec<usize>,
}

/// A map built so far.
#[derive(Clone, Debug, PartialEq)]
pub struct SnapshotMap {
    /// Geometry of the cells in the robot's map frame.
    pub geometry: GridGeometry,
    /// Row by row: -1 unknown, 0 free to 100 occupied.
    pub cells: Vec<i8>,
}

impl ScanGrid {
    /// An empty grid of the given cells.
    pub fn over(geometry: GridGeometry, evidence: BeamEvidence) -> Self {
        Self { geometry, evidence, log_odds: vec![0.0; geometry.cell_count()], ends: Vec::new() }
    }

    /// An empty grid over the rectangle between two corners, lower left and upper right. Cell borders are multiples
    /// of the resolution.
    pub fn between(low: Point2, high: Point2, resolution: f64, evidence: BeamEvidence) -> Self {
        Self::over(lattice(low, high, resolution), evidence)
    }

    /// Geometry of its cells.
    pub fn geometry(&self) -> &GridGeometry {
        &self.geometry
    }

    /// Adds the beams of a scan. What is outside of the grid is ignored.
    ///
    /// Beams pass free cells; a cell in which a beam of this scan has hit something is a hit, even if other beams of
    /// the scan pass it.
    pub fn add_scan(&mut self, beams: &[CellBeam]) {
        let mut ends = std::mem::take(&mut self.ends);
        ends.clear();
        let hits = beams.iter().filter(|beam| beam.is_hit);
        ends.extend(hits.filter_map(|beam| self.index(&(beam.origin + beam.way))));
        ends.sort_unstable();
        ends.dedup();
        // Restoring hit cells to their value before this scan's misses is cheaper than a test at every passed cell.
        let before: Vec<f32> = ends.iter().map(|&index| self.log_odds[index]).collect();
        for beam in beams {
            self.pass(beam);
        }
        let BeamEvidence { hit, most, .. } = self.evidence;
        for (&index, before) in ends.iter().zip(before) {
            self.log_odds[index] = (before + hit).min(most);
        }
        self.ends = ends;
    }

    /// Marks the cells that a beam passes, except the last (Amanatides and Woo, "A fast voxel traversal algorithm").
    fn pass(&mut self, beam: &CellBeam) {
        let CellBeam { origin, way, .. } = beam;
        let BeamEvidence { miss, least, .. } = self.evidence;
        let (width, height) = (self.geometry.width as i64, self.geometry.height as i64);
        let mut column = origin.x.floor() as i64;
        let mut row = origin.y.floor() as i64;
        let step = way.map(|w| if w < 0.0 { -1 } else { 1 });
        let per_cell = way.map(|w| if w == 0.0 { f64::INFINITY } else { 1.0 / w.abs() });
        let share = |start: f64, w: f64| if w < 0.0 { start - start.floor() } else { 1.0 - (start - start.floor()) };
        let mut next = Vector2::new(share(origin.x, way.x) * per_cell.x, share(origin.y, way.y) * per_cell.y);
        // `next` runs from 0 to 1 along the beam; a border beyond 1 means that the beam ends in this cell.
        while next.x < 1.0 || next.y < 1.0 {
            if !(0..width).contains(&column) || !(0..height).contains(&row) {
                return;
            }
            let value = &mut self.log_odds[(row * width + column) as usize];
            *value = (*value + miss).max(least);
            if next.x < next.y {
                next.x += per_cell.x;
                column += step.x;
            } else {
                next.y += per_cell.y;
                row += step.y;
            }
        }
    }

    /// The map so far, cropped to the known cells; `None` if there are none.
    pub fn snapshot(&self) -> Option<SnapshotMap> {
        let GridGeometry { width, .. } = self.geometry;
        let known_rows: Vec<(usize, usize, usize)> = self
            .log_odds
            .chunks(width)
            .enumerate()
            .filter_map(|(row, cells)| {
                let first = cells.iter().position(|&value| value != 0.0)?;
                let last = cells.iter().rposition(|&value| value != 0.0)?;
                Some((row, first, last))
            })
            .collect();
        let (first_row, last_row) = (known_rows.first()?.0, known_rows.last()?.0);
        let first = known_rows.iter().map(|row| row.1).min()?;
        let last = known_rows.iter().map(|row| row.2).max()?;
        Some(self.part(Cell { column: first, row: first_row }, Cell { column: last, row: last_row }))
    }

    /// The map so far between two cells, including both.
    fn part(&self, low: Cell, high: Cell) -> SnapshotMap {
        let GridGeometry { width, resolution, origin, .. } = self.geometry;
        let corner = origin * Point2::new(low.column as f64 * resolution, low.row as f64 * resolution);
        let geometry = GridGeometry {
            width: high.column - low.column + 1,
            height: high.row - low.row + 1,
            resolution,
            origin: pose(corner.x, corner.y, 0.0),
        };
        let rows = self.log_odds.chunks(width).skip(low.row).take(geometry.height);
        let cells = rows.flat_map(|row| row[low.column..=high.column].iter().map(|&value| percent(value))).collect();
        SnapshotMap { geometry, cells }
    }

    /// The map so far, including unknown margins.
    pub fn whole(&self) -> SnapshotMap {
        SnapshotMap { geometry: self.geometry, cells: self.log_odds.iter().map(|&value| percent(value)).collect() }
    }

    /// A point of the map frame in cells.
    pub fn to_cells(&self, point: &Point2) -> Point2 {
        self.geometry.origin.inverse_transform_point(point) / self.geometry.resolution
    }

    /// The same map on a grid that holds the rectangle between two corners as well. The grid must not be turned.
    #[must_use]
    pub fn grown(&self, low: Point2, high: Point2) -> Self {
        let GridGeometry { width, height, resolution, origin } = self.geometry;
        let own_low = Point2::from(origin.translation.vector);
        let own_high = own_low + Vector2::new(width as f64, height as f64) * resolution;
        let half = Vector2::repeat(0.5 * resolution);
        // Half a cell inwards: the own corners must not be rounded outwards.
        let geometry = lattice(
            low.coords.inf(&(own_low + half).coords).into(),
            high.coords.sup(&(own_high - half).coords).into(),
            resolution,
        );
        let mut grown = Self::over(geometry, self.evidence);
        let offset = grown.to_cells(&(own_low + half));
        let (column, row) = (offset.x as usize, offset.y as usize);
        for (number, from) in self.log_odds.chunks_exact(width).enumerate() {
            let start = (row + number) * geometry.width + column;
            grown.log_odds[start..start + width].copy_from_slice(from);
        }
        grown
    }

    fn index(&self, cells: &Point2) -> Option<usize> {
        let inside = cells.x >= 0.0
            && cells.y >= 0.0
            && cells.x < self.geometry.width as f64
            && cells.y < self.geometry.height as f64;
        inside.then(|| self.geometry.index(Cell { column: cells.x as usize, row: cells.y as usize }))
    }
}

/// Cells over the rectangle between two corners, with borders at multiples of the resolution.
fn lattice(low: Point2, high: Point2, resolution: f64) -> GridGeometry {
    let low = (low / resolution).map(f64::floor);
    let high = (high / resolution).map(f64::ceil);
    GridGeometry {
        width: (high.x - low.x).max(1.0) as usize,
        height: (high.y - low.y).max(1.0) as usize,
        resolution,
        origin: pose(low.x * resolution, low.y * resolution, 0.0),
    }
}

fn percent(log_odds: f32) -> i8 {
    if log_odds == 0.0 {
        return UNKNOWN;
    }
    (100.0 / (1.0 + (-log_odds).exp())).round() as i8
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const EVIDENCE: BeamEvidence = BeamEvidence { hit: 0.85, miss: -0.4, least: -4.0, most: 4.0 };

    fn drawn(low: Point2, high: Point2) -> ScanGrid {
        let mut grid = ScanGrid::between(low, high, 0.05, EVIDENCE);
        let origin = grid.to_cells(&Point2::new(0.01, 0.02));
        for turn in 0..7 {
            let way = Vector2::new(f64::cos(0.9 * f64::from(turn)), f64::sin(0.9 * f64::from(turn))) * 25.3;
            grid.add_scan(&[CellBeam { origin, way, is_hit: turn % 2 == 0 }]);
        }
        grid
    }

    /// Whether two maps have the same cells at the same pose, but for rounding.
    fn is_same(one: &SnapshotMap, other: &SnapshotMap) -> bool {
        let apart = one.geometry.origin.translation.vector - other.geometry.origin.translation.vector;
        one.cells == other.cells && one.geometry.width == other.geometry.width && apart.norm() < 1e-9
    }

    proptest! {
        #[test]
        fn a_grid_that_has_grown_equals_one_that_was_large_from_the_start(
            left in -9.0..-2.0f64, low in -9.0..-2.0f64, right in 2.0..9.0f64, high in 2.0..9.0f64,
        ) {
            let small = drawn(Point2::new(-1.5, -1.6), Point2::new(1.4, 1.7));
            let grown = small.grown(Point2::new(left, low), Point2::new(right, high));
            prop_assert!(is_same(&grown.snapshot().unwrap(), &small.snapshot().unwrap()));
            let large = drawn(Point2::new(left, low), Point2::new(right, high));
            prop_assert!(is_same(&grown.whole(), &large.whole()));
            let again = grown.grown(Point2::origin(), Point2::origin());
            prop_assert!(is_same(&again.whole(), &grown.whole()), "it never shrinks");
        }
    }

    #[test]
    fn a_beam_without_a_hit_leaves_no_wall() {
        let mut grid = ScanGrid::between(Point2::new(-1.0, -1.0), Point2::new(3.0, 1.0), 0.05, EVIDENCE);
        let origin = grid.to_cells(&Point2::new(0.01, 0.01));
        grid.add_scan(&[CellBeam { origin, way: Vector2::new(40.0, 0.0), is_hit: false }]);
        let map = grid.snapshot().unwrap();
        assert_eq!(map.cells.len(), 40);
        assert!(map.cells.iter().all(|value| (0..50).contains(value)));
    }
}
