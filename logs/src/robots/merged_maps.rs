//! Merged maps of other programs among the maps of robots.

use gridweave_runtime::ros::TFMessage;
use std::collections::{BTreeMap, BTreeSet};

/// The frame in which programs that merge maps publish the result, `multirobot_map_merge` for one.
const WORLD: &str = "world";
/// The name of a robot's map frame, behind its own.
const OWN: &str = "map";
/// The least number of robots whose maps show that another one is made of them.
const LEAST_PARTS: usize = 2;

/// Whose map a grid is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MapOrigin {
    /// The robot's of its topic.
    Robot,
    /// That of a program that merges the maps of robots.
    Merged,
    /// The frames of other maps decide, which were not seen yet.
    Undecided,
}

/// Distinguishes merged maps from those of robots. A map is a merged one if its frame is the parent of the map frames
/// of two other robots, or if it is the world's and two others have maps in frames of their own.
#[derive(Debug, Default)]
pub(crate) struct MergedMaps {
    /// The robots whose maps were seen, and whether they are in frames of their own.
    seen: BTreeMap<String, bool>,
    /// The children of each frame by static transforms.
    children: BTreeMap<String, BTreeSet<String>>,
}

impl MergedMaps {
    /// Records static transforms.
    pub(crate) fn add_transforms(&mut self, message: &TFMessage) {
        for edge in &message.transforms {
            let (parent, child) = (plain(&edge.header.frame_id), plain(&edge.child_frame_id));
            let children = self.children.entry(parent.to_owned()).or_default();
            if !children.contains(child) {
                children.insert(child.to_owned());
            }
        }
    }

    /// Records a map in `frame`, which by its topic is of `robot`, and finds out whose it is. `mapped` are all robots
    /// with topics of maps.
    pub(crate) fn origin<'a>(
        &mut self,
        robot: &str,
        frame: &str,
        mapped: impl Iterator<Item = &'a str> + Clone,
    ) -> MapOrigin {
        // Frames have the names of their robots before them, the frame of a merged map, too.
        let own = plain(frame);
        let own = own.strip_prefix(robot).and_then(|rest| rest.strip_prefix('/')).unwrap_or(own);
        let others = || mapped.clone().filter(|other| *other != robot);
        if !self.seen.contains_key(robot) {
            self.seen.insert(robot.to_owned(), own != WORLD);
        }
        let children = self.children.get(own);
        let is_child = |other: &&str| {
            let is_of = |child: &String| child.strip_prefix(*other).is_some_and(|rest| rest.starts_with('/'));
            children.is_some_and(|children| children.iter().any(is_of))
        };
        // `map` is the name of every robot's own map frame.
        if own != OWN && others().filter(is_child).count() >= LEAST_PARTS {
            return MapOrigin::Merged;
        }
        if own != WORLD {
            return MapOrigin::Robot;
        }
        let in_own_frames = others().filter(|other| self.seen.get(*other) == Some(&true)).count();
        let unseen = others().filter(|other| !self.seen.contains_key(*other)).count();
        match () {
            () if in_own_frames >= LEAST_PARTS => MapOrigin::Merged,
            () if in_own_frames + unseen >= LEAST_PARTS => MapOrigin::Undecided,
            () => MapOrigin::Robot,
        }
    }
}

/// A frame without the slash that ROS 1 programs put before it.
fn plain(frame: &str) -> &str {
    frame.trim_start_matches('/')
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::message::LogTime;
    use gridweave_runtime::ros::{Header, TransformStamped};

    const ALL: [&str; 3] = ["a", "b", "map_merge"];

    fn origins(merged: &mut MergedMaps, maps: &[(&str, &str)]) -> Vec<MapOrigin> {
        maps.iter().map(|(robot, frame)| merged.origin(robot, frame, ALL.into_iter())).collect()
    }

    #[test]
    fn a_map_in_the_world_beside_two_in_frames_of_their_own_is_a_merged_one() {
        use MapOrigin::{Merged, Robot, Undecided};
        let mut merged = MergedMaps::default();
        let maps = [("map_merge", "map_merge/world"), ("a", "a/map"), ("map_merge", "world"), ("b", "map")];
        assert_eq!(origins(&mut merged, &maps), [Undecided, Robot, Undecided, Robot]);
        assert_eq!(origins(&mut merged, &[("map_merge", "/world")]), [Merged]);
    }

    #[test]
    fn robots_whose_maps_are_all_in_the_world_are_robots() {
        use MapOrigin::{Robot, Undecided};
        let mut merged = MergedMaps::default();
        let maps = [("a", "world"), ("b", "b/world"), ("map_merge", "world"), ("a", "world")];
        assert_eq!(origins(&mut merged, &maps), [Undecided, Robot, Robot, Robot]);
        assert_eq!(MergedMaps::default().origin("a", "world", ["a", "b"].into_iter()), Robot, "one other is too few");
    }

    #[test]
    fn a_map_in_the_parent_of_two_map_frames_is_a_merged_one() {
        let mut merged = MergedMaps::default();
        let edge = |child: &str| TransformStamped {
            header: Header::new(LogTime(0), "common"),
            child_frame_id: child.into(),
            ..Default::default()
        };
        merged.add_transforms(&TFMessage { transforms: vec![edge("a/map")] });
        assert_eq!(origins(&mut merged, &[("map_merge", "map_merge/common")]), [MapOrigin::Robot]);
        merged.add_transforms(&TFMessage { transforms: vec![edge("/b/map")] });
        assert_eq!(origins(&mut merged, &[("map_merge", "map_merge/common")]), [MapOrigin::Merged]);
        assert_eq!(origins(&mut merged, &[("a", "a/map")]), [MapOrigin::Robot]);
    }
}
