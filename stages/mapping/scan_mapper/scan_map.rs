//! A map that is built from scans, and grows with them.

use super::{ScanBeams, ScanMapperParameters};
use crate::shared::geometry::{Point2, Pose2};
use crate::shared::scan_grid::{BeamEvidence, CellBeam, ScanGrid, SnapshotMap};
use nalgebra::Vector2;

/// Largest number of cells of a map.
const MOST_CELLS: f64 = 1e8;
/// Margin by which a map grows beyond what it must, metres: most scans then fit.
const SPARE: f64 = 5.0;

/// The map of a robot so far.
#[derive(Clone, Debug)]
pub struct ScanMap {
    resolution: f64,
    evidence: BeamEvidence,
    /// `None` before the first scan.
    grid: Option<ScanGrid>,
}

/// A scan is so far away that the map would get too many cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooLarge;

impl ScanMap {
    /// An empty map.
    pub fn new(parameters: &ScanMapperParameters) -> Self {
        Self { resolution: parameters.resolution, evidence: parameters.evidence(), grid: None }
    }

    /// Makes it empty.
    pub fn clear(&mut self) {
        self.grid = None;
    }

    /// Adds a scan of a robot whose base was at `transform_map_base(delay)` at that many seconds after the first
    /// beam. Beams at times without a pose are left out.
    ///
    /// # Errors
    /// The map would get too large; it stays as it was.
    pub fn draw(
        &mut self,
        scan: &ScanBeams,
        mut transform_map_base: impl FnMut(f64) -> Option<Pose2>,
    ) -> Result<(), TooLarge> {
        let mut lines: Vec<(Point2, Vector2<f64>, bool)> = Vec::with_capacity(scan.beams.len());
        let (mut low, mut high) = (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY));
        let mut last: Option<(f64, Option<Pose2>)> = None;
        for beam in &scan.beams {
            let base = match last {
                Some((delay, base)) if delay == beam.delay => base,
                _ => transform_map_base(beam.delay),
            };
            last = Some((beam.delay, base));
            let Some(lidar) = base.map(|base| base * scan.transform_base_lidar) else { continue };
            let (sine, cosine) = (lidar.rotation.angle() + beam.angle).sin_cos();
            let (start, way) = (Point2::from(lidar.translation.vector), Vector2::new(cosine, sine) * beam.range);
            for end in [start.coords, start.coords + way] {
                (low, high) = (low.inf(&end), high.sup(&end));
            }
            lines.push((start, way, beam.is_hit));
        }
        if lines.is_empty() {
            return Ok(());
        }
        let grid = self.grid_over(low.into(), high.into())?;
        let scale = 1.0 / grid.geometry().resolution;
        let in_cells = |(start, way, is_hit): &(Point2, Vector2<f64>, bool)| CellBeam {
            origin: grid.to_cells(start),
            way: way * scale,
            is_hit: *is_hit,
        };
        let beams: Vec<CellBeam> = lines.iter().map(in_cells).collect();
        grid.add_scan(&beams);
        Ok(())
    }

    /// The grid, made large enough for a rectangle.
    fn grid_over(&mut self, low: Point2, high: Point2) -> Result<&mut ScanGrid, TooLarge> {
        let spare = Vector2::repeat(SPARE);
        let (wide_low, wide_high) = (low - spare, high + spare);
        let grid = match self.grid.take() {
            None => {
                check_size(wide_low, wide_high, self.resolution)?;
                ScanGrid::between(wide_low, wide_high, self.resolution, self.evidence)
            }
            Some(grid) => {
                let (own_low, own_high) = corners(&grid);
                let holds = own_low.x < low.x && own_low.y < low.y && own_high.x > high.x && own_high.y > high.y;
                if holds {
                    grid
                } else {
                    let all = (own_low.coords.inf(&wide_low.coords), own_high.coords.sup(&wide_high.coords));
                    if check_size(all.0.into(), all.1.into(), self.resolution).is_err() {
                        self.grid = Some(grid);
                        return Err(TooLarge);
                    }
                    grid.grown(wide_low, wide_high)
                }
            }
        };
        Ok(self.grid.insert(grid))
    }

    /// The map so far, cropped to its known part; `None` if nothing is known.
    pub fn snapshot(&self) -> Option<SnapshotMap> {
        self.grid.as_ref()?.snapshot()
    }
}

fn check_size(low: Point2, high: Point2, resolution: f64) -> Result<(), TooLarge> {
    let sides = (high - low) / resolution;
    if sides.x * sides.y <= MOST_CELLS { Ok(()) } else { Err(TooLarge) }
}

fn corners(grid: &ScanGrid) -> (Point2, Point2) {
    let geometry = grid.geometry();
    let low = Point2::from(geometry.origin.translation.vector);
    (low, low + Vector2::new(geometry.width as f64, geometry.height as f64) * geometry.resolution)
}
