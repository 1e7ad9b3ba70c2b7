//! Where messages come from: `mcap_source` gives those of MCAP logs, each on the port that its topic and type call for;
//! [`map_file`] gives the maps of map files, and [`topology_file`] topological maps that were drawn by hand.

mod carry;
mod channel;
mod channel_router;
mod derived;
mod live_router;
pub mod map_file;
mod router;
mod stage;
pub mod topology_file;

#[cfg(test)]
mod tests;

pub use live_router::{LiveMessage, LiveRouter};
pub use stage::McapSource;

use crate::map_file::Thresholds;
use crate::names::{Convention, Input, NameRules};
use gridweave_runtime::ros::{
    OccupancyGrid, PoseWithCovarianceStamped, RangeScan, TagBearing, TagPosition, TagRange, TopologicalMap,
};
use gridweave_runtime::stage::{AnyMessage, Out, OutputPorts, Outputs, ParameterError, Parameters, StageKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The parameters of `mcap_source`.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SourceParameters {
    /// The logs to read: MCAP files, and folders of ROS 2 bags. The messages of several are merged by log time. `ROBOT=LOG`
    /// puts the topics and frames of a log under the name of its robot. `--input` on the command line stands in for it.
    pub files: Vec<PathBuf>,
    /// Whose names topics and frames bear: those of their robots, or those that they were logged with.
    pub names: Convention,
    /// Topics that get other names, as `OLD=NEW`, with or without the name of their robot. `{robot}` stands for one part of
    /// both.
    pub rename: Vec<String>,
    /// The robots to read; the topics of others are left out. All if none are given.
    pub only_robots: Vec<String>,
    /// The topics to read, `{robot}` standing for any one part: `["/{robot}/map", "/tf"]`. All if none are given.
    pub only_topics: Vec<String>,
    /// Whether the clocks of all logs, and the stamps in their messages, are set so that they begin when the first one does: for
    /// robots whose clocks have nothing in common.
    pub align_start: bool,
    /// Whether the thresholds of map files beside logs are taken as they stand; see `map_file_source`.
    pub literal_thresholds: bool,
    /// Seconds from the first message of the logs at which to begin. The last map of each robot before that, and other
    /// latched messages, are sent at the beginning.
    #[schemars(range(min = 0.0))]
    pub start: f64,
    /// Seconds from the first message of the logs at which to end; to the end of the logs if it is not given.
    pub end: Option<f64>,
}

impl SourceParameters {
    /// The logs, and whose they are.
    fn inputs(&self) -> Vec<Input> {
        self.files.iter().map(|file| Input::new(file)).collect()
    }

    /// How topics and robots are named.
    ///
    /// # Errors
    /// An entry of `rename` is none.
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
        errors
    }
}

/// The kind `mcap_source`.
pub fn kind() -> StageKind {
    StageKind::source(
        "mcap_source",
        "Reads MCAP logs and ROS 2 bags by log time, and tells maps, poses, tag readings and topological maps of the robots apart",
        McapSource::new,
    )
}

/// The kind `live_source`.
pub fn live_kind() -> StageKind {
    StageKind::external::<RobotMessages>(
        "live_source",
        "Takes what robots send into a live pipeline while it runs: `gridweave play`, or a program of theirs. Keeps the last \
         message of each topic for stages that are started again",
    )
}

/// The outputs of all sources of what robots send.
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
}

impl RobotMessages {
    /// Whether anything reads the scans of robots that have no map.
    pub fn takes_scans(&self) -> bool {
        self.scans.is_read()
    }
}

impl Outputs for RobotMessages {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self {
            map: ports.output(
                "map",
                "the robots' maps, as they were logged or sent; and, out of a log, whole maps made of their updates",
            ),
            pose: ports.output(
                "pose",
                "the robots' poses, with a covariance of zeros where the log has none: made from poses with or without \
                 covariance, odometry, or tf",
            ),
            tags: ports.output(
                "tags",
                "range readings of tags, as they were logged or sent, or made from messages of other types",
            ),
            positions: ports.output(
                "positions",
                "positions at which cameras see tags, in the frames of their robots: made from the messages of detectors, or tf",
            ),
            bearings: ports.output(
                "bearings",
                "directions in which tags are perceived, in the frames of their robots: made from messages with a bearing",
            ),
            topology: ports.output("topology", "the robots' topological maps, as they were logged or sent"),
            scans: ports.output(
                "scans",
                "scans of robots that have no map, as the bases of these robots see them: made from the messages of lidars",
            ),
            odometry: ports.output(
                "odometry",
                "where robots with scans, and without a map and a topic for poses, are by odometry, in a frame of its own",
            ),
            other: ports.any_output(
                "other",
                "all other messages, and those from which poses were made, as they were logged or sent",
            ),
        }
    }
}
