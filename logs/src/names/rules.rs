//! Rules for the names and the selection of topics and robots.

use super::TopicRename;
use crate::map_file::Thresholds;
use gridweave_runtime::stage::match_robot;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The convention for the names of topics and frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TopicNaming {
    /// Named under robots: of logs with equal topics, each is put under the name of its file; frames without a robot
    /// name get one, where the log has `/ROBOT/tf`, and in maps and poses; and `/ROBOT/tf` becomes `/tf`.
    #[default]
    ByRobot,
    /// As logged, unless the user puts a log under a robot. Missing robots are not reported.
    AsLogged,
}

/// How topics and robots are named, and which of them are read.
#[derive(Clone, Debug, Default)]
pub struct NameRules {
    /// The naming convention.
    pub convention: TopicNaming,
    /// Topics to rename.
    pub renames: Vec<TopicRename>,
    /// The robots to read; empty for all.
    pub robots: Vec<String>,
    /// The topics to read, in which `{robot}` matches one part of the path; empty for all.
    pub topics: Vec<String>,
    /// Whether all logs are shifted in time so that they start together.
    pub align_start: bool,
    /// How the thresholds of map files are applied.
    pub thresholds: Thresholds,
}

/// Whether a topic matches a pattern, in which `{robot}` matches one part of the path.
pub(super) fn fits(wanted: &str, topic: &str) -> bool {
    wanted == topic || match_robot(wanted, topic).is_some()
}

impl NameRules {
    /// The user's new name for a topic.
    pub(super) fn renamed(&self, topic: &str) -> Option<String> {
        self.renames.iter().find_map(|rename| rename.apply(topic))
    }

    /// Whether a topic of the given robot is read.
    pub(super) fn wants(&self, topic: &str, robot: Option<&str>) -> bool {
        let of_robot = robot.is_none_or(|robot| self.robots.is_empty() || self.robots.iter().any(|one| one == robot));
        of_robot && (self.topics.is_empty() || self.topics.iter().any(|wanted| fits(wanted, topic)))
    }
}
