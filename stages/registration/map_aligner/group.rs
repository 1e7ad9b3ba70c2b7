//! Groups of robots whose maps are merged for the search.

use crate::registration::search::{PreparedMap, Raster};
use crate::shared::geometry::Pose2;
use std::cell::OnceCell;
use std::cmp::Reverse;
use std::collections::BTreeMap;

/// Robots whose maps are merged, to be searched as one map.
pub(super) struct MergedGroup {
    pub(super) number: u64,
    /// `T_group_robot`.
    pub(super) members: BTreeMap<String, Pose2>,
    /// Their merged map, once it is requested; none if they are too far apart for that.
    joint: OnceCell<Option<PreparedMap>>,
}

impl MergedGroup {
    pub(super) fn new(number: u64, mut members: BTreeMap<String, Pose2>) -> Self {
        // The frame of a single robot is that of its map.
        if members.len() == 1 {
            members.values_mut().for_each(|place| *place = Pose2::identity());
        }
        Self { number, members, joint: OnceCell::new() }
    }

    pub(super) fn name(&self) -> &str {
        self.members.keys().next().map_or("", String::as_str)
    }

    /// Sort key: the larger group first, of equals the first by name.
    pub(super) fn rank(&self) -> (Reverse<usize>, &str) {
        (Reverse(self.members.len()), self.name())
    }

    /// Merged map of the group, where `map_of` returns the map of each member.
    pub(super) fn map<'a>(&'a self, map_of: impl Fn(&str) -> Option<&'a PreparedMap>) -> Option<&'a PreparedMap> {
        if self.members.len() == 1 {
            return map_of(self.name());
        }
        let joint = self.joint.get_or_init(|| {
            let maps = self.members.iter().filter_map(|(robot, place)| Some((*place, map_of(robot)?.level(0))));
            let maps: Vec<(Pose2, &Raster)> = maps.collect();
            Raster::union(&maps).map(PreparedMap::of_raster)
        });
        joint.as_ref()
    }
}

/// All groups. A robot is in one of them at most.
#[derive(Default)]
pub(super) struct Groups {
    groups: Vec<MergedGroup>,
    /// Number of the next group.
    next: u64,
}

impl Groups {
    /// Adds a group of robots with their poses. Returns its number, which is unique.
    pub(super) fn add(&mut self, members: BTreeMap<String, Pose2>) -> u64 {
        let number = self.next;
        self.next += 1;
        self.groups.push(MergedGroup::new(number, members));
        number
    }

    /// Gives a group another number and drops its merged map, as the map of a member has changed.
    pub(super) fn renew(&mut self, number: u64) {
        if let Some(index) = self.groups.iter().position(|group| group.number == number) {
            let members = self.groups.remove(index).members;
            self.add(members);
        }
    }

    /// Unites two groups, where `transform_groups` is the pose of the second in the first. Returns the number of the
    /// united group.
    pub(super) fn unite(&mut self, first: u64, second: u64, transform_groups: &Pose2) -> Option<u64> {
        let mut members = self.get(first)?.members.clone();
        let moved = self.get(second)?.members.iter();
        members.extend(moved.map(|(robot, place)| (robot.clone(), transform_groups * place)));
        self.groups.retain(|group| group.number != first && group.number != second);
        Some(self.add(members))
    }

    /// Removes robots from their groups.
    pub(super) fn leave(&mut self, robots: &[&str]) {
        let left = |group: &mut MergedGroup| robots.iter().any(|robot| group.members.contains_key(*robot));
        let groups: Vec<MergedGroup> = self.groups.extract_if(.., left).collect();
        for mut members in groups.into_iter().map(|group| group.members) {
            members.retain(|robot, _| !robots.contains(&robot.as_str()));
            if !members.is_empty() {
                self.add(members);
            }
        }
    }

    pub(super) fn get(&self, number: u64) -> Option<&MergedGroup> {
        self.groups.iter().find(|group| group.number == number)
    }

    /// Group of a robot.
    pub(super) fn of(&self, robot: &str) -> Option<&MergedGroup> {
        self.groups.iter().find(|group| group.members.contains_key(robot))
    }

    /// Numbers of all groups, in the order of their sort keys.
    pub(super) fn by_size(&self) -> Vec<u64> {
        let mut groups: Vec<&MergedGroup> = self.groups.iter().collect();
        groups.sort_by_key(|group| group.rank());
        groups.into_iter().map(|group| group.number).collect()
    }

    pub(super) fn len(&self) -> usize {
        self.groups.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::pose;

    #[test]
    fn a_robot_that_is_left_alone_is_at_the_origin_of_its_own_frame() {
        let members = |robots: &[&str]| {
            let places = robots.iter().map(|robot| ((*robot).to_owned(), pose(1.0, 2.0, 0.5)));
            MergedGroup::new(7, places.collect()).members
        };
        assert_eq!(members(&["a"])["a"], Pose2::identity());
        assert_eq!(members(&["a", "b"])["b"], pose(1.0, 2.0, 0.5));
    }

    #[test]
    fn groups_are_united_and_left() {
        let mut groups = Groups::default();
        let numbers = ["c", "a", "b"].map(|robot| groups.add(BTreeMap::from([(robot.to_owned(), Pose2::identity())])));
        let [c, a, b] = numbers;
        assert_eq!(groups.by_size(), [a, b, c]);
        let place = pose(3.0, 0.0, 1.0);
        let both = groups.unite(b, c, &place).unwrap();
        assert_eq!((groups.by_size(), groups.len()), (vec![both, a], 2));
        assert_eq!(groups.of("c").unwrap().members["c"], place);
        assert_eq!(groups.unite(b, c, &place), None, "the groups no longer exist");
        groups.leave(&["b", "a"]);
        let alone = groups.of("c").unwrap();
        assert_eq!((groups.len(), alone.members["c"]), (1, Pose2::identity()));
        let number = alone.number;
        groups.renew(number);
        assert!(groups.get(number).is_none() && groups.of("c").is_some());
    }
}
