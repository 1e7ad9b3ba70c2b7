//! Laser scans, transformed from the lidar frame to the base frame of the robot.

use super::mounts::{Mounts, NoTransform};
use crate::schemas::full_type_name;
use gridweave_runtime::message::Channel;
use gridweave_runtime::ros::{
    DecodeError, Header, LaserEcho, LaserScan, MultiEchoLaserScan, RangeScan, RosMessage, TFMessage, decode,
};
use gridweave_runtime::stage::frame_of_robot;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use std::collections::BTreeMap;

/// Transforms scans to the base frame, by the mounting poses of lidars.
#[derive(Debug)]
pub(crate) struct Scans {
    mounts: Mounts,
    /// The poses of lidars on their robots that the user has set.
    set: LidarPoses,
}

/// The poses of lidars on the bases of their robots, by robot: x, y, yaw and, if it is not 0, roll; metres and radians.
pub type LidarPoses = BTreeMap<String, Vec<f64>>;

impl Scans {
    /// Creates a transformer for robots with the base frame `base`, or one of the usual names. The poses `set` take the
    /// place of those in tf.
    pub(crate) fn new(base: Option<&str>, set: LidarPoses) -> Self {
        Self { mounts: Mounts::new(base), set }
    }

    /// Adds transforms whose frame names lack `prefix`.
    pub(crate) fn transforms(&mut self, prefix: &str, is_static: bool, message: &TFMessage) {
        for edge in &message.transforms {
            let parent = frame_of_robot(prefix, &edge.header.frame_id);
            let child = frame_of_robot(prefix, &edge.child_frame_id);
            self.mounts.insert(&parent, &child, &edge.transform, is_static);
        }
    }

    /// Whether it is known where the lidar with the frame `frame` is mounted on its robot.
    pub(crate) fn knows_mount(&self, robot: &str, frame: &str) -> bool {
        self.set.contains_key(robot) || self.mounts.mount(robot, frame).is_ok()
    }

    /// Transforms a scan to the base frame, in the plane. The angles of a lidar mounted upside down run clockwise. A
    /// lidar whose [mount is unknown](Self::knows_mount) is taken to be the base.
    pub(crate) fn to_base_frame(&self, robot: &str, scan: LaserScan) -> RangeScan {
        let frame = || scan.header.frame_id.clone();
        let (base, transform_base_lidar) = match self.set.get(robot) {
            Some(set) => {
                let [x, y, yaw, roll] = std::array::from_fn(|place| set.get(place).copied().unwrap_or(0.0));
                let rotation = UnitQuaternion::from_euler_angles(roll, 0.0, yaw);
                (frame(), Isometry3::from_parts(Translation3::new(x, y, 0.0), rotation))
            }
            None => {
                let mount = self.mounts.mount(robot, &scan.header.frame_id);
                mount.unwrap_or_else(|NoTransform| (frame(), Isometry3::identity()))
            }
        };
        let ahead = transform_base_lidar * Vector3::x();
        let is_upright = (transform_base_lidar * Vector3::z()).z >= 0.0;
        let turning = |angle: f32| if is_upright { f64::from(angle) } else { -f64::from(angle) };
        let place = transform_base_lidar.translation;
        RangeScan {
            header: Header { stamp: scan.header.stamp, frame_id: base },
            x: place.x,
            y: place.y,
            yaw: ahead.y.atan2(ahead.x),
            angle_min: turning(scan.angle_min),
            angle_increment: turning(scan.angle_increment),
            time_increment: f64::from(scan.time_increment),
            range_min: scan.range_min,
            range_max: scan.range_max,
            ranges: scan.ranges,
        }
    }
}

/// Whether a message type holds scans.
pub(crate) fn is_scan(type_name: &str) -> bool {
    [LaserScan::NAME, MultiEchoLaserScan::NAME].contains(&type_name)
}

