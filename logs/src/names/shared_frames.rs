//! Frames without a robot's name in the transforms of all robots.
//!
//! Maps get the names of their robots before their frames: `map` becomes `robot1/map`. Transforms on `/tf` belong to
//! all robots, so it is their frames that show which of them follow: those from `map` to `robot1/base_link` become
//! transforms from `robot1/map`, also where the maps of several robots are in the one frame `map`.

use super::Names;
use crate::reader::{LogFile, LogReader};
use crate::robots::{RobotChannels, Role};
use gridweave_runtime::ros::{Header, TFMessage, decode, encode};
use gridweave_runtime::stage::{RobotTopics, frame_of_robot};
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// The number of messages that are searched for the first map of each robot, in logs without an index.
const SEARCHED: usize = 20_000;

/// The frames without a robot's name.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct SharedFrames {
    /// The robots whose maps are logged in a frame, by this frame.
    of_map: BTreeMap<String, BTreeSet<String>>,
    /// The only robot whose map frame lacks its name; it has all frames below its map frame that lack one.
    only: Option<String>,
    /// All robots with maps.
    robots: BTreeSet<String>,
    /// The frames above map frames, which belong to no robot.
    above: BTreeSet<String>,
}

impl SharedFrames {
    /// Reads the first maps of robots, and the first transforms. `None` if no frame in transforms is to be renamed.
    pub(super) fn read(files: &Arc<[LogFile]>, names: &Names, robots: &RobotTopics) -> Option<Self> {
        let roles = RobotChannels::new(robots.clone(), names.channels());
        let mut maps: BTreeMap<(usize, u16), String> = BTreeMap::new();
        let mut transforms: BTreeSet<(usize, u16)> = BTreeSet::new();
        for (file, channels) in names.channels.iter().enumerate() {
            for (number, named) in channels {
                let classified = roles.classify(&named.channel);
                if classified.role == Role::Map && names.robot_of_file(file).is_none() {
                    maps.insert((file, *number), classified.robot.to_owned());
                } else if named.is_shared_tf() {
                    transforms.insert((file, *number));
                }
            }
        }
        if maps.is_empty() || transforms.is_empty() {
            return None;
        }
        let mut reader = LogReader::of(Arc::clone(files));
        let is_indexed = files.iter().all(|file| file.index().is_some());
        if is_indexed {
            reader.sample(1);
        }
        let (mut found, mut edges) = (BTreeMap::new(), BTreeSet::new());
        let mut read = 0;
        while found.len() < maps.len() && (is_indexed || read < SEARCHED) {
            let Some(message) = reader.next_message() else { break };
            read += 1;
            let key = (message.file, message.channel);
            if let Some(robot) = maps.get(&key).filter(|_| !found.contains_key(&key)) {
                let frame = decode::<Header>(message.data).map(|header| Self::plain(&header.frame_id).to_owned());
                found.insert(key, (robot.clone(), frame.unwrap_or_default()));
            } else if transforms.contains(&key)
                && let Ok(message) = decode::<TFMessage>(message.data)
            {
                let edge =
                    |(parent, child): (&str, &str)| (Self::plain(parent).to_owned(), Self::plain(child).to_owned());
                let all = message.transforms.iter();
                edges.extend(all.map(|one| edge((&one.header.frame_id, &one.child_frame_id))));
            }
        }
        Self::of(found.into_values(), &edges)
    }

    /// A frame without the slash that ROS 1 programs put before it.
    pub(crate) fn plain(frame: &str) -> &str {
        frame.trim_start_matches('/')
    }

    /// What maps, each with its robot and frame, and transforms, parent and child, show.
    pub(crate) fn of(maps: impl Iterator<Item = (String, String)>, edges: &BTreeSet<(String, String)>) -> Option<Self> {
        let mut shared = Self::default();
        for (robot, frame) in maps {
            let own = frame_of_robot(&robot, &frame);
            // A frame that already has its name, or is tied to one that has, is not the one that gets it.
            let is_own = frame.is_empty() || own == frame || edges.contains(&(frame.clone(), own.into_owned()));
            if !is_own {
                shared.of_map.entry(frame).or_default().insert(robot.clone());
            }
            shared.robots.insert(robot);
        }
        let mut unnamed: BTreeSet<&String> = shared.of_map.values().flatten().collect();
        shared.only = unnamed.pop_first().filter(|_| unnamed.is_empty()).cloned();
        let mut parents: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
        for (parent, child) in edges {
            parents.entry(child).or_default().push(parent);
        }
        let is_map = |frame: &str| shared.of_map.contains_key(frame) || shared.robot_of(frame).is_some();
        let mut above = BTreeSet::new();
        let mut pending: Vec<&str> = parents.keys().copied().filter(|child| is_map(child)).collect();
        while let Some(child) = pending.pop() {
            for &parent in parents.get(child).into_iter().flatten() {
                if !is_map(parent) && above.insert(parent.to_owned()) {
                    pending.push(parent);
                }
            }
        }
        shared.above = above;
        (!shared.of_map.is_empty()).then_some(shared)
    }

    /// The robot whose name a frame has.
    fn robot_of(&self, frame: &str) -> Option<&String> {
        frame.match_indices(['/', '_']).find_map(|(place, _)| self.robots.get(&frame[..place]))
    }

