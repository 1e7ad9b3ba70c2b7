//! Poses read from every message type that contains one.

use super::role::PoseSource;
use gridweave_runtime::ros::{Header, PoseStamped, PoseWithCovariance, PoseWithCovarianceStamped, decode, encode};
use serde::Deserialize;
use std::borrow::Cow;

/// The leading fields of `nav_msgs/msg/Odometry`, up to the pose.
#[derive(Deserialize)]
struct OdometryStart {
    header: Header,
    #[serde(rename = "child_frame_id")]
    _child_frame_id: String,
    pose: PoseWithCovariance,
}

/// The message cannot be read as a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct NotAPose;

/// Converts an encoded message of the given type to an encoded [`PoseWithCovarianceStamped`]. The covariance is zero if
/// the type has none.
pub(crate) fn pose_with_covariance(source: PoseSource, bytes: &[u8]) -> Result<Cow<'_, [u8]>, NotAPose> {
    let pose = match source {
        PoseSource::Pose => decode::<PoseStamped>(bytes).map_err(|_| NotAPose)?.into(),
        PoseSource::PoseWithCovariance => {
            return decode::<PoseWithCovarianceStamped>(bytes).map(|_| Cow::Borrowed(bytes)).map_err(|_| NotAPose);
        }
        PoseSource::Odometry => {
            let OdometryStart { header, pose, .. } = decode(bytes).map_err(|_| NotAPose)?;
            PoseWithCovarianceStamped { header, pose }
        }
    };
    encode(&pose).map(Cow::Owned).map_err(|_| NotAPose)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::message::LogTime;
    use gridweave_runtime::ros::{Odometry, Point, Pose};

    #[test]
    fn a_pose_with_zeros_behind_it_is_a_pose_with_covariance() {
        for length in 0..20 {
            let header = Header::new(LogTime(123_456_789_012), "f".repeat(length));
            let position = Point { x: 1.5, y: -2.5, z: 3.5 };
            let stamped = PoseStamped { header, pose: Pose { position, ..Default::default() } };
            let bytes = encode(&stamped).unwrap();
            let made = pose_with_covariance(PoseSource::Pose, &bytes).unwrap();
            assert_eq!(made, encode(&PoseWithCovarianceStamped::from(stamped)).unwrap());
            let padded = [bytes.as_slice(), &[7; 4]].concat();
            assert_eq!(pose_with_covariance(PoseSource::Pose, &padded).unwrap(), made, "trailing bytes are ignored");
        }
    }

    #[test]
    fn the_other_byte_order_is_read() {
        // A stamp of 1.2 s, the frame "m", and the numbers 1 to 7.
        let mut bytes = vec![0, 0, 0, 0, 0, 0, 0, 1, 11, 235, 194, 0, 0, 0, 0, 2, b'm', 0, 0, 0];
        (1..=7).for_each(|number| bytes.extend_from_slice(&f64::from(number).to_be_bytes()));
        let made = pose_with_covariance(PoseSource::Pose, &bytes).unwrap();
        let made: PoseWithCovarianceStamped = decode(&made).unwrap();
        assert_eq!(made, decode::<PoseStamped>(&bytes).unwrap().into());
        assert_eq!((made.header.frame_id.as_str(), made.pose.pose.position.y), ("m", 2.0));
    }

    #[test]
    fn a_message_that_is_cut_is_no_pose() {
        let pose = encode(&PoseStamped { header: Header::new(LogTime(1), "map"), ..Default::default() }).unwrap();
        let with_covariance = encode(&PoseWithCovarianceStamped::default()).unwrap();
        let odometry = encode(&Odometry::default()).unwrap();
        // After the pose, odometry has a twist of 6 + 36 numbers, which is not read.
        for (source, bytes, least) in [
            (PoseSource::Pose, &pose, pose.len()),
            (PoseSource::PoseWithCovariance, &with_covariance, with_covariance.len()),
            (PoseSource::Odometry, &odometry, odometry.len() - 42 * 8),
        ] {
            for length in 0..=bytes.len() {
                let made = pose_with_covariance(source, &bytes[..length]);
                assert_eq!(made.is_ok(), length >= least, "{source:?} {length}");
            }
        }
        let mut endless = pose.clone();
        endless[12..16].copy_from_slice(&[0xff; 4]);
        assert_eq!(pose_with_covariance(PoseSource::Pose, &endless), Err(NotAPose));
        endless[0] = 9;
        assert_eq!(pose_with_covariance(PoseSource::Pose, &endless), Err(NotAPose));
    }
}
