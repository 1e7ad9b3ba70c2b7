//! What is said of the names of topics and robots.

use super::TopicRename;
use crate::map_file::Thresholds;
use gridweave_runtime::stage::match_robot;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Whose names topics and frames bear.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Convention {
    /// Their robots': logs that look alike are each put under the name of their file; frames that lack their robot's name
    /// get it, where the log has `/ROBOT/tf`, and in maps and poses; and `/ROBOT/tf` becomes `/tf`.
    #[default]
    ByRobot,
    /// Those that they were logged with, unless a log is put under a robot by name; and nobody is told of robots that the logs
    /// do not hold.
    AsLogged,
}

/// How topics and robots are named, and which of them are read.
#[derive(Clone, Debug, Default)]
pub struct NameRules {
    /// Whose names topics and frames bear.
    pub convention: Convention,
    /// Topics that get other names.
    pub renames: Vec<TopicRename>,
    /// The robots that are read; all if there are none.
    pub robots: Vec<String>,
    /// The topics that are read, `{robot}` standing for any one part; all if there are none.
    pub topics: Vec<String>,
    /// Whether the clocks of all logs are set so that they begin together.
    pub align_start: bool,
    /// How the thresholds of map files are read.
    pub thresholds: Thresholds,
}

/// Whether a topic is the one that is asked for, in which `{robot}` stands for any one part.
pub(super) fn fits(wanted: &str, topic: &str) -> bool {
    wanted == topic || match_robot(wanted, topic).is_some()
}

impl NameRules {
    /// The other name that a topic is to have.
    pub(super) fn renamed(&self, topic: &str) -> Option<String> {
        self.renames.iter().find_map(|rename| rename.apply(topic))
    }

    /// Whether a topic is read, which is that of the given robot.
    pub(super) fn wants(&self, topic: &str, robot: Option<&str>) -> bool {
        let of_robot = robot.is_none_or(|robot| self.robots.is_empty() || self.robots.iter().any(|one| one == robot));
        of_robot && (self.topics.is_empty() || self.topics.iter().any(|wanted| fits(wanted, topic)))
    }
}
