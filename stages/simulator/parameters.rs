//! Parameters of a simulation.

use super::floor_plan::{BuildingSize, Layout};
use super::lidar::Lidar;
use super::tags::ReaderModel;
use super::wheel_odometry::OdometryErrors;
use gridweave_runtime::stage::{ParameterError, Parameters};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// Largest number of cells of a map under construction.
const MOST_CELLS: f64 = 6e7;

/// Parameters of a simulation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SimulatorParameters {
    /// Number of robots. They are named `robot1`, `robot2`, ...
    #[schemars(range(min = 1, max = 64))]
    pub robots: u32,
    /// Size of the building along its corridors, metres. In a building of the default size three robots
    /// drive for about two minutes; it grows with the floor area that each of them covers.
    #[schemars(range(min = 10.0, max = 300.0))]
    pub width: f64,
    /// Size of the building across its corridors, metres. There is one corridor for every two rows of rooms.
    #[schemars(range(min = 9.0, max = 300.0))]
    pub height: f64,
    /// Mean width of a room, metres.
    #[schemars(range(min = 2.5, max = 30.0))]
    pub room_width: f64,
    /// Mean depth of a room, from its corridor, metres.
    #[schemars(range(min = 4.0, max = 40.0))]
    pub room_depth: f64,
    /// Width of the corridors, metres.
    #[schemars(range(min = 1.4, max = 3.0))]
    pub corridor_width: f64,
    /// Pieces of furniture a square metre of a room. Where pieces would block a way there are fewer.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub clutter: f64,
    /// Layout of the rooms: `random`, `symmetric` (a corridor and its rooms look the same after half a turn),
    /// `repeated` (all rooms are alike), `equipped` (the same, with the same equipment in each room), or `shelves` (as
    /// `random`, with rows of shelves). Furniture is placed at random in all but the last.
    pub layout: Layout,
    /// Share of the rooms whose furniture stands elsewhere for each robot.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub moved: f64,
    /// Share of its rooms that a robot has in common with the next one.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub overlap: f64,
    /// Top speed of the robots, metres a second.
    #[schemars(range(min = 0.05, max = 5.0))]
    pub speed: f64,
    /// A drive that takes longer is cut off, seconds, up to 7200.
    #[schemars(range(min = 1.0, max = 7200.0))]
    pub duration: f64,
    /// Beams of one lidar scan.
    #[schemars(range(min = 1, max = 10000))]
    pub beams: u32,
    /// The angle about straight ahead over which they are spread, radians, 0.1 to 2 pi: a lidar's full circle, or what
    /// a depth camera sees.
    #[schemars(range(min = 0.1, max = TAU))]
    pub field_of_view: f64,
    /// The longest range of the lidar, metres. A beam that meets nothing within it returns nothing.
    #[schemars(range(min = 0.5, max = 300.0))]
    pub lidar_range: f64,
    /// Standard deviation of a lidar range, metres.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub lidar_noise: f64,
    /// Share of the lidar's beams that return nothing although they meet something.
    #[schemars(range(min = 0.0, max = 0.99))]
    pub dropped_beams: f64,
    /// Drift of the poses that a robot estimates: standard deviation after one metre of driving, of the heading in
    /// radians and of the distance in metres; it grows with the square root of the distance. 0 makes poses exact.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub drift: f64,
    /// Driven distance over which loop closures reduce an error to 37 %, metres. 0 lets drift grow without bound, so
    /// the true relative pose depends on the part of the map.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub correction_length: f64,
    /// Resolution of the maps, metres per cell. Several values are given to the robots in turn.
    #[schemars(inner(range(min = 0.005, max = 1.0)))]
    pub resolution: Vec<f64>,
    /// Whether the scans of the lidars are logged as well.
    pub scans: bool,
    /// Whether raw odometry of the wheels is logged as well. The errors that follow are as large as in the public logs
    /// Intel and CSAIL; the systematic ones differ from robot to robot.
    pub odometry: bool,
    /// Standard deviation over robots of the scale of the distance by odometry, as a share.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub odometry_scale: f64,
    /// Standard deviation over robots of the scale of the turn by odometry, as a share.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub odometry_turn_scale: f64,
    /// Standard deviation over robots of the turn that odometry adds on the way, radians a metre.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub odometry_yaw_drift: f64,
    /// Standard deviation of the random error of odometry after one metre, of the heading in radians and of the
    /// distance in metres; it grows with the square root of the distance.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub odometry_noise: f64,
    /// Mean number of times that the wheels slip on 100 metres, each by up to 0.3 m and 0.4 radians.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub odometry_slips: f64,
    /// Share of a map's free cells that are set to occupied, as by people's legs, dust and glass.
    #[schemars(range(min = 0.0, max = 0.1))]
    pub specks: f64,
    /// How many maps each robot sends, growing, at the ends of equal parts of its drive.
    #[schemars(range(min = 1, max = 1000))]
    pub snapshots: u32,
    /// Largest rotation of the robots' map frames against the walls, radians. 0 aligns all maps with the walls.
    #[schemars(range(min = 0.0, max = PI))]
    pub map_yaw: f64,
    /// Largest offset of the origins of the map frames from the starts of the robots, in x and in y, metres.
    #[schemars(range(min = 0.0, max = 1e5))]
    pub map_offset: f64,
    /// Number of radio tags on the walls. Robots share enough of them with about one in 8 square metres of floor.
    #[schemars(range(min = 0, max = 10000))]
    pub tags: u32,
    /// The longest distance at which a tag is read, metres. The paper's is 3 m.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub tag_reach: f64,
    /// Standard deviation of a tag's range, metres. The paper's is 0.05 m.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub tag_noise: f64,
    /// Share of the readings of tags that are lost.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub lost_readings: f64,
    /// Share of the readings of tags that come over a reflection and are 0.3 m to 2 m too long.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub reflections: f64,
}

