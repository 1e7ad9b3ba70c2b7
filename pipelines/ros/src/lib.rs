//! ROS 2 without ROS: stages that subscribe to the topics of robots and publish results, over [Zenoh](https://zenoh.io), with the
//! protocol of the ROS 2 middleware `rmw_zenoh_cpp`.
//!
//! The binary `gridweave-ros` is the command `gridweave` with these additional kinds. A program with its own stages adds
//! [`kinds`] in the same way:
//!
//! ```no_run
//! fn main() -> std::process::ExitCode {
//!     gridweave::command_with(gridweave_ros::kinds(), gridweave_ros::bridge::on_log_warning)
//! }
//! ```
//!
//! The protocol is documented in `docs/design.md` of `rmw_zenoh`: [key expressions](key_expression) of topics, [liveliness
//! tokens](liveliness) for discovery, and [attachments](attachment) of messages.

#![forbid(unsafe_code)]

pub mod attachment;
pub mod bridge;
mod changed_part;
mod connection;
mod definitions;
mod inbox;
pub mod key_expression;
pub mod liveliness;
mod map_subscribers;
mod map_topics;
mod node;
pub mod qos;
mod robot_trees;
mod settled_frames;
pub mod sink;
pub mod source;
mod source_parameters;

use gridweave_runtime::stage::StageKind;

/// The stage kinds of this crate.
pub fn kinds() -> Vec<StageKind> {
    let ros = [source::kind(), sink::kind()];
    ros.into_iter().chain(bridge::kinds()).collect()
}
