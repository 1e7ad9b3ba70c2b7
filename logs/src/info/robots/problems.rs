//! Problems with reading logs or merging the maps in them.

use super::{RobotInfo, RobotSurvey};
use crate::info::{LogInfo, TopicInfo};
use crate::names::{rename_advice, scan_rename_advice};
use crate::robots::{is_scan, problem_of_frames};
use crate::schemas::full_type_name;
use gridweave_runtime::pipeline::list_in_words;
use gridweave_runtime::ros::{Odometry, RosMessage};
use std::collections::BTreeMap;

impl RobotSurvey {
    /// Problems with reading the logs or merging the maps, in the order in which they should be fixed.
    pub(in crate::info) fn problems(&self, info: &LogInfo) -> Vec<String> {
        let damage = damage(info);
        if info.messages == 0 {
            return damage.chain(["there are no messages".to_owned()]).collect();
        }
        let map_advice = self.map_advice();
        let missing_poses = self.missing_poses();
        damage
            .chain(self.reading_problems())
            .chain(self.unusable_maps())
            .chain(mixed_frames(info))
            .chain(self.shared_map())
            .chain(self.map_topic_problem(&map_advice))
            .chain(self.unread_maps.iter().filter(|_| self.has_no_map()).cloned())
            .chain(self.with_unread_maps.iter().map(|(robot, said)| format!("there is no map of {robot}: {said}")))
            .chain(self.scan_topic_problem())
            .chain(self.lone_robot().filter(|_| map_advice.is_empty()))
            .chain(self.missing_messages(&missing_poses))
            .chain(missing_poses.values().cloned())
            .chain(self.maps_to_be_built())
            .collect()
    }

    /// Channels and messages that do not have the type that their topic suggests.
    fn reading_problems(&self) -> impl Iterator<Item = String> {
        let unreadable = self.unreadable.iter();
        let unreadable =
            unreadable.map(|(topic, count)| format!("{count} messages on `{topic}` do not match their type"));
        self.mismatches.iter().cloned().chain(unreadable)
    }

    /// Maps that cannot be used, merged maps of other programs, and lidars that are not read.
    fn unusable_maps(&self) -> impl Iterator<Item = String> {
        let unusable = self.unusable_maps.iter();
        let unusable =
            unusable.map(|(robot, (error, count))| format!("{count} of the maps of {robot} cannot be used: {error}"));
        unusable.chain(self.peculiarities.values().cloned()).chain(self.notes.iter().cloned())
    }

    /// The map in which several robots localise.
    fn shared_map(&self) -> Option<String> {
        let one_map = self.one_map.as_ref()?;
        Some(one_map.note().unwrap_or_else(|| one_map.reason(&self.topics.map)))
    }

    /// Whether no robot has a map, or scans to build one from.
    fn has_no_map(&self) -> bool {
        self.robots.values().all(|robot| robot.maps == 0 && robot.scans == 0)
    }

    /// The arguments that rename the topics of maps that belong to no robot.
    fn map_advice(&self) -> Vec<String> {
        let pattern = &self.topics.map;
        let with_maps = self.robots.iter().filter(|(_, robot)| robot.maps > 0);
        let fitting: Vec<String> = with_maps.map(|(name, _)| pattern.replace("{robot}", name)).collect();
        rename_advice(self.other_maps.iter().chain(&fitting).map(String::as_str), pattern)
    }

    /// Maps that belong to no robot, or the lack of any. `advice` is the arguments that rename their topics.
    fn map_topic_problem(&self, advice: &[String]) -> Option<String> {
        let pattern = &self.topics.map;
        let topics = list_in_words(&self.other_maps);
        match (advice, topics.as_str()) {
            ([], _) if self.one_map.is_some() => None,
            ([], "") if self.has_no_map() => {
                let scans = match list_in_words(&self.other_scans) {
                    scans if self.other_scans.is_empty() => scans,
                    scans => format!(
                        "; `merge` builds maps from the scans on {scans} if the robot is named (`gridweave merge \
                         ROBOT=LOG OTHER_ROBOT=OTHER_LOG`)"
                    ),
                };
                Some(format!(
                    "no map was recognised: no topic fits `{pattern}`; there is no occupancy grid at all{scans}"
                ))
            }
            ([], topics) if self.has_no_map() => Some(format!(
                "no map was recognised: no topic fits `{pattern}`; there are occupancy grids on {topics}: if the log is of one \
                 robot, name the robot (`gridweave merge ROBOT=LOG OTHER_ROBOT=OTHER_LOG`), else set `robots.map` to match them"
            )),
            ([], _) => None,
            (advice, topics) => Some(format!("maps on {topics} do not fit `{pattern}`: give {}", advice.join(" "))),
        }
    }

