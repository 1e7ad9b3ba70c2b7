//! The robots of a log: which channel carries what of which robot, and how poses, scans and tag readings are read.

mod channels;
mod inferred_poses;
mod mounts;
mod pose;
mod scans;
mod tag_positions;
mod tag_reader;

pub(crate) use channels::{Classified, PoseSource, RobotChannels, Role};
pub(crate) use inferred_poses::InferredPoses;
pub(crate) use mounts::NoTransform;
pub(crate) use pose::{NoPose, pose_with_covariance};
pub(crate) use scans::{Scans, read_scan};
pub(crate) use tag_positions::TagPositions;
pub(crate) use tag_reader::{Measurement, TagReader};
