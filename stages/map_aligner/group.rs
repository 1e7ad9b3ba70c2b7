//! Robots whose maps are laid together.

use super::{PreparedMap, Raster};
use crate::geometry::Pose2;
use std::cell::OnceCell;
use std::collections::BTreeMap;

/// Robots whose maps are laid together, to be searched as one map.
pub(super) struct Group {
    pub(super) number: u64,
    /// `T_group_robot`.
    pub(super) members: BTreeMap<String, Pose2>,
    /// Their maps as one, once that is asked for; none if they lie too far apart for that.
    joint: OnceCell<Option<PreparedMap>>,
}

impl Group {
    pub(super) fn new(number: u64, mut members: BTreeMap<String, Pose2>) -> Self {
        // The frame of a robot alone is that of its map.
        if members.len() == 1 {
            members.values_mut().for_each(|place| *place = Pose2::identity());
        }
        Self { number, members, joint: OnceCell::new() }
    }

    pub(super) fn name(&self) -> &str {
        self.members.keys().next().map_or("", String::as_str)
    }

    /// What its members know together, where `map_of` gives the map of each.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::pose;

    #[test]
    fn a_robot_that_is_left_alone_lies_in_its_own_frame() {
        let members = |robots: &[&str]| {
            let places = robots.iter().map(|robot| ((*robot).to_owned(), pose(1.0, 2.0, 0.5)));
            Group::new(7, places.collect()).members
        };
        assert_eq!(members(&["a"])["a"], Pose2::identity());
        assert_eq!(members(&["a", "b"])["b"], pose(1.0, 2.0, 0.5));
    }
}
