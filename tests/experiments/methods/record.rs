//! What one method has made of one robot.

use super::one_alignment::{AlignmentTime, OneAlignment, PairMaps};
use super::wall_distance::wall_distance;
use crate::trial::Merge;
use gridweave::evaluate::{RobotOutcome, RobotResult};
use gridweave::table::Table;
use gridweave_stages::shared::geometry::{Grid, Pose2, pose};

/// One robot, placed or not placed by one method.
#[derive(Clone, Debug)]
pub(super) struct Record {
    /// The world.
    world: String,
    /// The robot.
    robot: String,
    /// The paper's number of the method, 1 to 3.
    pub(super) method: usize,
    /// What became of it.
    pub(super) outcome: RobotOutcome,
    /// Why it is not merged.
    reason: String,
    /// Its errors; none if it is not merged, or not in the truth.
    pub(super) error: Option<PlaceError>,
    /// The time of one alignment with the reference robot; none if the tags give none.
    pub(super) alignment: Option<AlignmentTime>,
    /// How far that alignment places the map from where the whole run does, metres.
    pub(super) apart: Option<f64>,
}

/// Errors of the pose of a robot's map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PlaceError {
    /// Mean square error over the occupied cells, square metres.
    pub(super) square_metres: f64,
    /// The same in squared widths of a cell.
    pub(super) square_cells: f64,
    /// Distance at the middle of the map, metres.
    pub(super) metres: f64,
    /// Degrees.
    pub(super) degrees: f64,
    /// Distance of its walls from those of the reference robot, metres.
    pub(super) walls: f64,
    /// Their distance at the true pose, metres.
    pub(super) true_walls: f64,
}

impl Record {
    /// What a method has made of a robot, the second of `maps`; the first is the reference.
    pub(super) fn new(
        world: &str,
        method: usize,
        robot: &RobotResult,
        maps: Option<&PairMaps<'_>>,
        alignment: Option<OneAlignment>,
        merge: &Merge,
    ) -> Self {
        let found = merge.summary.frames.get(&robot.robot).map(|frame| pose(frame.x, frame.y, frame.yaw));
        let error = match (robot.error_m, robot.error_deg, robot.transform_true_found, found, maps) {
            (Some(metres), Some(degrees), Some(transform_true_found), Some(found), Some(maps)) => {
                let square_metres = mean_square_distance(&maps.b, &Pose2::identity(), &transform_true_found);
                Some(PlaceError {
                    square_metres,
                    square_cells: square_metres / maps.b.geometry.resolution.powi(2),
                    metres,
                    degrees,
                    walls: wall_distance(maps, &found),
                    true_walls: wall_distance(maps, &(found * transform_true_found.inverse())),
                })
            }
            _ => None,
        };
        let apart = match (&alignment, found, maps) {
            (Some(one), Some(found), Some(maps)) => {
                Some(mean_square_distance(&maps.b, &found, &one.transform_a_b).sqrt())
            }
            _ => None,
        };
        Self {
            world: world.to_owned(),
            robot: robot.robot.clone(),
            method,
            outcome: robot.outcome,
            reason: robot.reason.clone().unwrap_or_default(),
            error,
            alignment: alignment.map(|alignment| alignment.time),
            apart,
        }
    }

    /// The heads of [`row`](Self::row).
    pub(super) fn heads() -> Table {
        Table::new([
            "set",
            "world",
            "robot",
            "method",
            "outcome",
            "mse px2",
            "mse m2",
            "error m",
            "error deg",
            "walls apart m",
            "walls apart at truth m",
            "alignment lines ms",
            "alignment classifier ms",
            "alignment icp ms",
            "alignment ms",
            "alignment apart m",
            "reason",
        ])
    }

    /// All of it, as a line of a table.
    pub(super) fn row(&self, set: &str) -> [String; 17] {
        let number = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
        let error = |part: fn(&PlaceError) -> f64| number(self.error.as_ref().map(part));
        let time = |part: fn(&AlignmentTime) -> f64| number(self.alignment.as_ref().map(part));
        [
            set.to_owned(),
            self.world.clone(),
            self.robot.clone(),
            self.method.to_string(),
            self.outcome.words().to_owned(),
            error(|error| error.square_cells),
            error(|error| error.square_metres),
            error(|error| error.metres),
            error(|error| error.degrees),
            error(|error| error.walls),
            error(|error| error.true_walls),
            time(|time| time.lines),
            time(|time| time.classifier),
            time(|time| time.icp),
            time(|time| time.total),
            number(self.apart),
            self.reason.clone(),
        ]
    }
}

/// The mean of the squared distances between where two transforms place the occupied cells of a map, square metres; 0
/// if there are none.
fn mean_square_distance(map: &Grid<'_>, one: &Pose2, other: &Pose2) -> f64 {
    let (mut sum, mut count) = (0.0, 0usize);
    for cell in map.occupied() {
        let point = map.geometry.centre(cell);
        sum += (one * point - other * point).norm_squared();
        count += 1;
    }
    sum / count.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_stages::shared::geometry::GridGeometry;

    #[test]
    fn the_mean_square_distance_is_taken_over_the_occupied_cells() {
        let geometry = GridGeometry { width: 3, height: 1, resolution: 2.0, origin: pose(-1.0, -1.0, 0.0) };
        // The occupied cells' centres are (0, 0) and (4, 0).
        let cells = [100, 0, 100];
        let map = Grid::new(geometry, &cells).unwrap();
        let turned = pose(0.0, 0.0, std::f64::consts::FRAC_PI_2);
        assert_eq!(mean_square_distance(&map, &Pose2::identity(), &pose(3.0, 4.0, 0.0)), 25.0);
        let by_turn = mean_square_distance(&map, &Pose2::identity(), &turned);
        assert!((by_turn - (0.0 + 32.0) / 2.0).abs() < 1e-12, "{by_turn}");
        let empty = Grid::new(geometry, &[0, -1, 0]).unwrap();
        assert_eq!(mean_square_distance(&empty, &Pose2::identity(), &turned), 0.0);
    }
}
