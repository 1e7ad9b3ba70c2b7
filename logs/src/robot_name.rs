//! Names of robots.

use gridweave_runtime::message::LONGEST_ROBOT_NAME;

/// Whether the name of a robot fits in the header of a message, where a zero byte ends it.
pub(crate) fn fits(robot: &str) -> bool {
    robot.len() <= LONGEST_ROBOT_NAME && !robot.contains('\0')
}
