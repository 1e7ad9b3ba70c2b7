//! `geometry_msgs` and `tf2_msgs`.

use super::{Header, ros_messages};
use nalgebra::{Isometry2, Vector2};
use serde::{Deserialize, Serialize};

/// `geometry_msgs/msg/Point`, metres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct Point {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

/// `geometry_msgs/msg/Vector3`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct Vector3 {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

/// `geometry_msgs/msg/Quaternion`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct Quaternion {
    pub x: f64,
    pub y: f64,
    pub z: f64,
    pub w: f64,
}

impl Default for Quaternion {
    fn default() -> Self {
        Self::from_yaw(0.0)
    }
}

impl Quaternion {
    /// The rotation about the vertical axis by `yaw` radians.
    pub fn from_yaw(yaw: f64) -> Self {
        Self { x: 0.0, y: 0.0, z: (yaw / 2.0).sin(), w: (yaw / 2.0).cos() }
    }

    /// The rotation about the vertical axis, radians in `(-pi, pi]`, whatever the norm. It is 0 for four zeros, which
    /// many programs write for "no rotation", and not a number for others whose norm is too small or too large to be
    /// computed.
    pub fn yaw(&self) -> f64 {
        let Self { x, y, z, w } = *self;
        if !(w * w + x * x + y * y + z * z).is_normal() && [x, y, z, w] != [0.0; 4] {
            return f64::NAN;
        }
        let sine = 2.0 * (self.w * self.z + self.x * self.y);
        let cosine = self.w * self.w + self.x * self.x - self.y * self.y - self.z * self.z;
        sine.atan2(cosine)
    }
}

/// `geometry_msgs/msg/Pose`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct Pose {
    pub position: Point,
    pub orientation: Quaternion,
}

impl Pose {
    /// The pose in the plane: height, roll and pitch are ignored.
    pub fn planar(&self) -> Isometry2<f64> {
        Isometry2::new(Vector2::new(self.position.x, self.position.y), self.orientation.yaw())
    }
}

impl From<Isometry2<f64>> for Pose {
    fn from(pose: Isometry2<f64>) -> Self {
        Self {
            position: Point { x: pose.translation.x, y: pose.translation.y, z: 0.0 },
            orientation: Quaternion::from_yaw(pose.rotation.angle()),
        }
    }
}

/// `geometry_msgs/msg/PoseStamped`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct PoseStamped {
    pub header: Header,
    pub pose: Pose,
}

/// `geometry_msgs/msg/PoseWithCovariance`. The covariance is 6 x 6, row by row, over (x, y, z, roll, pitch, yaw).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseWithCovariance {
    /// The pose.
    pub pose: Pose,
    /// Six rows of six.
    pub covariance: [[f64; 6]; 6],
}

/// `geometry_msgs/msg/PoseWithCovarianceStamped`. A covariance of zeros only means that it is unknown.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct PoseWithCovarianceStamped {
    pub header: Header,
    pub pose: PoseWithCovariance,
}

impl From<PoseStamped> for PoseWithCovarianceStamped {
    /// The pose with an unknown covariance.
    fn from(PoseStamped { header, pose }: PoseStamped) -> Self {
        Self { header, pose: PoseWithCovariance { pose, ..Default::default() } }
    }
}

/// `geometry_msgs/msg/Transform`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct Transform {
    pub translation: Vector3,
    pub rotation: Quaternion,
}

impl Transform {
    /// The transform in the plane: height, roll and pitch are ignored.
    pub fn planar(&self) -> Isometry2<f64> {
        Isometry2::new(Vector2::new(self.translation.x, self.translation.y), self.rotation.yaw())
    }
}

impl From<Isometry2<f64>> for Transform {
    fn from(transform: Isometry2<f64>) -> Self {
        Self {
            translation: Vector3 { x: transform.translation.x, y: transform.translation.y, z: 0.0 },
            rotation: Quaternion::from_yaw(transform.rotation.angle()),
        }
    }
}

/// `geometry_msgs/msg/TransformStamped`: the pose of `child_frame_id` in `header.frame_id`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct TransformStamped {
    pub header: Header,
    pub child_frame_id: String,
    pub transform: Transform,
}

/// `tf2_msgs/msg/TFMessage`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct TFMessage {
    pub transforms: Vec<TransformStamped>,
}

ros_messages!("geometry_msgs": PoseStamped, PoseWithCovarianceStamped);
ros_messages!("tf2_msgs": TFMessage);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_yaw_of_a_scaled_quaternion_is_that_of_the_whole_and_one_beyond_all_scales_has_none() {
        let Quaternion { x, y, z, w } = Quaternion::from_yaw(0.7);
        let scaled = |by: f64| Quaternion { x: by * x, y: by * y, z: by * z, w: by * w }.yaw();
        for by in [1e-9, 0.5, 1.0, 7.0, 1e9] {
            assert!((scaled(by) - 0.7).abs() < 1e-12, "{by}");
        }
        assert_eq!(scaled(0.0), 0.0);
        assert!([1e-170, 1e-200, 1e200, f64::NAN].into_iter().all(|by| scaled(by).is_nan()));
    }
}
