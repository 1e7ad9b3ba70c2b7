//! MCAP logs and map files: the stages that read and write them, ROS 2 message definitions, the contents of logs, maps
//! of nav2's map server, pictures of maps, and summaries of merges.

pub mod bag;
pub mod browsers;
pub mod drawing;
pub mod dynamic;
pub mod file;
#[cfg(feature = "foxglove")]
pub mod foxglove;
pub mod info;
pub mod map_file;
pub mod names;
mod one_map;
mod os_error;
pub mod picture;
pub mod qos;
pub mod reader;
mod robot_name;
mod robots;
pub mod schemas;
pub mod sink;
pub mod source;
pub mod summary;
pub mod temporary;
pub mod tf;
pub mod truth;
mod yaml;

#[cfg(test)]
mod test_log;

use gridweave_runtime::stage::StageKind;

/// The stage kinds of this crate.
pub fn kinds() -> Vec<StageKind> {
    vec![
        #[cfg(feature = "foxglove")]
        foxglove::kind(),
        map_file::kind(),
        picture::kind(),
        sink::kind(),
        source::kind(),
        source::live_kind(),
        source::map_file::kind(),
        source::topology_file::kind(),
        summary::kind(),
        truth::kind(),
    ]
}
