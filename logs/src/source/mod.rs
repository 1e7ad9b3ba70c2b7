//! Sources of messages: `mcap_source` reads logs, each message on the port for its topic and type; [`map_file`] reads
//! map files, and [`topology_file`] topological maps in JSON.

mod channel;
mod channel_router;
mod derived;
mod latched;
mod live_frames;
mod live_router;
pub mod map_file;
mod preview;
mod router;
mod stage;
pub mod topology_file;

#[cfg(test)]
mod tests;

pub use crate::robots::{CellValues, LidarPoses, Resolutions};
pub use live_router::{LiveMessage, LiveRouter};
pub use stage::McapSource;

use crate::map_file::Thresholds;
use crate::names::{Input, NameRules, TopicNaming};
use crate::robots::problem_of_resolutions;
use gridweave_runtime::ros::{
    OccupancyGrid, PoseWithCovarianceStamped, RangeScan, TagBearing, TagPosition, TagRange, TopologicalMap,
    UnmergedRobot,
};
use gridweave_runtime::stage::{
    AnyMessage, InitialPose, Out, OutputPorts, Outputs, ParameterError, Parameters, StageKind,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The parameters of `mcap_source`.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SourceParameters {
    /// The logs to read: MCAP files, and folders of ROS 2 bags. Several logs are merged by log time. `ROBOT=LOG` puts
    /// the topics and frames of a log under the name of a robot. Set by `--input` on the command line.
    pub files: Vec<PathBuf>,
    /// How topics and frames are named: under their robots, or as they were logged.
    pub names: TopicNaming,
    /// Topics to rename, as `OLD=NEW`, with or without the name of their robot. `{robot}` matches one part of both.
    pub rename: Vec<String>,
    /// The robots to read; the topics of others are ignored. Empty for all.
    pub only_robots: Vec<String>,
    /// The topics to read, in which `{robot}` matches one part of the path: `["/{robot}/map", "/tf"]`. Empty for all.
    pub only_topics: Vec<String>,
    /// Whether all logs, with the stamps in their messages, are shifted in time so that they start when the first one
    /// does: for robots whose clocks are unrelated.
    pub align_start: bool,
    /// Whether the thresholds of map files among the logs are applied literally; see `map_file_source`.
    pub literal_thresholds: bool,
    /// How the values of maps' cells are read: by the distribution of the values in each map (`auto`), as map servers
    /// write them (`occupancy`), as costmaps with costs around obstacles (`costmap`), or as two classes whatever their
    /// values (`two_classes`). Maps of another convention are sent as map servers write them.
    pub map_values: CellValues,
    /// Side of a cell of a robot's maps, metres, instead of the resolution in the messages. The position of the origin
    /// stays, as do poses and tags in the map. Set by `--resolution` on the command line.
    pub resolutions: Resolutions,
    /// The poses of lidars on the bases of their robots, as `{ ROBOT = [X, Y, YAW] }`, metres and radians, in place of
    /// those in tf. A fourth number is the roll: pi for a lidar that is mounted upside down.
    pub lidars: LidarPoses,
    /// Start, in seconds after the first message of the logs. The latest map of each robot before that, and other
    /// latched messages, are sent at the start.
    #[schemars(range(min = 0.0))]
    pub start: f64,
    /// End, in seconds after the first message of the logs; the end of the logs if not set.
    pub end: Option<f64>,
}

/// How messages of robots are read that leave it open.
#[derive(Clone, Debug, Default)]
pub struct RobotReading {
    /// How the values of maps' cells are read.
    pub map_values: CellValues,
    /// The resolutions of maps; those of other robots are in the messages.
    pub resolutions: Resolutions,
    /// The poses of lidars on their robots; those of others are taken from tf.
    pub lidars: LidarPoses,
}

impl SourceParameters {
    /// The logs and their robots.
    fn inputs(&self) -> Vec<Input> {
        self.files.iter().map(|file| Input::new(file)).collect()
    }

    /// The naming rules.
    ///
    /// # Errors
    /// An entry of `rename` is invalid.
    fn rules(&self) -> Result<NameRules, String> {
        let renames = self.rename.iter().map(|text| text.parse()).collect::<Result<_, _>>()?;
        let (robots, topics) = (self.only_robots.clone(), self.only_topics.clone());
        let thresholds = if self.literal_thresholds { Thresholds::Literal } else { Thresholds::ByPicture };
        Ok(NameRules { convention: self.names, renames, robots, topics, align_start: self.align_start, thresholds })
    }
}

impl Parameters for SourceParameters {
    fn check_together(&self) -> Vec<ParameterError> {
        let mut errors = Vec::new();
        if let Err(wrong) = self.rules() {
            errors.push(ParameterError::new("rename", wrong));
        }
        if self.end.is_some_and(|end| end <= self.start) {
            errors.push(ParameterError::new("end", "must be later than `start`"));
        }
        if let Some(wrong) = problem_of_resolutions(&self.resolutions) {
            errors.push(ParameterError::new("resolutions", wrong));
        }
        let is_place = |pose: &Vec<f64>| {
            let is_angle = |angle: &f64| angle.abs() <= InitialPose::FULL_TURN;
            matches!(pose.len(), 3 | 4) && pose.iter().all(|value| value.is_finite()) && pose[2..].iter().all(is_angle)
        };
        if !self.lidars.values().all(is_place) {
            let form = "must be [X, Y, YAW] or [X, Y, YAW, ROLL] for each robot, in metres and radians (90 degrees are 1.5708)";
            errors.push(ParameterError::new("lidars", form));
        }
        errors
    }
}

/// The kind `mcap_source`.
pub fn kind() -> StageKind {
    StageKind::source(
        "mcap_source",
        "Reads MCAP logs and ROS 2 bags in log time order, and separates maps, poses, tag readings and topological maps of the robots",
        McapSource::new,
    )
}

/// The kind `live_source`.
pub fn live_kind() -> StageKind {
    StageKind::external::<RobotMessages>(
        "live_source",
        "Receives messages from robots in a live pipeline: from `gridweave play`, or from a program on the robot. Retains the last \
         message of each topic for stages that restart",
    )
}

/// The outputs of `mcap_source` and of live sources.
pub struct RobotMessages {
    pub(crate) map: Out<OccupancyGrid<'static>>,
    pub(crate) pose: Out<PoseWithCovarianceStamped>,
    pub(crate) tags: Out<TagRange>,
    pub(crate) positions: Out<TagPosition>,
    pub(crate) bearings: Out<TagBearing>,
    pub(crate) topology: Out<TopologicalMap>,
    pub(crate) scans: Out<RangeScan>,
    pub(crate) odometry: Out<PoseWithCovarianceStamped>,
    pub(crate) other: Out<AnyMessage>,
    pub(crate) localised: Out<UnmergedRobot>,
}

impl RobotMessages {
    /// Whether anything reads the scans of robots without maps.
    pub fn takes_scans(&self) -> bool {
        self.scans.is_read()
    }
}

impl Outputs for RobotMessages {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self {
            map: ports.output(
                "map",
                "the robots' maps, as logged or sent; from a log, also whole maps with their updates applied",
            ),
            pose: ports.output(
                "pose",
                "the robots' poses, with zero covariance where the log has none: derived from poses with or without \
                 covariance, odometry, or tf",
            ),
            tags: ports.output("tags", "tag ranges, as logged or sent, or derived from messages of other types"),
            positions: ports
                .output("positions", "tag positions seen by cameras, in the base frame: derived from detections or tf"),
            bearings: ports.output("bearings", "tag bearings in the base frame: derived from messages with a bearing"),
            topology: ports.output("topology", "the robots' topological maps, as logged or sent"),
            scans: ports.output(
                "scans",
                "scans of robots without maps, in the base frame: derived from the messages of lidars",
            ),
            odometry: ports.output(
                "odometry",
                "odometry of robots with scans, and without maps and a pose topic, in the odometry frame",
            ),
            other: ports
                .any_output("other", "all other messages, and those from which poses were derived, as logged or sent"),
            localised: ports.output_on(
                "/{robot}/localised",
                "localised",
                "from a log: robots that have nothing to be merged, as they localise in one map, which is no robot's, or as \
                 their maps are of a type that is not read",
            ),
        }
    }
}
