//! Parameters of the stage.

use crate::mapping::slam::MAX_CONTRADICTING;
use crate::shared::log_odds::log_odds;
use crate::shared::scan_grid::BeamEvidence;
use gridweave_runtime::stage::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// When the results of robots with odometry only are sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MappingMode {
    /// As the robot drives: each pose as it is known then, and the map at every interval. Loop closures move later
    /// maps, and not the poses that were sent.
    #[default]
    Online,
    /// At the end: all poses and the map, with all loop closures.
    Offline,
}

/// Parameters of the scan mapper.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ScanMapperParameters {
    /// Resolution of the map, metres per cell.
    #[schemars(range(min = 0.005, max = 1.0))]
    pub resolution: f64,
    /// Probability that a cell is occupied at the end of a beam.
    #[schemars(extend("exclusiveMinimum" = 0.5, "exclusiveMaximum" = 1))]
    pub hit_probability: f64,
    /// Probability that a cell is occupied that a beam has passed.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 0.5))]
    pub miss_probability: f64,
    /// Upper bound of the probability that a cell is occupied.
    #[schemars(extend("exclusiveMinimum" = 0.5, "exclusiveMaximum" = 1))]
    pub max_probability: f64,
    /// Lower bound of the probability that a cell is occupied.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 0.5))]
    pub min_probability: f64,
    /// Hits farther away than this are not added, metres; the beam is free up to there. The lidar's own limit applies
    /// as well.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1000))]
    pub max_range: f64,
    /// Length of free space of a beam without a hit within the lidar's limit, metres. 0 ignores such beams: many
    /// lidars report the same for glass and for black paint.
    #[schemars(range(min = 0.0), extend("exclusiveMaximum" = 1000))]
    pub free_without_echo: f64,
    /// When poses and maps along odometry are sent: `online` as the robot drives, `offline` at the end of a log, with
    /// all loop closures. Maps at the poses of a localizer are always sent as the robot drives.
    pub mode: MappingMode,
    /// Time between maps, seconds, if anything was added; one is sent at the end, too.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub interval: f64,
    /// Largest age of the pose before a beam, seconds, if there is one after it.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_pose_age: f64,
    /// Time without a pose after the first scan, seconds, after which scans are registered along odometry.
    #[schemars(range(min = 0.0, max = 8.0))]
    pub wait_for_poses: f64,
    /// Along odometry a scan is registered and added whenever the robot has moved by this distance, metres.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 10))]
    pub step: f64,
    /// Or has turned by this angle, radians.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 3.2))]
    pub step_yaw: f64,
    /// Standard deviation of odometry that is assumed before the first scans, as a share of the distance and of the
    /// turn; after these it is estimated from the scans.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub odometry_deviation: f64,
    /// Along odometry, or by scans alone, no map is sent where more than this share of the scans that see walls of other
    /// times look through them, as where a map is bent or doubled.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub max_contradicting: f64,
    /// Standard deviation of the position at which a tag is seen, where its message has no covariance, metres at a distance
    /// of up to one metre, and proportionally more at a greater distance.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 10))]
    pub sighting_stddev: f64,
    /// Whether, at the end, the scans of robots whose maps are merged without doubt are refined together in one pose
    /// graph: what one robot saw, or a map that it has sent, then straightens the map of another.
    pub joint_refinement: bool,
}

impl Default for ScanMapperParameters {
    fn default() -> Self {
        Self {
            resolution: 0.05,
            hit_probability: 0.7,
            miss_probability: 0.4,
            max_probability: 0.98,
            min_probability: 0.02,
            max_range: 30.0,
            free_without_echo: 0.0,
            mode: MappingMode::Online,
            interval: 10.0,
            max_pose_age: 0.5,
            wait_for_poses: 5.0,
            step: 0.2,
            step_yaw: 0.2,
            odometry_deviation: 0.1,
            max_contradicting: MAX_CONTRADICTING,
            sighting_stddev: 0.05,
            joint_refinement: true,
        }
    }
}

impl ScanMapperParameters {
    /// Log-odds that beams add to cells.
    pub fn evidence(&self) -> BeamEvidence {
        let of = |probability: f64| log_odds(probability) as f32;
        BeamEvidence {
            hit: of(self.hit_probability),
            miss: of(self.miss_probability),
            least: of(self.min_probability),
            most: of(self.max_probability),
        }
    }
}

impl Parameters for ScanMapperParameters {}
