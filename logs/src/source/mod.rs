//! Where messages come from: `mcap_source` gives those of MCAP logs, each on the port that its topic and type call for;
//! [`map_file`] gives the maps of map files.

mod carry;
mod count;
mod live;
pub mod map_file;
mod pose;
mod route;
mod router;
mod stage;

#[cfg(test)]
mod tests;

pub use live::live_kind;
pub(crate) use route::{Classified, Role, classify};
pub use stage::McapSource;

use gridweave_runtime::ros::{OccupancyGrid, PoseWithCovarianceStamped, TagRange};
use gridweave_runtime::stage::{OutputPort, ParameterError, Parameters, PortType, StageKind};
use schemars::JsonSchema;
use serde::Deserialize;
use std::path::PathBuf;

/// The port of occupancy grids.
pub const MAP: usize = 0;
/// The port of poses.
pub const POSE: usize = 1;
/// The port of tag readings.
pub const TAGS: usize = 2;
/// The port of everything else.
pub const OTHER: usize = 3;

/// The parameters of `mcap_source`.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SourceParameters {
    /// The logs to read: MCAP files, and folders of ROS 2 bags. The messages of several are merged by log time.
    /// `--input` on the command line stands in for it.
    pub files: Vec<PathBuf>,
    /// Seconds from the first message of the logs at which to begin. The last map of each robot before that, and other
    /// latched messages, are sent at the beginning.
    pub start: f64,
    /// Seconds from the first message of the logs at which to end; to the end of the logs if it is not given.
    pub end: Option<f64>,
}

impl Parameters for SourceParameters {
    fn check(&self) -> Vec<ParameterError> {
        let mut errors = Vec::new();
        if !(self.start.is_finite() && self.start >= 0.0) {
            errors.push(ParameterError::new("start", "must be 0 s or more"));
        }
        if self.end.is_some_and(|end| !(end.is_finite() && end > self.start)) {
            errors.push(ParameterError::new("end", "must be later than `start`"));
        }
        errors
    }
}

/// The kind `mcap_source`.
pub fn kind() -> StageKind {
    StageKind::source::<SourceParameters, _>(
        "mcap_source",
        "Reads MCAP logs and ROS 2 bags by log time, and tells maps, poses and tag readings of the robots apart",
        ports(),
        McapSource::new,
    )
}

/// The outputs of all sources of what robots send.
fn ports() -> Vec<OutputPort> {
    vec![
        OutputPort::new("map", PortType::of::<OccupancyGrid<'_>>(), "the robots' maps, as they were logged or sent"),
        OutputPort::new(
            "pose",
            PortType::of::<PoseWithCovarianceStamped>(),
            "the robots' poses, with a covariance of zeros where the log has none: made from poses with or without \
                 covariance, odometry, or tf",
        ),
        OutputPort::new("tags", PortType::of::<TagRange>(), "range readings of tags, as they were logged or sent"),
        OutputPort::new(
            "other",
            PortType::Any,
            "all other messages, and those from which poses were made, as they were logged or sent",
        ),
    ]
}