/// Reads a scan from a channel whose type [holds scans](is_scan). Of several echoes of a beam, the nearest is used: it
/// is the first obstacle.
pub(crate) fn read_scan(channel: &Channel, data: &[u8]) -> Result<LaserScan, DecodeError> {
    if full_type_name(&channel.schema_name) == LaserScan::NAME {
        return decode(data);
    }
    let scan: MultiEchoLaserScan = decode(data)?;
    let nearest = |echoes: Vec<LaserEcho>| {
        echoes.into_iter().map(|LaserEcho { echoes }| echoes.first().copied().unwrap_or(f32::INFINITY)).collect()
    };
    Ok(LaserScan {
        header: scan.header,
        angle_min: scan.angle_min,
        angle_max: scan.angle_max,
        angle_increment: scan.angle_increment,
        time_increment: scan.time_increment,
        scan_time: scan.scan_time,
        range_min: scan.range_min,
        range_max: scan.range_max,
        ranges: nearest(scan.ranges),
        intensities: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::ros::{Quaternion, Transform, TransformStamped, encode};
    use nalgebra::UnitQuaternion;
    use std::f64::consts::PI;

    fn scans(at: [f64; 2], rotation: UnitQuaternion<f64>) -> Scans {
        let mut transform = Transform::default();
        (transform.translation.x, transform.translation.y) = (at[0], at[1]);
        let r = rotation;
        transform.rotation = Quaternion { x: r.i, y: r.j, z: r.k, w: r.w };
        let header = Header { frame_id: "base_link".into(), ..Default::default() };
        let mount = TransformStamped { header, child_frame_id: "laser".into(), transform };
        let mut scans = Scans::new(None, LidarPoses::new());
        scans.transforms("r1", true, &TFMessage { transforms: vec![mount] });
        scans
    }

    fn scan(frame: &str) -> LaserScan {
        let header = Header { frame_id: frame.into(), ..Default::default() };
        LaserScan { header, angle_min: -1.0, angle_increment: 0.5, ranges: vec![1.0, 2.0], ..Default::default() }
    }

    #[test]
    fn a_scan_is_seen_from_where_its_lidar_is_mounted() {
        let scans = scans([0.2, -0.1], UnitQuaternion::from_euler_angles(0.0, 0.0, 0.5));
        let found = scans.to_base_frame("r1", scan("r1/laser"));
        assert_eq!((found.header.frame_id.as_str(), found.x, found.y), ("r1/base_link", 0.2, -0.1));
        assert!((found.yaw - 0.5).abs() < 1e-9, "{found:?}");
        assert_eq!((found.angle_min, found.angle_increment, found.ranges.len()), (-1.0, 0.5, 2));
    }

    #[test]
    fn a_lidar_mounted_upside_down_turns_the_other_way() {
        let scans = scans([0.0, 0.0], UnitQuaternion::from_euler_angles(PI, 0.0, 0.0));
        let found = scans.to_base_frame("r1", scan("r1/laser"));
        assert!(found.yaw.abs() < 1e-9);
        assert_eq!((found.angle_min, found.angle_increment), (1.0, -0.5));
        let set = Scans::new(None, LidarPoses::from([("r1".to_owned(), vec![0.1, 0.0, 0.5, PI])]));
        let found = set.to_base_frame("r1", scan("r1/laser"));
        assert!((found.yaw - 0.5).abs() < 1e-9 && found.x == 0.1);
        assert_eq!((found.angle_min, found.angle_increment), (1.0, -0.5));
    }

    #[test]
    fn a_scan_in_the_base_frame_needs_no_mount_and_a_lidar_in_an_unknown_frame_is_the_base() {
        let scans = Scans::new(None, LidarPoses::from([("r2".to_owned(), vec![0.1, -0.2, 0.5])]));
        assert!(scans.knows_mount("r1", "r1/base_footprint") && !scans.knows_mount("r1", "r1/laser"));
        assert_eq!(scans.to_base_frame("r1", scan("r1/base_footprint")).x, 0.0);
        let found = scans.to_base_frame("r1", scan("r1/laser"));
        assert_eq!((found.x, found.y, found.yaw, &*found.header.frame_id), (0.0, 0.0, 0.0, "r1/laser"));
        let found = scans.to_base_frame("r2", scan("r2/laser"));
        assert!(scans.knows_mount("r2", "r2/laser"));
        assert_eq!((found.x, found.y), (0.1, -0.2));
        assert!((found.yaw - 0.5).abs() < 1e-12);
    }

    #[test]
    fn of_several_echoes_the_nearest_counts() {
        let beam = |echoes: &[f32]| LaserEcho { echoes: echoes.to_vec() };
        let scan = MultiEchoLaserScan { ranges: vec![beam(&[1.5, 3.0]), beam(&[])], ..Default::default() };
        let channel = |schema_name: &str| Channel { schema_name: schema_name.to_owned(), ..Default::default() };
        let read = read_scan(&channel("sensor_msgs/MultiEchoLaserScan"), &encode(&scan).unwrap()).unwrap();
        assert_eq!(read.ranges, [1.5, f32::INFINITY]);
        assert!(read_scan(&channel(LaserScan::NAME), &[0, 1, 0, 0, 7]).is_err());
    }
}
