//! What a log holds of each robot.

use super::LogInfo;
use crate::schemas::full_type_name;
use crate::source::{Classified, RobotChannels, Role};
use crate::tf::{TfPoses, is_static};
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
struct TagRangeStart {
    #[serde(rename = "header")]
    _header: Header,
    tag_id: String,
}

/// Takes up messages one by one.
pub(super) struct RobotSurvey {
    topics: RobotTopics,
    roles: RobotChannels,
    mismatches: BTreeSet<String>,
    /// Topics with maps that were not recognised as a robot's.
    other_maps: BTreeSet<String>,
    robots: BTreeMap<String, RobotInfo>,
    tf: Option<TfPoses>,
    /// Messages that do not fit their type, by topic.
    unreadable: BTreeMap<String, u64>,
}

impl RobotSurvey {
    /// For logs with these channels.
    pub(super) fn new<'a>(topics: RobotTopics, channels: impl Iterator<Item = &'a Channel>) -> Self {
        Self {
            roles: RobotChannels::new(topics.clone(), channels),
            tf: topics.tf.clone().map(TfPoses::new),
            topics,
            mismatches: BTreeSet::new(),
            other_maps: BTreeSet::new(),
            robots: BTreeMap::new(),
            unreadable: BTreeMap::new(),
        }
    }

    /// What a channel carries, and of which robot.
    pub(super) fn classify(&mut self, channel: &Channel) -> (Role, String) {
        let Classified { role, robot, mismatch } = self.roles.classify(channel);
        self.mismatches.extend(mismatch);
        match role {
            Role::Other if full_type_name(&channel.schema_name) == OccupancyGrid::NAME => {
                self.other_maps.insert(channel.topic.clone());
            }
            Role::Other | Role::Tf => {}
            _ => {
                self.robots.entry(robot.to_owned()).or_default().topics.insert(channel.topic.clone());
            }
        }
        (role, robot.to_owned())
    }

    /// Takes up a message on a channel with the given role, robot and topic.
    pub(super) fn take(&mut self, role: Role, robot: &str, topic: &str, data: &[u8]) {
        if role == Role::Tf {
            return self.take_tf(robot, topic, data);
        }
        let Some(info) = self.robots.get_mut(robot) else { return };
        match role {
            Role::Map => info.maps += 1,
            Role::Pose(_) => info.poses += 1,
            Role::Tags => {
                info.readings += 1;
                match decode::<TagRangeStart>(data) {
                    Ok(reading) => *info.tags.entry(reading.tag_id).or_default() += 1,
                    Err(_) => *self.unreadable.entry(topic.to_owned()).or_default() += 1,
                }
            }
            Role::Topology | Role::Tf | Role::Other => {}
        }
    }

    fn take_tf(&mut self, prefix: &str, topic: &str, data: &[u8]) {
        let Some(tf) = &mut self.tf else { return };
        let Ok(message) = decode::<TFMessage>(data) else {
            *self.unreadable.entry(topic.to_owned()).or_default() += 1;
            return;
        };
        for (robot, _) in tf.update(prefix, is_static(topic), &message).0 {
            let info = self.robots.entry(robot).or_default();
            info.poses += 1;
            if !info.topics.contains(topic) {
                info.topics.insert(topic.to_owned());
            }
        }
    }

    /// What stands in the way of using the logs, in the order in which one would mend it.
    pub(super) fn problems(&self, info: &LogInfo) -> Vec<String> {
        let mut problems = Vec::new();
        for file in &info.files {
            let path = file.path.display();
            problems.extend(file.damage.iter().map(|(what, times)| match times {
                1 => format!("{path}: {what}"),
                times => format!("{path}: {what} ({times} times)"),
            }));
        }
        if info.messages == 0 {
            problems.push("there are no messages".into());
            return problems;
        }
        problems.extend(self.mismatches.iter().cloned());
        for (topic, count) in &self.unreadable {
            problems.push(format!("{count} messages on `{topic}` do not fit their type"));
        }
        let robots = &self.robots;
        if robots.values().all(|robot| robot.maps == 0) {
            let elsewhere = match self.other_maps.is_empty() {
                true => "; there is no occupancy grid at all".to_owned(),
                false => {
                    let topics: Vec<_> = self.other_maps.iter().map(String::as_str).collect();
                    format!("; there are occupancy grids on {}: set `robots.map` to fit them", topics.join(", "))
                }
            };
            problems.push(format!("no map was recognised: no topic fits `{}`{elsewhere}", self.topics.map));
        }
        if let [robot] = robots.keys().collect::<Vec<_>>()[..] {
            problems.push(format!("there is one robot only, {robot}: nothing to merge"));
        }
        let lacking = |what: fn(&RobotInfo) -> u64| {
            let names = robots.iter().filter(|(_, robot)| what(robot) == 0).map(|(name, _)| name.as_str());
            names.collect::<Vec<_>>().join(", ")
        };
        type Lacking = (&'static str, fn(&RobotInfo) -> u64);
        let kinds: [Lacking; 3] = [
            ("map", |robot: &RobotInfo| robot.maps),
            ("pose", |robot: &RobotInfo| robot.poses),
            ("tag reading", |robot: &RobotInfo| robot.readings),
        ];
        for (what, count) in kinds {
            let names = lacking(count);
            let already_told = what == "map" && robots.values().all(|robot| robot.maps == 0);
            if !names.is_empty() && !already_told {
                problems.push(format!("there is no {what} of {names}"));
            }
        }
        problems
    }

    pub(super) fn into_robots(self) -> BTreeMap<String, RobotInfo> {
        self.robots
    }
}
