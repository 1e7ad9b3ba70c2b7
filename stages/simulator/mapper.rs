//! A robot's own map: an occupancy grid from scans at the poses that it estimates.

use super::lidar::Beam;
use super::shape::Rectangle;
use crate::shared::geometry::{GridGeometry, Point2, Pose2};
use crate::shared::scan_grid::{BeamEvidence, CellBeam, ScanGrid, SnapshotMap};
use nalgebra::Vector2;

/// A beam's end has the log-odds of 70 %, and a cell that it has passed those of 40 %. Log-odds are clamped to 1.8 %
/// and 98.2 %.
const EVIDENCE: BeamEvidence = BeamEvidence { hit: 0.85, miss: -0.4, least: -4.0, most: 4.0 };

/// An occupancy grid that grows with scans.
#[derive(Clone, Debug)]
pub(super) struct Mapper {
    grid: ScanGrid,
    /// The beams of the last scan: kept to spare the allocations.
    beams: Vec<CellBeam>,
}

impl Mapper {
    /// An empty grid over `area` of the map frame. Cell borders are multiples of the resolution.
    pub(super) fn new(area: &Rectangle, resolution: f64) -> Self {
        Self { grid: ScanGrid::between(area.min, area.max, resolution, EVIDENCE), beams: Vec::new() }
    }

    /// An empty grid of the given cells.
    pub(super) fn over(geometry: GridGeometry) -> Self {
        Self { grid: ScanGrid::over(geometry, EVIDENCE), beams: Vec::new() }
    }

    /// Adds a scan taken at `robot_pose` of the map frame. What is outside of the grid is ignored.
    pub(super) fn add_scan(&mut self, robot_pose: &Pose2, beams: &[Beam]) {
        let origin = self.grid.to_cells(&Point2::from(robot_pose.translation.vector));
        let heading = robot_pose.rotation.angle();
        let scale = 1.0 / self.grid.geometry().resolution;
        self.beams.clear();
        self.beams.extend(beams.iter().map(|beam| {
            let (sine, cosine) = (heading + beam.angle).sin_cos();
            CellBeam { origin, way: Vector2::new(cosine, sine) * beam.range * scale, is_hit: true }
        }));
        self.grid.add_scan(&self.beams);
    }

    /// The map so far, cropped to its known cells; `None` if there are none.
    pub(super) fn snapshot(&self) -> Option<SnapshotMap> {
        self.grid.snapshot()
    }

    /// The map so far, including unknown margins.
    pub(super) fn whole(&self) -> SnapshotMap {
        self.grid.whole()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::{is_free, is_occupied, pose};

    fn mapper() -> Mapper {
        Mapper::new(&Rectangle::new(-2.0, -2.0, 6.0, 2.0), 0.05)
    }

    fn beam(angle: f64, range: f64) -> Beam {
        Beam { angle, range }
    }

    #[test]
    fn the_end_of_a_beam_is_occupied_and_what_it_has_passed_is_free() {
        let mut mapper = mapper();
        for _ in 0..5 {
            mapper.add_scan(&pose(0.01, 0.01, 0.3), &[beam(-0.3, 3.0)]);
        }
        let map = mapper.snapshot().unwrap();
        let at = |x: f64| map.geometry.cell(&Point2::new(x, 0.01)).map(|cell| map.cells[map.geometry.index(cell)]);
        assert!(is_occupied(at(3.01).unwrap()));
        assert!((0..60).all(|i| is_free(at(0.01 + 0.05 * f64::from(i)).unwrap())));
        assert_eq!((map.geometry.width, map.geometry.height), (61, 1), "it is cut to what was seen");
    }

    #[test]
    fn a_hit_outweighs_the_beams_of_its_own_scan_that_graze_the_cell() {
        let mut mapper = mapper();
        let fan: Vec<Beam> = (0..9).map(|i| beam(0.001 * f64::from(i), if i == 4 { 3.0 } else { 3.5 })).collect();
        mapper.add_scan(&pose(0.01, 0.01, 0.0), &fan);
        let map = mapper.snapshot().unwrap();
        let cell = map.geometry.cell(&Point2::new(3.01, 0.02)).unwrap();
        assert!(is_occupied(map.cells[map.geometry.index(cell)]));
    }

    #[test]
    fn an_empty_map_has_no_snapshot_and_beams_off_the_grid_are_left_out() {
        let mut mapper = mapper();
        assert_eq!(mapper.snapshot(), None);
        mapper.add_scan(&pose(100.0, 100.0, 0.0), &[beam(0.0, 1.0)]);
        mapper.add_scan(&pose(f64::NAN, 0.0, 0.0), &[beam(0.0, 1.0)]);
        assert_eq!(mapper.snapshot(), None);
        mapper.add_scan(&pose(0.0, 0.0, 0.0), &[beam(0.0, 50.0), beam(1.0, 0.0)]);
        assert!(mapper.snapshot().is_some());
    }
}
