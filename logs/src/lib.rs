//! MCAP logs and map files: the stages that read and write them, ROS 2 message definitions, what a log holds, maps of
//! nav2's map server, and pictures of maps.

pub mod dynamic;
pub mod info;
pub mod map_file;
pub mod picture;
mod qos;
pub mod reader;
pub mod schemas;
pub mod sink;
pub mod source;
pub mod tf;

#[cfg(test)]
mod test_log;

use gridweave_runtime::stage::StageKind;

/// The stage kinds of this crate.
pub fn kinds() -> Vec<StageKind> {
    vec![sink::kind(), source::kind(), source::live_kind(), source::map_file::kind()]
}
