//! What a log holds of each robot.

use super::LogInfo;
use crate::source::{Classified, Role, classify, full_type_name};
use crate::tf::TfPoses;
use gridweave_runtime::message::Channel;
use gridweave_runtime::ros::{Header, OccupancyGrid, RosMessage, TFMessage, decode};
use gridweave_runtime::stage::RobotTopics;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// What a log holds of one robot.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct RobotInfo {
    /// The topics that were recognised as the robot's.
    pub topics: BTreeSet<String>,
    /// How many maps there are.
    pub maps: u64,
    /// How many poses there are, or can be made from other messages.
    pub poses: u64,
    /// How many range readings of tags there are.
    pub readings: u64,
    /// The tags that were read, and how often.
    pub tags: BTreeMap<String, u64>,
}

/// The fields of a range reading up to the tag's name.
#[derive(Deserialize)]
struct TagRangeStart<'a> {
    #[serde(rename = "header")]
    _header: Header,
    tag_id: &'a str,
}

/// Takes up messages one by one.
pub(super) struct RobotSurvey {
    topics: RobotTopics,
    /// What was found out about each channel, by topic, type and encoding.
    classified: BTreeMap<(String, String, String), (Role, String)>,
    mismatches: BTreeSet<String>,
    map_topics: BTreeSet<String>,
    robots: BTreeMap<String, RobotInfo>,
    tf: Option<TfPoses>,
}

impl RobotSurvey {
    pub(super) fn new(topics: RobotTopics) -> Self {
        Self {
            tf: topics.tf.clone().map(TfPoses::new),
            topics,
            classified: BTreeMap::new(),
            mismatches: BTreeSet::new(),
            map_topics: BTreeSet::new(),
            robots: BTreeMap::new(),
        }
    }

    pub(super) fn take(&mut self, channel: &Channel, data: &[u8]) {
    }
}
