//! Which of what is published is taken as that of robots, what is not, and what to write so that it is: for the verb
//! `doctor`, and for a run that finds no robot.

use super::discovery::node_identity::Owner;
use super::discovery::publishers::{Published, Topics};
use super::middleware::Middleware;
use gridweave_logs::names::rename_advice;
use gridweave_runtime::pipeline::list_in_words;
use gridweave_runtime::ros::{LaserScan, MultiEchoLaserScan, OccupancyGrid, Odometry, RosMessage, TFMessage};
use gridweave_runtime::stage::{RobotTopics, match_robot};
use std::collections::{BTreeMap, BTreeSet};

/// What there is of robots.
pub(crate) struct Findings {
    pattern: String,
    /// The nodes that publish the map of each robot.
    pub(crate) maps: BTreeMap<String, Vec<String>>,
    /// The robots that publish scans and no map, and whether anything says how they move.
    pub(crate) scanning: BTreeMap<String, bool>,
    /// The topics on which maps of robots are expected, with the other types that are there.
    pub(crate) wrong_types: BTreeSet<(String, String)>,
    /// Maps on other topics, with their nodes.
    elsewhere: BTreeMap<String, Vec<String>>,
    /// The maps that runs of Gridweave publish, with their nodes.
    pub(crate) merged: BTreeMap<String, Vec<String>>,
}

impl Findings {
    /// Looks for robots on the topics that a pipeline names.
    pub(crate) fn new(topics: &Topics, robots: &RobotTopics) -> Self {
        let mut findings = Self {
            pattern: robots.map.clone(),
            maps: BTreeMap::new(),
            scanning: BTreeMap::new(),
            wrong_types: BTreeSet::new(),
            elsewhere: BTreeMap::new(),
            merged: BTreeMap::new(),
        };
        for (name, of_topic) in topics {
            findings.note_maps(name, of_topic);
        }
        let has = |name: &str, types: &[&str]| {
            let is_one = |of: &Published| of.owner == Owner::Other && types.contains(&of.ros_type.as_str());
            topics.get(name).is_some_and(|of_topic| of_topic.iter().any(is_one))
        };
        for name in topics.keys().filter(|name| has(name, &[LaserScan::NAME, MultiEchoLaserScan::NAME])) {
            let Some(robot) = match_robot(&robots.scan, name).filter(|robot| !findings.maps.contains_key(*robot))
            else {
                continue;
            };
            let moves = has(&format!("/{robot}/odom"), &[Odometry::NAME])
                || topics.contains_key(&robots.pose.replace("{robot}", robot))
                || ["/tf".to_owned(), format!("/{robot}/tf")].iter().any(|tf| has(tf, &[TFMessage::NAME]));
            findings.scanning.insert(robot.to_owned(), moves);
        }
        findings
    }

    fn note_maps(&mut self, name: &str, of_topic: &[Published]) {
        let is_map = |of: &&Published| of.ros_type == OccupancyGrid::NAME;
        let robot = match_robot(&self.pattern, name);
        let (others, runs): (Vec<&Published>, Vec<&Published>) =
            of_topic.iter().partition(|of| of.owner == Owner::Other);
        if robot.is_some() {
            let wrong = others.iter().filter(|of| !is_map(of));
            self.wrong_types.extend(wrong.map(|of| (name.to_owned(), of.ros_type.clone())));
        }
        let [others, runs] = [others, runs].map(|all| nodes(all.into_iter().filter(is_map)));
        if !runs.is_empty() {
            self.merged.insert(name.to_owned(), runs);
        }
        match robot {
            _ if others.is_empty() => {}
            Some(robot) => _ = self.maps.insert(robot.to_owned(), others),
            // A costmap is made of a map, and is none.
            None if name.contains("costmap") => {}
            None => _ = self.elsewhere.insert(name.to_owned(), others),
        }
    }

    /// What to write so that maps and scans are taken that are not, by a pipeline that draws maps of scans or not.
    pub(crate) fn advice(&self, draws_maps: bool) -> Vec<String> {
        let mut advice: Vec<String> = self.about_elsewhere().into_iter().collect();
        if !draws_maps && !self.scanning.is_empty() {
            let mut text = format!(
                "{} publish{} scans and no map: `gridweave-ros run live_ros_scans` draws maps of scans",
                list_in_words(self.scanning.keys()),
                if self.scanning.len() == 1 { "es" } else { "" }
            );
            let unmoved: Vec<&String> =
                self.scanning.iter().filter(|(_, moves)| !**moves).map(|(name, _)| name).collect();
            if !unmoved.is_empty() {
                let robots = list_in_words(unmoved.iter().copied());
                text.push_str(&format!("; it needs odometry, poses or tf, too, and finds none of {robots}"));
            }
            advice.push(text);
        }
        advice
    }