    /// The names of the parent and the child of a transform.
    fn edge<'a>(&self, parent: &'a str, child: &'a str) -> (Cow<'a, str>, Cow<'a, str>) {
        let (plain_parent, plain_child) = (Self::plain(parent), Self::plain(child));
        if let Some(robot) = self.robot_of(plain_child) {
            let follows = self.of_map.get(plain_parent).is_some_and(|robots| robots.contains(robot));
            let parent = if follows { frame_of_robot(robot, plain_parent) } else { Cow::Borrowed(parent) };
            return (parent, Cow::Borrowed(child));
        }
        let own = |frame: &'a str| match &self.only {
            Some(only) if self.robot_of(Self::plain(frame)).is_none() && !self.above.contains(Self::plain(frame)) => {
                frame_of_robot(only, Self::plain(frame))
            }
            _ => Cow::Borrowed(frame),
        };
        (own(parent), own(child))
    }

    /// The message with the names of robots; `None` if it stays as it is.
    pub(crate) fn renamed(&self, message: &[u8]) -> Option<Vec<u8>> {
        let mut message: TFMessage = decode(message).ok()?;
        let mut is_renamed = false;
        for one in &mut message.transforms {
            let (parent, child) = self.edge(&one.header.frame_id, &one.child_frame_id);
            if (&*parent, &*child) != (one.header.frame_id.as_str(), one.child_frame_id.as_str()) {
                let (parent, child) = (parent.into_owned(), child.into_owned());
                (one.header.frame_id, one.child_frame_id) = (parent, child);
                is_renamed = true;
            }
        }
        is_renamed.then(|| encode(&message).ok()).flatten()
    }
}

impl Names {
    /// Finds out which frames in transforms of all robots follow the maps of robots, and renames them from now on.
    pub(super) fn share_frames(&mut self, files: &Arc<[LogFile]>, robots: &RobotTopics) {
        let shared = SharedFrames::read(files, self, robots).map(Arc::new);
        let all = self.channels.iter_mut().flat_map(BTreeMap::values_mut);
        all.filter(|named| named.is_shared_tf()).for_each(|named| named.share_frames(shared.clone()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shared(maps: &[(&str, &str)], edges: &[(&str, &str)]) -> Option<SharedFrames> {
        let edges = edges.iter().map(|(parent, child)| (parent.to_string(), child.to_string())).collect();
        SharedFrames::of(maps.iter().map(|(robot, frame)| (robot.to_string(), frame.to_string())), &edges)
    }

    #[track_caller]
    fn assert_edge(shared: &SharedFrames, edge: (&str, &str), expected: (&str, &str)) {
        let (parent, child) = shared.edge(edge.0, edge.1);
        assert_eq!((&*parent, &*child), expected);
    }

    #[test]
    fn transforms_from_one_frame_of_all_maps_are_distinguished_by_their_children() {
        let shared = shared(&[("a", "map"), ("b", "map")], &[("map", "a/base_link")]).unwrap();
        assert_edge(&shared, ("map", "a/base_link"), ("a/map", "a/base_link"));
        assert_edge(&shared, ("/map", "/b/odom"), ("b/map", "/b/odom"));
        for stays in [("a/odom", "a/base_link"), ("map", "base_link"), ("world", "a/map"), ("map", "c/base_link")] {
            assert_edge(&shared, stays, stays);
        }
    }

    #[test]
    fn the_only_robot_without_a_name_in_frames_has_all_that_lack_one() {
        let edges = [("world", "map"), ("world", "b/map"), ("map", "odom"), ("odom", "base_link"), ("earth", "world")];
        let shared = shared(&[("a", "map"), ("b", "b/map")], &edges).unwrap();
        assert_edge(&shared, ("map", "odom"), ("a/map", "a/odom"));
        assert_edge(&shared, ("odom", "base_link"), ("a/odom", "a/base_link"));
        assert_edge(&shared, ("base_link", "laser"), ("a/base_link", "a/laser"));
        assert_edge(&shared, ("world", "map"), ("world", "a/map"));
        for stays in [("world", "b/map"), ("b/map", "b/odom"), ("earth", "world")] {
            assert_edge(&shared, stays, stays);
        }
    }

    #[test]
    fn a_long_chain_of_frames_above_a_map_takes_no_time() {
        let names: Vec<String> = (0..100_000).map(|number| format!("f{number:06}")).collect();
        let mut edges: Vec<(&str, &str)> = names.windows(2).map(|two| (two[0].as_str(), two[1].as_str())).collect();
        edges.push((&names[99_999], "map"));
        let shared = shared(&[("a", "map"), ("b", "b/map")], &edges).unwrap();
        assert_edge(&shared, ("f000000", "f000001"), ("f000000", "f000001"));
        assert_edge(&shared, ("map", "odom"), ("a/map", "a/odom"));
    }

    #[test]
    fn frames_stay_where_maps_have_frames_of_their_own() {
        assert_eq!(shared(&[("a", "a/map"), ("b", "b_map")], &[("map", "a/base_link")]), None);
        let tied = [("map", "a/map"), ("map", "b/map"), ("map", "a/base_link")];
        assert_eq!(shared(&[("a", "map"), ("b", "map")], &tied), None, "`map` is another frame than `a/map`");
        assert_eq!(shared(&[("a", "")], &[]), None);
    }
}
