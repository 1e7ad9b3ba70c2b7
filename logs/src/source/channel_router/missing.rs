//! Warnings of messages that are expected and never come.

use super::{ChannelRouter, Route};
use crate::names::{rename_advice, scan_rename_advice};
use crate::robots::{Role, is_scan, unread_map};
use crate::schemas::full_type_name;
use crate::source::RobotMessages;
use gridweave_runtime::pipeline::list_in_words;
use gridweave_runtime::ros::{OccupancyGrid, RosMessage};
use gridweave_runtime::stage::Output;

impl ChannelRouter {
    /// The topics of occupancy grids that have been seen.
    fn grid_topics(&self) -> impl Iterator<Item = &str> {
        self.topics_of(|type_name| type_name == OccupancyGrid::NAME)
    }

    fn topics_of(&self, is_meant: fn(&str) -> bool) -> impl Iterator<Item = &str> {
        let is_meant = move |route: &&Route| is_meant(&full_type_name(&route.channel.schema_name));
        self.routes.iter().filter(is_meant).map(|route| route.channel.topic.as_str())
    }

    /// Warns of ports that are read and for which no message came.
    pub(in crate::source) fn warn_of_missing(&self, output: &Output<RobotMessages>) {
        let routed = |role: fn(Role) -> bool| {
            self.routes.iter().any(|route| role(route.role) && route.messages > route.unreadable)
        };
        let builds_maps = output.scans.is_read() && routed(|role| role == Role::Scan);
        if output.map.is_read() && !builds_maps && !self.has_one_map && !routed(|role| role == Role::Map) {
            let others = match list_in_words(self.grid_topics()) {
                topics if topics.is_empty() => topics,
                topics => format!(" (there are maps on {topics})"),
            };
            output.warn(format!("no map was found: no topic fits `{}`{others}", self.robots.map));
            let unread =
                self.routes.iter().map(|Route { channel, .. }| unread_map(&channel.topic, &channel.schema_name));
            unread.flatten().for_each(|note| output.warn(note));
        }
        let advice = rename_advice(self.grid_topics(), &self.robots.map);
        if output.map.is_read() && !builds_maps && !advice.is_empty() {
            output.warn(format!(
                "maps on topics that do not fit `{}` are not used: give {}",
                self.robots.map,
                advice.join(" ")
            ));
        }
        if output.map.is_read()
            && !routed(|role| role == Role::Map)
            // Scans that cannot be read have a warning of their own.
            && !self.routes.iter().any(|route| route.role == Role::Scan)
            && let Some(advice) = scan_rename_advice(self.topics_of(is_scan), &self.robots.scan)
        {
            let pattern = &self.robots.scan;
            output.warn(format!("scans on topics that do not fit `{pattern}` are not used: give {advice}"));
        }
        if output.pose.is_read()
            && !self.has_one_map
            && !routed(|role| matches!(role, Role::Pose(_)))
            && !self.derived.has_inferred_poses()
            && !self.derived.has_odometry()
        {
            match &self.robots.tf {
                Some(frames) => output.warn(format!(
                    "no pose was found: tf never connects `{}` to `{}`",
                    frames.base_frame, frames.map_frame
                )),
                None => output.warn(format!("no pose was found: no topic fits `{}`", self.robots.pose)),
            }
        }
        if output.tags.is_read() && !routed(|role| role == Role::Tags) && !self.derived.has_made_readings() {
            output.warn(format!("no reading of a tag was found: no topic fits `{}`", self.robots.tags));
        }
        if output.pose.is_read() && !self.derived.has_odometry() {
            self.derived.warn_of_missing_poses(output);
        }
    }
}