    /// What to write so that maps on other topics are those of robots.
    fn about_elsewhere(&self) -> Option<String> {
        // Where two robots have maps that fit, further grids are not those of robots.
        if self.elsewhere.is_empty() || self.maps.len() > 1 {
            return None;
        }
        if let Some((topic, nodes)) = self.elsewhere.iter().find(|(topic, nodes)| is_shared(topic, nodes)) {
            return Some(self.about_shared(topic, nodes));
        }
        let fitting: Vec<String> = self.maps.keys().map(|robot| self.pattern.replace("{robot}", robot)).collect();
        let all = self.elsewhere.keys().chain(&fitting).map(String::as_str);
        // What the option of logs says is what the pipeline says here.
        let advised = rename_advice(all, &self.pattern);
        let template = |option: &String| Some(option.strip_prefix("--rename '")?.split_once('=')?.0.to_owned());
        let template = advised.first().and_then(template).filter(|template| template.contains("{robot}"));
        let maps = list_in_words(self.elsewhere.keys().map(|topic| format!("`{topic}`")));
        match template.or_else(|| self.only_template()) {
            Some(template) => Some(format!(
                "maps are on {maps}: in a copy of the pipeline (`gridweave-ros pipelines live_ros > my.toml`), below [robots], write: \
                 map = \"{template}\""
            )),
            None => Some(format!(
                "maps are on {maps}, and not on `{}`: start the nodes of each robot in a namespace of its own, which is its name",
                self.pattern
            )),
        }
    }

    /// The pattern of the only map, if the part before its last one may be a robot.
    fn only_template(&self) -> Option<String> {
        let mut topics = self.elsewhere.keys();
        let (Some(topic), None) = (topics.next(), topics.next()) else { return None };
        let (namespace, last) = topic.rsplit_once('/')?;
        let (before, _) = namespace.rsplit_once('/').filter(|_| self.maps.is_empty())?;
        Some(format!("{before}/{{robot}}/{last}"))
    }

    /// What to write so that the nodes that publish one map for all publish it for their robots.
    fn about_shared(&self, topic: &str, nodes: &[String]) -> String {
        let (name, who) = (topic.trim_start_matches('/'), list_in_words(nodes));
        if nodes.iter().all(|node| node.ends_with("map_server")) {
            return format!(
                "`{topic}` of {who} is a map that was made before: robots that localise in it have one frame, and nothing to merge"
            );
        }
        let namespaces: BTreeSet<&str> = nodes.iter().filter_map(|node| namespace(node)).collect();
        let remap = format!("-r {topic}:={name}");
        // As slam_toolbox has them from the root on, too.
        let more = if topic == "/map" { " -r /map_metadata:=map_metadata -r /scan:=scan" } else { "" };
        match namespaces.len() == nodes.len() {
            true => {
                let named = namespaces.iter().map(|namespace| format!("`{namespace}/{name}`"));
                format!(
                    "`{topic}` is published by {who}: start each with {remap}{more}, and the maps are on {}; two_robots.launch.py does so",
                    list_in_words(named)
                )
            }
            false => format!(
                "`{topic}` is published by {who}: start the nodes of each robot in a namespace of its own, which is its name, and with \
                 {remap}{more} -r /tf:=tf -r /tf_static:=tf_static, as two_robots.launch.py does"
            ),
        }
    }
}

/// The nodes that publish these, of which one on both middlewares is one.
fn nodes<'a>(published: impl Iterator<Item = &'a Published>) -> Vec<String> {
    let mut nodes = Vec::<(Middleware, String)>::new();
    for of in published {
        let is_known = |node: &String| nodes.iter().any(|(on, known)| *on != of.middleware && known == node);
        let more: Vec<_> = of.nodes.iter().filter(|node| !is_known(node)).cloned().collect();
        nodes.extend(more.into_iter().map(|node| (of.middleware, node)));
    }
    nodes.into_iter().map(|(_, node)| node).collect()
}

/// Whether a map bears the name of no robot: of several nodes, or of one.
fn is_shared(topic: &str, nodes: &[String]) -> bool {
    topic == "/map" || nodes.len() > 1
}

/// The namespace of a node; `None` for the root.
fn namespace(node: &str) -> Option<&str> {
    node.rsplit_once('/').map(|(namespace, _)| namespace).filter(|namespace| !namespace.is_empty())
}

#[cfg(test)]
mod tests {
    use super::super::discovery::publishers::DiscoveredPublishers;
    use super::super::discovery::publishers::tests::publisher;
    use super::*;

