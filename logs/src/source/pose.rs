//! Poses from the other types that hold one.

use super::route::PoseSource;
use gridweave_runtime::ros::{DecodeError, Header, Pose, PoseStamped, decode};
use serde::Deserialize;

/// The fields of `nav_msgs/msg/Odometry` up to the pose.
#[derive(Deserialize)]
struct OdometryStart {
    header: Header,
    #[serde(rename = "child_frame_id")]
    _child_frame_id: String,
    pose: Pose,
}

/// The fields of `geometry_msgs/msg/PoseWithCovarianceStamped` up to the pose.
#[derive(Deserialize)]
struct PoseWithCovarianceStart {
    header: Header,
    pose: Pose,
}

/// The pose that an encoded message of the given type holds.
pub(crate) fn to_pose_stamped(source: PoseSource, bytes: &[u8]) -> Result<PoseStamped, DecodeError> {
    match source {
        PoseSource::Odometry => decode(bytes).map(|OdometryStart { header, pose, .. }| PoseStamped { header, pose }),
        PoseSource::PoseWithCovariance => {
            decode(bytes).map(|PoseWithCovarianceStart { header, pose }| PoseStamped { header, pose })
        }
    }
}
