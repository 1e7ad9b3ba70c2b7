//! ROS 2 without ROS: stages that subscribe to the topics of robots and publish results, over DDS, the default
//! middleware of ROS 2, and over [Zenoh](https://zenoh.io) with the protocol of `rmw_zenoh_cpp`.
//!
//! The binary `gridweave-ros` is the command `gridweave` with these additional kinds. A program with its own stages
//! adds [`kinds`] in the same way:
//!
//! ```no_run
//! fn main() -> std::process::ExitCode {
//!     gridweave::shipped::ship(gridweave_ros::PIPELINES);
//!     gridweave::command_with(gridweave_ros::kinds(), &[gridweave_ros::doctor()], gridweave_bridge::on_log_warning)
//! }
//! ```
//!
//! The protocol of DDS is DDSI-RTPS. That of Zenoh is documented in `docs/design.md` of `rmw_zenoh`: [key
//! expressions](key_expression) of topics, [liveliness tokens](liveliness) for discovery, and [attachments](attachment)
//! of messages.

#![forbid(unsafe_code)]

mod advice;
pub mod attachment;
mod changed_part;
mod connection;
mod dds_graph;
mod dds_names;
mod dds_node;
mod definitions;
mod discovery;
mod discovery_range;
mod doctor;
mod inbox;
pub mod key_expression;
pub mod liveliness;
mod map_subscribers;
mod map_topics;
mod middleware;
mod node;
mod other_runs;
mod published_frames;
pub mod qos;
mod robot_trees;
pub mod ros_arguments;
mod rtps;
pub mod sink;
pub mod source;
mod source_parameters;
mod zenoh_node;
mod zenoh_without_hash;

pub use doctor::doctor;
use gridweave::shipped::Shipped;
use gridweave_runtime::stage::StageKind;

/// The pipelines that ship with these kinds.
pub const PIPELINES: &[Shipped] = &[
    Shipped {
        name: "live_ros",
        what: "merge the maps of robots that run ROS 2 while they explore, and publish the merged map there",
        text: include_str!("../live_ros.toml"),
    },
    Shipped {
        name: "live_ros_scans",
        what: "the same, where some robots publish scans of their lidars and no map",
        text: include_str!("../live_ros_scans.toml"),
    },
];

/// The stage kinds for ROS 2 and of the bridge between machines.
pub fn kinds() -> Vec<StageKind> {
    let ros = [source::kind(), sink::kind()];
    ros.into_iter().chain(gridweave_bridge::kinds()).collect()
}
