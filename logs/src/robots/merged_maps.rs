//! Merged maps of other programs among the maps of robots.

use super::RobotChannels;
use gridweave_runtime::ros::TFMessage;
use std::collections::{BTreeMap, BTreeSet};

/// The frame in which programs that merge maps publish the result, `multirobot_map_merge` for one.
const WORLD: &str = "world";
/// The name of a robot's map frame, behind its own.
const OWN: &str = "map";
/// The last part of the names of frames that only a robot has.
const BODIES: [&str; 3] = ["odom", "base_link", "base_footprint"];
/// Parts of the names of programs that merge maps.
const MERGERS: [&str; 4] = ["merg", "fused", "combined", "stitch"];
/// Words that have such a part and another meaning.
const OTHER_WORDS: [&str; 2] = ["emerg", "submerg"];

/// Whose map a grid is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MapOrigin {
    /// The robot's of its topic.
    Robot,
    /// The robot's of its topic, of which there is nothing else, beside two robots of which there is.
    Doubtful,
    /// That of a program that merges the maps of robots.
    Merged,
    /// The frames of other maps decide, which were not seen yet.
    Undecided,
}

/// Distinguishes merged maps from those of robots. Whatever has more than maps, or was named by the user, is a robot.
/// Of the others, beside two robots at the least, a map is a merged one if its frame is
/// - the parent of the map frames of two robots,
/// - the map frame of another robot,
/// - or that of the world, and two robots have maps in frames of their own,
///
/// or if its topic names a program that merges maps.
#[derive(Debug, Default)]
pub(crate) struct MergedMaps {
    /// The robots that the user has named.
    named: BTreeSet<String>,
    /// The frames of the maps that were seen, by robot, without its name.
    seen: BTreeMap<String, String>,
    /// The children of each frame.
    children: BTreeMap<String, BTreeSet<String>>,
    /// The robots of which transforms show the body.
    bodies: BTreeSet<String>,
}

impl MergedMaps {
    /// The least number of robots whose maps show that another one is made of them.
    pub(crate) const LEAST_PARTS: usize = 2;

    /// Knows the robots that the user has named.
    pub(crate) fn new(named: BTreeSet<String>) -> Self {
        Self { named, ..Self::default() }
    }

    /// Records transforms.
    pub(crate) fn add_transforms(&mut self, message: &TFMessage) {
        for edge in &message.transforms {
            let (parent, child) = (plain(&edge.header.frame_id), plain(&edge.child_frame_id));
            let is_known = self.children.get(parent).is_some_and(|children| children.contains(child));
            if is_known {
                continue;
            }
            self.children.entry(parent.to_owned()).or_default().insert(child.to_owned());
            if let Some((robot, _)) = child.rsplit_once('/').filter(|(_, last)| BODIES.contains(last)) {
                self.bodies.insert(robot.to_owned());
            }
        }
    }

    /// Records the frame of the first map of a robot.
    pub(crate) fn add_map(&mut self, robot: &str, frame: &str) {
        if !self.seen.contains_key(robot) {
            self.seen.insert(robot.to_owned(), own(robot, frame).to_owned());
        }
    }

    /// Records a map in `frame`, which by its topic is of `robot`, and finds out whose it is.
    pub(crate) fn origin(&mut self, robot: &str, frame: &str, roles: &RobotChannels) -> MapOrigin {
        self.add_map(robot, frame);
        let is_certain = |robot: &str| roles.has_more_than_maps(robot) || self.bodies.contains(robot);
        if self.named.contains(robot) || is_certain(robot) {
            return MapOrigin::Robot;
        }
        let own = own(robot, frame);
        let others = || roles.mapped().filter(|other| *other != robot);
        // Of thousands of robots no more are looked at than decide.
        let are_enough = |found: &mut dyn Iterator<Item = &str>| found.nth(Self::LEAST_PARTS - 1).is_some();
        let may_be = |other: &&str| self.seen.get(*other).is_none_or(|frame| frame != WORLD);
        let in_own_frame = |other: &&str| self.seen.contains_key(*other) && may_be(other);
        let with_body = self.bodies.iter().map(String::as_str);
        let with_body = with_body.filter(|other| roles.is_mapped(other) && !roles.has_more_than_maps(other));
        let mut certain = roles.mapped_with_more().chain(with_body).filter(|other| *other != robot);
        // `map` is the name of every robot's own map frame.
        let is_part = |other: &&str| (own != OWN || is_certain(other)) && self.is_child(robot, own, other);
        let mut parts = others().filter(|_| !self.children.is_empty()).filter(is_part);
        let mut places = own.match_indices('/').map(|(place, _)| &own[..place]);
        match () {
            () if !are_enough(&mut others().filter(|other| !is_merger(other))) => MapOrigin::Robot,
            () if are_enough(&mut parts) => MapOrigin::Merged,
            () if is_merger(robot) || places.any(|other| other != robot && roles.is_mapped(other)) => MapOrigin::Merged,
            () if own == WORLD && are_enough(&mut others().filter(in_own_frame)) => MapOrigin::Merged,
            () if own == WORLD && are_enough(&mut others().filter(may_be)) => MapOrigin::Undecided,
            () if are_enough(&mut certain) => MapOrigin::Doubtful,
            () => MapOrigin::Robot,
        }
    }

