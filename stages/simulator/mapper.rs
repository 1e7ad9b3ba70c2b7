//! A robot's own map: an occupancy grid in log-odds, from scans laid at the poses that the robot believes in.

use super::lidar::Beam;
use super::shape::Rectangle;
use crate::geometry::{Cell, GridGeometry, Point2, Pose2, UNKNOWN, pose};
use nalgebra::Vector2;

/// What a beam's end adds to its cell: the log-odds of 70 %.
const HIT: f32 = 0.85;
/// What a beam adds to a cell that it has passed: the log-odds of 40 %.
const MISS: f32 = -0.4;
/// Log-odds are held within this on both sides, 1.8 % to 98.2 %, so that a cell can change its mind.
const LIMIT: f32 = 4.0;

/// An occupancy grid that grows with scans.
#[derive(Clone, Debug)]
pub(super) struct Mapper {
    geometry: GridGeometry,
    log_odds: Vec<f32>,
    /// The beams of the last scan, in cells from the robot, and the cells they end in: kept to spare the allocations.
    ways: Vec<Vector2<f64>>,
    ends: Vec<usize>,
}

/// What a robot has mapped so far, cut to what it has seen.
#[derive(Clone, Debug, PartialEq)]
pub struct SnapshotMap {
    /// Where the cells lie in the robot's map frame.
    pub geometry: GridGeometry,
    /// Row by row: -1 unknown, 0 free to 100 occupied.
    pub cells: Vec<i8>,
}

impl Mapper {
    /// An empty grid over `area` of the map frame. Cell borders are multiples of the resolution.
    pub(super) fn new(area: &Rectangle, resolution: f64) -> Self {
        let low = (area.min / resolution).map(f64::floor);
        let high = (area.max / resolution).map(f64::ceil);
        let geometry = GridGeometry {
            width: (high.x - low.x).max(1.0) as usize,
            height: (high.y - low.y).max(1.0) as usize,
            resolution,
            origin: pose(low.x * resolution, low.y * resolution, 0.0),
        };
        Self::over(geometry)
    }

    /// An empty grid of the given cells.
    pub(super) fn over(geometry: GridGeometry) -> Self {
        Self { geometry, log_odds: vec![0.0; geometry.cell_count()], ways: Vec::new(), ends: Vec::new() }
    }

    /// Adds a scan taken at `robot_pose` of the map frame. What lies outside of the grid is left out.
    ///
    /// Beams pass free cells; a cell in which a beam of this scan ends is a hit, whatever else passes it in the same
    /// scan.
    pub(super) fn add_scan(&mut self, robot_pose: &Pose2, beams: &[Beam]) {
        let origin = self.to_cells(&Point2::from(robot_pose.translation.vector));
        let heading = robot_pose.rotation.angle();
        let scale = 1.0 / self.geometry.resolution;
        let (mut ways, mut ends) = (std::mem::take(&mut self.ways), std::mem::take(&mut self.ends));
        ways.clear();
        ways.extend(beams.iter().map(|beam| {
            let (sine, cosine) = (heading + beam.angle).sin_cos();
            Vector2::new(cosine, sine) * beam.range * scale
        }));
        ends.clear();
        ends.extend(ways.iter().filter_map(|way| self.index(&(origin + way))));
        ends.sort_unstable();
        ends.dedup();
        // To give hit cells back what they had before this scan's misses is cheaper than to ask at every passed cell.
        let before: Vec<f32> = ends.iter().map(|&index| self.log_odds[index]).collect();
        for way in &ways {
            self.pass(&origin, way);
        }
        for (&index, before) in ends.iter().zip(before) {
            self.log_odds[index] = (before + HIT).min(LIMIT);
        }
        (self.ways, self.ends) = (ways, ends);
    }

    /// Marks the cells from `origin` along `way` (in cells) as passed, but the last (Amanatides and Woo, "A fast voxel
    /// traversal algorithm").
    fn pass(&mut self, origin: &Point2, way: &Vector2<f64>) {
        let (width, height) = (self.geometry.width as i64, self.geometry.height as i64);
        let mut column = origin.x.floor() as i64;
        let mut row = origin.y.floor() as i64;
        let step = way.map(|w| if w < 0.0 { -1 } else { 1 });
        let per_cell = way.map(|w| if w == 0.0 { f64::INFINITY } else { 1.0 / w.abs() });
        let share = |start: f64, w: f64| if w < 0.0 { start - start.floor() } else { 1.0 - (start - start.floor()) };
        let mut next = Vector2::new(share(origin.x, way.x) * per_cell.x, share(origin.y, way.y) * per_cell.y);
        // `next` runs from 0 to 1 over the way; a border beyond 1 means that the way ends in this cell.
        while next.x < 1.0 || next.y < 1.0 {
            if !(0..width).contains(&column) || !(0..height).contains(&row) {
                return;
            }
            let value = &mut self.log_odds[(row * width + column) as usize];
            *value = (*value + MISS).max(-LIMIT);
            if next.x < next.y {
                next.x += per_cell.x;
                column += step.x;
            } else {
                next.y += per_cell.y;
                row += step.y;
            }
        }
    }

    /// The map so far, cut to the cells that are known; `None` if there are none.
    pub(super) fn snapshot(&self) -> Option<SnapshotMap> {
        let GridGeometry { width, resolution, origin, .. } = self.geometry;
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
        let corner = origin * Point2::new(first as f64 * resolution, first_row as f64 * resolution);
        let geometry = GridGeometry {
            width: last - first + 1,
            height: last_row - first_row + 1,
            resolution,
            origin: pose(corner.x, corner.y, 0.0),
        };
        let rows = self.log_odds.chunks(width).skip(first_row).take(geometry.height);
        let cells = rows.flat_map(|row| row[first..=last].iter().map(|&value| percent(value))).collect();
        Some(SnapshotMap { geometry, cells })
    }

    /// The map so far, with the cells that are not known.
    pub(super) fn whole(&self) -> SnapshotMap {
        SnapshotMap { geometry: self.geometry, cells: self.log_odds.iter().map(|&value| percent(value)).collect() }
    }

    fn to_cells(&self, point: &Point2) -> Point2 {
        self.geometry.origin.inverse_transform_point(point) / self.geometry.resolution
    }

    fn index(&self, cells: &Point2) -> Option<usize> {
        let inside = cells.x >= 0.0
            && cells.y >= 0.0
            && cells.x < self.geometry.width as f64
            && cells.y < self.geometry.height as f64;
        inside.then(|| self.geometry.index(Cell { column: cells.x as usize, row: cells.y as usize }))
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
    use crate::geometry::{is_free, is_occupied};

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