impl Default for SimulatorParameters {
    fn default() -> Self {
        Self {
            robots: 3,
            width: 20.0,
            height: 15.0,
            room_width: 4.5,
            room_depth: 6.0,
            corridor_width: 2.0,
            clutter: 0.12,
            layout: Layout::Random,
            moved: 0.0,
            overlap: 0.65,
            speed: 0.7,
            duration: 600.0,
            beams: 360,
            field_of_view: TAU,
            lidar_range: 12.0,
            lidar_noise: 0.015,
            dropped_beams: 0.02,
            drift: 0.002,
            correction_length: 10.0,
            resolution: vec![0.05],
            scans: false,
            odometry: false,
            odometry_scale: 0.03,
            odometry_turn_scale: 0.06,
            odometry_yaw_drift: 0.04,
            odometry_noise: 0.07,
            odometry_slips: 0.0,
            specks: 0.0,
            snapshots: 3,
            map_yaw: PI,
            map_offset: 5.0,
            tags: 36,
            tag_reach: 3.0,
            tag_noise: 0.05,
            lost_readings: 0.1,
            reflections: 0.0,
        }
    }
}

impl SimulatorParameters {
    pub(super) fn building(&self) -> BuildingSize {
        let Self { width, height, room_width, room_depth, corridor_width, clutter, layout, .. } = *self;
        BuildingSize { width, height, room_width, room_depth, corridor_width, clutter, layout }
    }

    pub(super) fn lidar(&self) -> Lidar {
        Lidar {
            beams: self.beams as usize,
            field_of_view: self.field_of_view,
            reach: self.lidar_range,
            noise: self.lidar_noise,
            dropped: self.dropped_beams,
        }
    }

    pub(super) fn odometry_errors(&self) -> OdometryErrors {
        OdometryErrors {
            scale: [self.odometry_scale, self.odometry_turn_scale],
            yaw_drift: self.odometry_yaw_drift,
            noise: self.odometry_noise,
            slips: self.odometry_slips,
        }
    }

    pub(super) fn tag_reader(&self) -> ReaderModel {
        ReaderModel {
            reach: self.tag_reach,
            noise: self.tag_noise,
            lost: self.lost_readings,
            reflected: self.reflections,
        }
    }

    pub(super) fn resolution_of(&self, robot: usize) -> f64 {
        self.resolution.iter().cycle().nth(robot).copied().unwrap_or(0.05)
    }

    /// Cells along a side of the largest grid that a robot may need.
    fn most_cells_a_side(&self, resolution: f64) -> f64 {
        let diagonal = self.width.hypot(self.height);
        (diagonal + 2.0 * self.lidar_range.min(diagonal)) / resolution
    }
}

impl Parameters for SimulatorParameters {
    fn check_together(&self) -> Vec<ParameterError> {
        let mut errors = Vec::new();
        if self.resolution.is_empty() {
            errors.push(ParameterError::new("resolution", "must hold at least one value"));
        }
        if let Some(resolution) =
            self.resolution.iter().find(|resolution| self.most_cells_a_side(**resolution).powi(2) > MOST_CELLS)
        {
            let problem = format!(
                "must be coarser than {resolution} m a cell for a building of {} m x {} m and a lidar of {} m, or maps would \
                 have more than {MOST_CELLS:e} cells",
                self.width, self.height, self.lidar_range
            );
            errors.push(ParameterError::new("resolution", problem));
        }
        errors
    }
}