    /// Whether transforms connect the map frame of `other` to the frame `own` of a map on the topic of `robot`. On the
    /// topic for the transforms of all robots, or on that of one of both, the frame may have the name of a robot.
    fn is_child(&self, robot: &str, own: &str, other: &str) -> bool {
        let map = format!("{other}/{}", self.seen.get(other).map_or(OWN, String::as_str));
        let parents = [own.to_owned(), format!("{robot}/{own}"), format!("{other}/{own}")];
        let has_map = |parent: &String| self.children.get(parent).is_some_and(|children| children.contains(&map));
        parents.iter().filter(|parent| **parent != map).any(has_map)
    }
}

/// What is said of maps on `topic` that are left out. With `option`, the one that takes them in.
pub(crate) fn left_out(topic: &str, option: Option<&str>) -> String {
    let cure = option.map_or_else(String::new, |option| format!("; if they are a robot's, give {option}"));
    format!("maps on `{topic}` are merged ones of another program, and are not taken as a robot's{cure}")
}

/// What is said of maps on `topic` that are taken in, with the option that leaves them out.
pub(crate) fn doubtful(topic: &str, robot: &str, option: &str) -> String {
    format!(
        "of {robot} there is nothing but maps: if those on `{topic}` are merged ones of another program, give {option}"
    )
}

/// Whether a name is that of a program that merges maps.
pub(crate) fn is_merger(name: &str) -> bool {
    let name = OTHER_WORDS.iter().fold(name.to_lowercase(), |name, word| name.replace(word, ""));
    MERGERS.iter().any(|part| name.contains(part))
}

/// The name of a frame without that of the robot. Frames have the names of their robots before them, the frame of a
/// merged map, too.
pub(super) fn own<'a>(robot: &str, frame: &'a str) -> &'a str {
    let frame = plain(frame);
    frame.strip_prefix(robot).and_then(|rest| rest.strip_prefix('/')).unwrap_or(frame)
}

/// A frame without the slash that ROS 1 programs put before it.
fn plain(frame: &str) -> &str {
    frame.trim_start_matches('/')
}

#[cfg(test)]
mod tests {
    use super::MapOrigin::{Doubtful, Merged, Robot, Undecided};
    use super::*;
    use gridweave_runtime::message::{Channel, LogTime};
    use gridweave_runtime::ros::{Header, OccupancyGrid, PoseStamped, RosMessage, TransformStamped};
    use gridweave_runtime::stage::RobotTopics;

    /// Channels with a map of each robot, and with a pose of some.
    fn roles(robots: &[&str], posed: &[&str]) -> RobotChannels {
        let channel = |topic: String, type_name: &str| Channel {
            topic,
            schema_name: type_name.to_owned(),
            message_encoding: "cdr".to_owned(),
            ..Default::default()
        };
        let maps = robots.iter().map(|robot| channel(format!("/{robot}/map"), OccupancyGrid::NAME));
        let poses = posed.iter().map(|robot| channel(format!("/{robot}/pose"), PoseStamped::NAME));
        let channels: Vec<Channel> = maps.chain(poses).collect();
        RobotChannels::new(RobotTopics::default(), channels.iter())
    }

    fn all() -> RobotChannels {
        roles(&["a", "b", "x"], &[])
    }

    fn origins(merged: &mut MergedMaps, maps: &[(&str, &str)]) -> Vec<MapOrigin> {
        maps.iter().map(|(robot, frame)| merged.origin(robot, frame, &all())).collect()
    }