    /// What is found where these nodes, each with its namespace, publish.
    fn found(published: &[(&str, &str, &str, &str)]) -> Findings {
        let mut publishers = DiscoveredPublishers::default();
        for (number, (namespace, node, topic, ros_type)) in (0..).zip(published) {
            let entity = publisher([namespace, node], topic, ros_type, number);
            let owner = if *node == "gridweave_ros" { Owner::OtherRun } else { Owner::Other };
            for middleware in [Middleware::Dds, Middleware::Zenoh] {
                publishers.note(middleware, entity.clone(), owner, true);
            }
        }
        Findings::new(&publishers.topics(), &RobotTopics::default())
    }

    #[track_caller]
    fn advised(published: &[(&str, &str, &str, &str)], words: &[&str]) {
        let advice = found(published).advice(false).join("\n");
        for words in words {
            assert!(advice.contains(words), "{words}: {advice}");
        }
        assert_eq!(advice.is_empty(), words.is_empty(), "{advice}");
    }

    const MAP: &str = OccupancyGrid::NAME;

    #[test]
    fn a_map_of_gridweave_is_none_of_a_robot() {
        let findings = found(&[("/", "gridweave_ros", "/fleet/map", MAP), ("/robot1", "slam", "/robot1/map", MAP)]);
        assert_eq!(findings.maps, BTreeMap::from([("robot1".to_owned(), vec!["/robot1/slam".to_owned()])]));
        assert_eq!(findings.merged, BTreeMap::from([("/fleet/map".to_owned(), vec!["/gridweave_ros".to_owned()])]));
        assert!(findings.advice(false).is_empty());
    }

    /// slam_toolbox publishes `/map` in whatever namespace it is.
    #[test]
    fn the_advice_for_nodes_that_publish_one_map_is_to_remap_it() {
        advised(
            &[("/robot1", "slam_toolbox", "/map", MAP), ("/robot2", "slam_toolbox", "/map", MAP)],
            &["/robot1/slam_toolbox and /robot2/slam_toolbox", "-r /map:=map", "`/robot1/map` and `/robot2/map`"],
        );
        advised(&[("/robot1", "slam_toolbox", "/map", MAP)], &["-r /map:=map -r", "the maps are on `/robot1/map`"]);
        advised(
            &[("/", "slam_toolbox", "/map", MAP)],
            &["`/map` is published by /slam_toolbox", "namespace of its own", "-r /map:=map -r", "-r /tf:=tf"],
        );
    }

    #[test]
    fn robots_that_localise_in_one_map_have_nothing_to_merge() {
        advised(&[("/", "map_server", "/map", MAP)], &["`/map` of /map_server", "nothing to merge"]);
    }

    #[test]
    fn the_advice_for_maps_below_a_further_name_has_their_pattern() {
        let pattern = "map = \"/fleet/{robot}/map\"";
        advised(&[("/", "a", "/fleet/robot1/map", MAP), ("/", "b", "/fleet/robot2/map", MAP)], &[pattern]);
        advised(&[("/", "a", "/fleet/robot1/map", MAP)], &[pattern]);
        advised(
            &[("/", "a", "/map1", MAP), ("/", "b", "/map2", MAP)],
            &["`/map1` and `/map2`", "namespace of its own"],
        );
    }

    #[test]
    fn the_advice_for_robots_with_scans_is_the_pipeline_that_builds_maps() {
        let scans = |robot: &'static str| ("/", "lidar", robot, LaserScan::NAME);
        let odometry = ("/", "base", "/robot1/odom", Odometry::NAME);
        let both = [scans("/robot1/scan"), scans("/robot2/scan"), odometry];
        advised(&both, &["robot1 and robot2 publish scans", "live_ros_scans", "finds none of robot2"]);
        assert!(found(&both).advice(true).is_empty());
        advised(&[scans("/robot1/scan"), odometry, ("/", "a", "/robot1/map", MAP)], &[]);
    }

    #[test]
    fn a_topic_of_a_map_with_another_type_is_found() {
        let findings = found(&[("/", "a", "/robot1/map", "std_msgs/msg/String")]);
        let wrong = ("/robot1/map".to_owned(), "std_msgs/msg/String".to_owned());
        assert_eq!((findings.wrong_types, findings.maps.len()), (BTreeSet::from([wrong]), 0));
    }

    #[test]
    fn two_nodes_of_one_map_are_two_and_a_node_on_two_middlewares_is_one() {
        let maps = found(&[("/", "a", "/robot1/map", MAP), ("/", "b", "/robot1/map", MAP)]).maps;
        assert_eq!(maps["robot1"], ["/a", "/b"]);
    }
}
