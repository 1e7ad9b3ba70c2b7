//! Topics that drivers use by default, under the names of robots.

use gridweave_runtime::stage::match_robot;
use std::collections::{BTreeMap, BTreeSet};

/// The topic of each robot that is read, of those that drivers use for one thing.
#[derive(Clone, Debug, Default)]
pub(super) struct DriverTopics(BTreeMap<String, String>);

impl DriverTopics {
    /// Chooses the topic of each robot: of those that it has, the first among `names`, which are without the robot.
    pub(super) fn choose<'a>(names: &[&str], topics: impl Iterator<Item = &'a str>) -> Self {
        let mut ranked: BTreeMap<&str, (usize, &str)> = BTreeMap::new();
        for topic in topics {
            // The first part of `/ouster/points` is no robot.
            if topic.strip_prefix('/').is_some_and(|name| names.contains(&name)) {
                continue;
            }
            let robot = |name: &str| match_robot(&format!("/{{robot}}/{name}"), topic);
            let found = names.iter().enumerate().find_map(|(rank, name)| Some((rank, robot(name)?)));
            if let Some((rank, robot)) = found {
                let best = ranked.entry(robot).or_insert((rank, topic));
                *best = (*best).min((rank, topic));
            }
        }
        Self(ranked.into_iter().map(|(robot, (_, topic))| (topic.to_owned(), robot.to_owned())).collect())
    }

    /// Chooses for each of some robots without a topic the only one in its namespace, under whatever name.
    pub(super) fn add_only_ones<'a>(&mut self, robots: &BTreeSet<&str>, topics: impl Iterator<Item = &'a str>) {
        let known: BTreeSet<String> = self.0.values().cloned().collect();
        let mut found: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
        for topic in topics {
            let Some((robot, _)) = topic.strip_prefix('/').and_then(|rest| rest.split_once('/')) else { continue };
            if robots.contains(robot) && !known.contains(robot) {
                found.entry(robot).or_default().push(topic);
            }
        }
        let only = found.into_iter().filter_map(|(robot, topics)| Some((robot, <[&str; 1]>::try_from(topics).ok()?)));
        self.0.extend(only.map(|(robot, [topic])| (topic.to_owned(), robot.to_owned())));
    }

    /// The robot that a topic was chosen for.
    pub(super) fn robot<'a>(&self, topic: &'a str) -> Option<&'a str> {
        let robot = self.0.get(topic)?;
        topic.get(1..=robot.len())
    }

    /// Forgets the topics of robots that do not meet a condition.
    pub(super) fn retain(&mut self, mut is_kept: impl FnMut(&str) -> bool) {
        self.0.retain(|_, robot| is_kept(robot));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_of_the_names_that_a_robot_has_is_chosen() {
        let names = ["odom", "platform/odom"];
        let all =
            ["/b/platform/odom", "/a/odom", "/a/platform/odom", "/platform/odom", "/odom", "/camera/odom", "odom", ""];
        let mut topics = DriverTopics::choose(&names, all.into_iter());
        let chosen = |topics: &DriverTopics| all.map(|topic| topics.robot(topic).unwrap_or_default().to_owned());
        assert_eq!(chosen(&topics), ["b", "a", "", "", "", "camera", "", ""]);
        let lone = ["/c/base/sensors/odometry", "/d/wheels", "/d/fused", "/e/odometry/x", "/b/more"];
        topics.add_only_ones(&["b", "c", "d"].into(), lone.into_iter());
        assert_eq!(lone.map(|topic| topics.robot(topic).unwrap_or_default()), ["c", "", "", "", ""]);
        topics.retain(|robot| robot != "a");
        assert_eq!(chosen(&topics), ["b", "", "", "", "", "camera", "", ""]);
    }
}
