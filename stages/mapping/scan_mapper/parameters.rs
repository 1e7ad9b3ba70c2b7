//! The parameters of the stage.

use crate::shared::log_odds::log_odds;
use crate::shared::scan_grid::BeamEvidence;
use gridweave_runtime::stage::Parameters;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How scans are drawn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ScanMapperParameters {
    /// Metres a cell.
    #[schemars(range(min = 0.005, max = 1.0))]
    pub resolution: f64,
    /// The probability that a cell is occupied in which a beam has ended.
    #[schemars(extend("exclusiveMinimum" = 0.5, "exclusiveMaximum" = 1))]
    pub hit_probability: f64,
    /// The probability that a cell is occupied that a beam has passed.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 0.5))]
    pub miss_probability: f64,
    /// No cell is held to be occupied with a greater probability than this.
    #[schemars(extend("exclusiveMinimum" = 0.5, "exclusiveMaximum" = 1))]
    pub max_probability: f64,
    /// No cell is held to be occupied with a smaller probability than this.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 0.5))]
    pub min_probability: f64,
    /// What a beam has met farther away is not drawn, metres; the beam shows free space so far. The lidar's own limit counts as
    /// well.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1000))]
    pub max_range: f64,
    /// A beam that has met nothing within the lidar's limit shows free space so far, metres. 0 leaves such beams out: many lidars
    /// give the same for glass and for black paint.
    #[schemars(range(min = 0.0), extend("exclusiveMaximum" = 1000))]
    pub free_without_echo: f64,
    /// A map is sent so often, seconds, if anything was drawn; and at the end.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub interval: f64,
    /// Where the robot was is known if there is a pose not longer before a beam than this, seconds, and one after it.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_pose_age: f64,
    /// Without a pose for so long after the first scan, seconds, scans are matched along odometry.
    #[schemars(range(min = 0.0, max = 8.0))]
    pub wait_for_poses: f64,
    /// Along odometry a scan is matched and drawn whenever the robot has driven so far, metres.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 10))]
    pub step: f64,
    /// Or has turned by so much, radians.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 3.2))]
    pub step_yaw: f64,
    /// Standard deviation of odometry, as a share of the way and of the turn since the last scan that was matched.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub odometry_deviation: f64,
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
            interval: 10.0,
            max_pose_age: 0.5,
            wait_for_poses: 5.0,
            step: 0.2,
            step_yaw: 0.2,
            odometry_deviation: 0.1,
        }
    }
}

impl ScanMapperParameters {
    /// What beams say of cells.
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
