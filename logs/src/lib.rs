//! MCAP logs and map files: the stages that read and write them, ROS 2 message definitions, maps of nav2's map server,
//! and pictures of maps.

pub mod map_file;
pub mod picture;
pub mod schemas;
pub mod sink;

use gridweave_runtime::stage::StageKind;

/// The stage kinds of this crate.
pub fn kinds() -> Vec<StageKind> {
    vec![sink::kind()]
}