    fn edges(edges: &[(&str, &str)]) -> TFMessage {
        let edge = |(parent, child): &(&str, &str)| TransformStamped {
            header: Header::new(LogTime(0), *parent),
            child_frame_id: (*child).into(),
            ..Default::default()
        };
        TFMessage { transforms: edges.iter().map(edge).collect() }
    }

    #[test]
    fn a_map_in_the_world_beside_two_in_frames_of_their_own_is_a_merged_one() {
        let mut merged = MergedMaps::default();
        let maps = [("x", "x/world"), ("a", "a/map"), ("x", "world"), ("b", "map")];
        assert_eq!(origins(&mut merged, &maps), [Undecided, Robot, Undecided, Robot]);
        assert_eq!(origins(&mut merged, &[("x", "/world")]), [Merged]);
    }

    #[test]
    fn robots_whose_maps_are_all_in_the_world_are_robots() {
        let mut merged = MergedMaps::default();
        let maps = [("a", "world"), ("b", "b/world"), ("x", "world"), ("a", "world")];
        assert_eq!(origins(&mut merged, &maps), [Undecided, Robot, Robot, Robot]);
        let two = roles(&["a", "b"], &[]);
        assert_eq!(MergedMaps::default().origin("a", "world", &two), Robot, "one other is too few");
    }

    #[test]
    fn a_map_in_the_parent_of_two_map_frames_is_a_merged_one() {
        let mut merged = MergedMaps::default();
        merged.add_transforms(&edges(&[("common", "a/map")]));
        assert_eq!(origins(&mut merged, &[("x", "x/common")]), [Robot]);
        merged.add_transforms(&edges(&[("common", "/b/map")]));
        assert_eq!(origins(&mut merged, &[("x", "x/common"), ("a", "a/map")]), [Merged, Robot]);
        let mut by_robot = MergedMaps::default();
        by_robot.add_transforms(&edges(&[("a/common", "a/map"), ("b/common", "b/slam")]));
        assert_eq!(origins(&mut by_robot, &[("b", "b/slam"), ("x", "x/common")]), [Robot, Merged]);
    }

    #[test]
    fn the_frame_map_is_that_of_a_robot_unless_it_is_the_parent_of_two() {
        let mut merged = MergedMaps::default();
        merged.add_transforms(&edges(&[("map", "a/map"), ("map", "b/map")]));
        assert_eq!(origins(&mut merged, &[("a", "map"), ("b", "map"), ("x", "map")]), [Robot, Robot, Robot]);
        let posed = roles(&["a", "b", "x"], &["a", "b"]);
        assert_eq!(merged.origin("x", "map", &posed), Merged);
        assert_eq!(MergedMaps::default().origin("x", "map", &posed), Doubtful);
    }

    #[test]
    fn a_map_in_the_map_frame_of_another_robot_is_a_merged_one() {
        assert_eq!(origins(&mut MergedMaps::default(), &[("x", "x/a/map"), ("a", "a/map")]), [Merged, Robot]);
        let two = roles(&["a", "x"], &[]);
        assert_eq!(MergedMaps::default().origin("x", "a/map", &two), Robot, "of one part nothing is merged");
    }

    #[test]
    fn a_program_that_merges_maps_is_known_by_its_name() {
        let merging = roles(&["a", "b", "MapMerger"], &[]);
        assert_eq!(MergedMaps::default().origin("MapMerger", "map", &merging), Merged);
        assert!(!is_merger("Emergency") && !is_merger("submerged2") && is_merger("emergency_merged"));
        let files = roles(&["merged1", "merged2", "merged3"], &[]);
        assert_eq!(MergedMaps::default().origin("merged1", "map", &files), Robot);
    }

    #[test]
    fn what_has_more_than_maps_or_is_named_by_the_user_is_a_robot() {
        let world = [("a", "a/map"), ("b", "b/map"), ("x", "world")];
        let mut named = MergedMaps::new(["x".to_owned()].into());
        assert_eq!(origins(&mut named, &world), [Robot, Robot, Robot]);
        let mut seen = MergedMaps::default();
        seen.add_transforms(&edges(&[("world", "x/base_link")]));
        assert_eq!(origins(&mut seen, &world), [Robot, Robot, Robot]);
        let flown = roles(&["a", "b", "x"], &["x"]);
        let mut posed = MergedMaps::default();
        assert!(world.iter().all(|(robot, frame)| posed.origin(robot, frame, &flown) == Robot));
    }
}
