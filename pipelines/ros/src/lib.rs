//! ROS 2 without ROS: stages that take what robots publish and publish what was found, over [Zenoh](https://zenoh.io), as the ROS
//! 2 middleware `rmw_zenoh_cpp` speaks it.
//!
//! The binary `gridweave-ros` is the command `gridweave` with these kinds: `ros_source` and `ros_sink`. A program with stages of
//! its own adds [`kinds`] to them:
//!
//! ```no_run
//! fn main() -> std::process::ExitCode {
//!     gridweave::command_with(gridweave_ros::kinds(), gridweave_ros::bridge::hear)
//! }
//! ```
//!
//! What goes over the wire is written down in the `docs/design.md` of `rmw_zenoh`: [key expressions](key_expression) of topics,
//! [liveliness tokens](liveliness) by which programs know of each other, and [attachments](attachment) of messages.

#![forbid(unsafe_code)]

pub mod attachment;
mod audience;
pub mod bridge;
mod changed_part;
mod connection;
mod definitions;
mod inbox;
pub mod key_expression;
pub mod liveliness;
mod map_topics;
mod node;
mod own_trees;
pub mod qos;
mod settled_frames;
pub mod sink;
pub mod source;

use gridweave_runtime::stage::StageKind;

/// The stage kinds of this crate.
pub fn kinds() -> Vec<StageKind> {
    let ros = [source::kind(), sink::kind()];
    ros.into_iter().chain(bridge::kinds()).collect()
}
