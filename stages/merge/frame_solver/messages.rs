//! The solution as messages.

use super::UncertainPose;
use super::solution::{Alignments, PlacedGroup, Solution};
use crate::shared::geometry::row_by_row;
use crate::shared::robot_pair::RobotPair;
use gridweave_runtime::ros::{Alignment, Header, RobotFrame, RobotFrames, RobotGroup, UnmergedRobot, Verdict};
use gridweave_runtime::stage::frame_of_robot;
use std::collections::BTreeMap;

/// Poses of the robots' maps. `frame_ids` are the names of the map frames of robots that have sent a map.
pub(super) fn robot_frames(
    solution: &Solution,
    header: Header,
    reference: String,
    frame_ids: &BTreeMap<String, String>,
) -> RobotFrames {
    let frame = |(robot, pose): (&String, &UncertainPose)| RobotFrame {
        robot: robot.clone(),
        frame_id: frame_ids.get(robot).cloned().unwrap_or_else(|| prefixed(robot, "")),
        x: pose.pose.translation.x,
        y: pose.pose.translation.y,
        yaw: pose.pose.rotation.angle(),
        covariance: row_by_row(&pose.covariance),
    };
    let group = |group: &PlacedGroup| RobotGroup {
        reference: group.reference.clone(),
        frame_id: format!("{}/{}", RobotFrames::WORLD, group.reference),
        frames: group.frames.iter().map(frame).collect(),
    };
    let unmerged = solution.unmerged.iter();
    let unmerged = unmerged.map(|(robot, reason)| UnmergedRobot { robot: robot.clone(), reason: reason.clone() });
    RobotFrames {
        header,
        reference,
        frames: solution.frames.iter().map(frame).collect(),
        unmerged: unmerged.collect(),
        groups: solution.groups.iter().map(group).collect(),
    }
}

/// Verdicts on all alignments.
pub(super) fn verdicts(solution: &Solution, alignments: &Alignments) -> Vec<Verdict> {
    let unchecked = solution.unchecked();
    let verdict = |(pair, alignment): (&RobotPair, &Alignment)| {
        let mut alignment = alignment.clone();
        if let Some(reason) = solution.left_out.get(pair) {
            alignment.accepted = false;
            alignment.reason.clone_from(reason);
        }
        Verdict { alignment, checked: solution.used.contains_key(pair) && !unchecked.contains(pair) }
    };
    alignments.iter().map(verdict).collect()
}

/// Replaces the poses of robots in `frames` by those in `sent`. Both are sorted by name.
pub(super) fn hold(frames: &mut [RobotFrame], sent: &[RobotFrame]) {
    for frame in frames {
        if let Ok(place) = sent.binary_search_by(|sent| sent.robot.cmp(&frame.robot)) {
            let RobotFrame { x, y, yaw, .. } = sent[place];
            (frame.x, frame.y, frame.yaw) = (x, y, yaw);
        }
    }
}

/// Whether two messages are equal up to their times and covariances.
pub(super) fn is_same(one: &RobotFrames, other: &RobotFrames) -> bool {
    let place = |frame: &RobotFrame| RobotFrame { covariance: [0.0; 9], ..frame.clone() };
    let same = |one: &[RobotFrame], other: &[RobotFrame]| one.iter().map(place).eq(other.iter().map(place));
    let same_group =
        |(one, other): (&RobotGroup, &RobotGroup)| one.reference == other.reference && same(&one.frames, &other.frames);
    one.reference == other.reference
        && one.unmerged == other.unmerged
        && same(&one.frames, &other.frames)
        && one.groups.len() == other.groups.len()
        && one.groups.iter().zip(&other.groups).all(same_group)
}

/// Name of a robot's map frame in a tree of frames that holds all robots: `map` becomes `robot1/map`.
pub(super) fn prefixed(robot: &str, frame_id: &str) -> String {
    let frame_id = if frame_id.trim_start_matches('/').is_empty() { "map" } else { frame_id };
    frame_of_robot(robot, frame_id).into_owned()
}
