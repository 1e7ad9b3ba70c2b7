//! Merged maps of other programs among the maps of robots.

use std::collections::BTreeSet;

/// The frame in which programs that merge maps publish the result, `multirobot_map_merge` for one.
const WORLD: &str = "world";
/// So many maps in frames of their own show that one in the world's frame is made of them.
const LEAST_PARTS: usize = 2;

/// Distinguishes merged maps from those of robots, by the frames of all maps seen so far.
#[derive(Debug, Default)]
pub(crate) struct MergedMaps {
    /// The robots with maps in frames of their own.
    own_frames: BTreeSet<String>,
}

impl MergedMaps {
    /// Whether a map, which by its topic is of `robot`, is a merged one: it is in the frame of the world, and two robots at
    /// least have maps in other frames.
    pub(crate) fn includes(&mut self, robot: &str, frame: &str) -> bool {
        let own = frame.strip_prefix(robot).and_then(|rest| rest.strip_prefix('/')).unwrap_or(frame);
        if own != WORLD {
            if !self.own_frames.contains(robot) {
                self.own_frames.insert(robot.to_owned());
            }
            return false;
        }
        self.own_frames.iter().filter(|other| *other != robot).count() >= LEAST_PARTS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn included(maps: &[(&str, &str)]) -> Vec<bool> {
        let mut merged = MergedMaps::default();
        maps.iter().map(|(robot, frame)| merged.includes(robot, frame)).collect()
    }

    #[test]
    fn a_map_in_the_world_beside_two_in_frames_of_their_own_is_a_merged_one() {
        let maps = [("a", "a/map"), ("b", "b/map"), ("map_merge", "map_merge/world"), ("c", "world")];
        assert_eq!(included(&maps), [false, false, true, true]);
    }

    #[test]
    fn robots_whose_maps_are_all_in_the_world_are_robots() {
        assert_eq!(included(&[("a", "world"), ("b", "b/world"), ("c", "world"), ("a", "world")]), [false; 4]);
        assert_eq!(included(&[("a", "map"), ("b", "world")]), [false; 2], "one map alone is not merged");
    }
}