    /// Scans that belong to no robot, where no map is.
    fn scan_topic_problem(&self) -> Option<String> {
        let pattern = &self.topics.scan;
        let scans = self.other_scans.iter().map(String::as_str);
        let advice = scan_rename_advice(scans, pattern).filter(|_| self.has_no_map())?;
        Some(format!("scans do not fit `{pattern}`, and no map is built from them: give {advice}"))
    }

    /// The robot that is the only one.
    fn lone_robot(&self) -> Option<String> {
        match self.robots.keys().collect::<Vec<_>>()[..] {
            [robot] if self.with_unread_maps.is_empty() => {
                Some(format!("there is one robot only, {robot}: merge the log with that of another robot"))
            }
            _ => None,
        }
    }

    /// By robot, why no poses are derived for it.
    fn missing_poses(&self) -> BTreeMap<String, String> {
        let mut missing = self.inferred.missing();
        missing.retain(|robot, _| self.robots.contains_key(robot));
        missing
    }

    /// The robots without maps, poses or tag readings, unless another problem is the reason.
    fn missing_messages(&self, missing_poses: &BTreeMap<String, String>) -> impl Iterator<Item = String> {
        let is_explained = |robot: &str| {
            self.with_unread_maps.contains_key(robot)
                || self.one_map.as_ref().is_some_and(|one_map| one_map.robots.contains(robot))
        };
        let lacking = |what: &str, lacks: &dyn Fn(&str, &RobotInfo) -> bool| {
            let names = self.robots.iter().filter(|(name, robot)| lacks(name, robot)).map(|(name, _)| name.as_str());
            let names = list_in_words(names);
            (!names.is_empty()).then(|| format!("there is no {what} of {names}"))
        };
        let maps = lacking("map", &|name, robot| robot.maps + robot.scans == 0 && !is_explained(name));
        let poses = lacking("pose", &|name, robot| robot.poses == 0 && !missing_poses.contains_key(name));
        let readings = lacking("tag reading", &|_, robot| robot.readings == 0);
        [maps.filter(|_| !self.has_no_map()), poses, readings].into_iter().flatten()
    }

    /// The maps that would be built for robots without one.
    fn maps_to_be_built(&self) -> impl Iterator<Item = String> {
        let scanned = self.robots.iter().filter(|(_, robot)| robot.scans > 0);
        scanned.map(|(name, robot)| self.built_map(name, robot))
    }

    /// A description of the map that would be built for a robot without one.
    fn built_map(&self, name: &str, robot: &RobotInfo) -> String {
        let poses = robot.poses_from.clone().or_else(|| self.inferred.origin(name)).filter(|_| robot.poses > 0);
        let by_topic = self.odometry.get(name).map(|topic| format!("`{topic}`"));
        let how = match (poses, by_topic.or_else(|| self.inferred.odometry_origin(name))) {
            (Some(poses), _) => {
                format!("builds one from its {} scans, at the poses of {poses}", robot.scans)
            }
            (None, Some(odometry)) => {
                format!("builds one from its {} scans by SLAM, with the odometry of {odometry}", robot.scans)
            }
            (None, None) => {
                format!("builds one from its {} scans by SLAM; odometry would make it surer", robot.scans)
            }
        };
        format!("there is no map of {name}: `merge` {how}")
    }
}

/// The damage to the files.
fn damage(info: &LogInfo) -> impl Iterator<Item = String> {
    info.files.iter().flat_map(|file| {
        let path = file.path.display();
        file.damage.iter().map(move |(what, times)| match times {
            1 => format!("{path}: {what}"),
            times => format!("{path}: {what} ({times} times)"),
        })
    })
}

/// Topics of scans and odometry with the messages of several robots.
fn mixed_frames(info: &LogInfo) -> impl Iterator<Item = String> {
    let is_of_one = |topic: &&TopicInfo| {
        let type_name = full_type_name(&topic.type_name);
        is_scan(&type_name) || type_name == Odometry::NAME
    };
    let problem = |topic: &TopicInfo| problem_of_frames(&topic.topic, topic.frames.iter());
    info.topics.iter().filter(is_of_one).filter_map(problem)
}
