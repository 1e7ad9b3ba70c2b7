//! The robots of a log: which channel carries what of which robot, and how poses, scans and tag readings are read.

mod cell_values;
mod channel_patterns;
mod channels;
mod driver_topics;
mod inferred_poses;
mod merged_maps;
mod mixed_frames;
mod mounts;
mod other_maps;
mod peculiarities;
mod point_cloud;
mod pose;
mod poses_in_map;
mod role;
mod scan_topics;
mod scans;
mod tag_positions;
mod tag_reader;
mod tilt;
mod units;

pub use cell_values::CellValues;
pub(crate) use channels::RobotChannels;
pub(crate) use inferred_poses::InferredPoses;
pub(crate) use merged_maps::{MapOrigin, MergedMaps, doubtful, is_merger, left_out};
pub(crate) use mixed_frames::{MixedFrames, problem_of_frames};
pub(crate) use mounts::NoTransform;
pub(crate) use other_maps::unread_map;
pub(crate) use peculiarities::{Peculiarity, peculiarities};
pub(crate) use pose::{NoPose, pose_with_covariance};
pub(crate) use poses_in_map::PosesInMap;
pub(crate) use role::{Classified, PoseSource, Role};
pub use scans::LidarPoses;
pub(crate) use scans::{Scans, is_scan, read_scan};
pub(crate) use tag_positions::TagPositions;
pub(crate) use tag_reader::{Measurement, TagReader};
pub(crate) use units::{TagRanges, unit_of_map};
