//! Scans of lidars, transformed from the lidar frame to the base frame of the robot.

use super::mounts::{Mounts, NoTransform};
use super::point_cloud::{CloudFault, NEAREST, Slice};
use crate::schemas::full_type_name;
use gridweave_runtime::message::{Channel, LogTime};
use gridweave_runtime::ros::{
    DecodeError, Header, LaserEcho, LaserScan, MultiEchoLaserScan, PointCloud2, RangeScan, RosMessage, TFMessage,
    decode,
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

    /// Transforms a scan to the base frame, in the plane: of a point cloud, a level slice. The angles of a lidar mounted
    /// upside down run clockwise. A lidar whose [mount is unknown](Self::knows_mount) is taken to be the base.
    ///
    /// # Errors
    /// The points of the cloud cannot be read.
    pub(crate) fn to_base_frame(&self, robot: &str, scan: Scan<'_>) -> Result<RangeScan, CloudFault> {
        let lidar = scan.header().frame_id.clone();
        let (base, transform_base_lidar) = match self.set.get(robot) {
            Some(set) => {
                let [x, y, yaw, roll] = std::array::from_fn(|place| set.get(place).copied().unwrap_or(0.0));
                let rotation = UnitQuaternion::from_euler_angles(roll, 0.0, yaw);
                (lidar.clone(), Isometry3::from_parts(Translation3::new(x, y, 0.0), rotation))
            }
            None => {
                let mount = self.mounts.mount(robot, &lidar);
                mount.unwrap_or_else(|NoTransform| (lidar.clone(), Isometry3::identity()))
            }
        };
        let place = transform_base_lidar.translation;
        match scan {
            Scan::Plane(scan) => {
                let ahead = transform_base_lidar * Vector3::x();
                let is_upright = (transform_base_lidar * Vector3::z()).z >= 0.0;
                let turning = |angle: f32| if is_upright { f64::from(angle) } else { -f64::from(angle) };
                Ok(RangeScan {
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
                })
            }
            Scan::Cloud(cloud) => {
                if is_fixed(&lidar) {
                    return Err(CloudFault::Fixed(lidar));
                }
                let slice = Slice::of(&cloud, &transform_base_lidar.rotation, self.mounts.is_base(robot, &lidar))?;
                let first = LogTime::from(cloud.header.stamp).plus_seconds(slice.begin);
                Ok(RangeScan {
                    header: Header::new(first, base),
                    x: place.x,
                    y: place.y,
                    yaw: 0.0,
                    angle_min: slice.angle_min,
                    angle_increment: slice.angle_increment,
                    time_increment: slice.time_increment,
                    range_min: NEAREST,
                    range_max: f32::INFINITY,
                    ranges: slice.ranges,
                })
            }
        }
    }
}

/// Whether a frame is one that does not move with its robot, by the usual names. Points that were transformed there do
/// not show where the lidar was.
fn is_fixed(frame: &str) -> bool {
    let name = frame.rsplit(['/', '_']).next().unwrap_or(frame);
    ["odom", "map", "world"].contains(&name)
}

/// A scan in the frame of its lidar.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Scan<'a> {
    /// Of a 2D lidar.
    Plane(LaserScan),
    /// Of a 3D lidar.
    Cloud(PointCloud2<'a>),
}

impl Scan<'_> {
    /// The time, and the frame of the lidar.
    pub(crate) fn header(&self) -> &Header {
        match self {
            Self::Plane(scan) => &scan.header,
            Self::Cloud(cloud) => &cloud.header,
        }
    }
}

/// Whether a message type holds scans.
pub(crate) fn is_scan(type_name: &str) -> bool {
    [LaserScan::NAME, MultiEchoLaserScan::NAME, PointCloud2::NAME].contains(&type_name)
}

/// Reads a scan from a channel whose type [holds scans](is_scan). Of several echoes of a beam, the nearest is used: it
/// is the first obstacle.
pub(crate) fn read_scan<'a>(channel: &Channel, data: &'a [u8]) -> Result<Scan<'a>, DecodeError> {
    match &*full_type_name(&channel.schema_name) {
        LaserScan::NAME => decode(data).map(Scan::Plane),
        PointCloud2::NAME => decode(data).map(Scan::Cloud),
        _ => nearest_echoes(data).map(Scan::Plane),
    }
}

fn nearest_echoes(data: &[u8]) -> Result<LaserScan, DecodeError> {
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
    use gridweave_runtime::ros::{PointField, Quaternion, Transform, TransformStamped, encode};
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

    fn scan(frame: &str) -> Scan<'static> {
        let header = Header { frame_id: frame.into(), ..Default::default() };
        Scan::Plane(LaserScan {
            header,
            angle_min: -1.0,
            angle_increment: 0.5,
            ranges: vec![1.0, 2.0],
            ..Default::default()
        })
    }

    #[test]
    fn a_scan_is_seen_from_where_its_lidar_is_mounted() {
        let scans = scans([0.2, -0.1], UnitQuaternion::from_euler_angles(0.0, 0.0, 0.5));
        let found = scans.to_base_frame("r1", scan("r1/laser")).unwrap();
        assert_eq!((found.header.frame_id.as_str(), found.x, found.y), ("r1/base_link", 0.2, -0.1));
        assert!((found.yaw - 0.5).abs() < 1e-9, "{found:?}");
        assert_eq!((found.angle_min, found.angle_increment, found.ranges.len()), (-1.0, 0.5, 2));
    }

    #[test]
    fn a_lidar_mounted_upside_down_turns_the_other_way() {
        let scans = scans([0.0, 0.0], UnitQuaternion::from_euler_angles(PI, 0.0, 0.0));
        let found = scans.to_base_frame("r1", scan("r1/laser")).unwrap();
        assert!(found.yaw.abs() < 1e-9);
        assert_eq!((found.angle_min, found.angle_increment), (1.0, -0.5));
        let set = Scans::new(None, LidarPoses::from([("r1".to_owned(), vec![0.1, 0.0, 0.5, PI])]));
        let found = set.to_base_frame("r1", scan("r1/laser")).unwrap();
        assert!((found.yaw - 0.5).abs() < 1e-9 && found.x == 0.1);
        assert_eq!((found.angle_min, found.angle_increment), (1.0, -0.5));
    }

    #[test]
    fn a_scan_in_the_base_frame_needs_no_mount_and_a_lidar_in_an_unknown_frame_is_the_base() {
        let scans = Scans::new(None, LidarPoses::from([("r2".to_owned(), vec![0.1, -0.2, 0.5])]));
        assert!(scans.knows_mount("r1", "r1/base_footprint") && !scans.knows_mount("r1", "r1/laser"));
        assert_eq!(scans.to_base_frame("r1", scan("r1/base_footprint")).unwrap().x, 0.0);
        let found = scans.to_base_frame("r1", scan("r1/laser")).unwrap();
        assert_eq!((found.x, found.y, found.yaw, &*found.header.frame_id), (0.0, 0.0, 0.0, "r1/laser"));
        let found = scans.to_base_frame("r2", scan("r2/laser")).unwrap();
        assert!(scans.knows_mount("r2", "r2/laser"));
        assert_eq!((found.x, found.y), (0.1, -0.2));
        assert!((found.yaw - 0.5).abs() < 1e-12);
    }

    #[test]
    fn a_cloud_is_sliced_above_its_lidar_or_above_the_base_that_it_is_in() {
        let scans = scans([0.2, -0.1], UnitQuaternion::from_euler_angles(0.0, 0.0, 0.5));
        let data: Vec<u8> =
            [3.0_f32, 0.01, 0.0, 4.0, 0.01, 0.8].iter().flat_map(|number| number.to_le_bytes()).collect();
        let field = |name: &str, offset| PointField { name: name.into(), offset, datatype: 7, count: 1 };
        let cloud = |frame: &str| {
            Scan::Cloud(PointCloud2 {
                header: Header { frame_id: frame.into(), ..Default::default() },
                height: 1,
                width: 2,
                fields: vec![field("x", 0), field("y", 4), field("z", 8)],
                point_step: 12,
                row_step: 24,
                data: &data,
                ..Default::default()
            })
        };
        let measured = |frame: &str| {
            let found = scans.to_base_frame("r1", cloud(frame)).unwrap();
            let place = found.ranges.iter().position(|range| !range.is_nan()).unwrap();
            let angle = found.yaw + found.angle_min + place as f64 * found.angle_increment;
            (found.x, (10.0 * angle).round() / 10.0, (100.0 * found.ranges[place]).round())
        };
        assert_eq!(measured("r1/laser"), (0.2, 0.5, 300.0));
        assert_eq!(measured("r1/base_link"), (0.0, 0.0, 400.0));
        // Above every base frame is the same.
        assert_eq!(measured("r1/base_footprint"), (0.0, 0.0, 400.0));
        for fixed in ["r1/odom", "r1/map", "r1_odom"] {
            assert_eq!(scans.to_base_frame("r1", cloud(fixed)), Err(CloudFault::Fixed(fixed.to_owned())));
        }
        let set = Scans::new(None, LidarPoses::from([("r1".to_owned(), vec![0.1, -0.2, 0.0])]));
        let found = set.to_base_frame("r1", cloud("r1/laser")).unwrap();
        assert!(found.x == 0.1 && found.ranges.iter().any(|range| (range - 3.0).abs() < 0.01));
        // A frame that tf does not know is that of the lidar.
        assert_eq!(measured("r1/velodyne"), (0.0, 0.0, 300.0));
    }

    #[test]
    fn of_several_echoes_the_nearest_counts() {
        let beam = |echoes: &[f32]| LaserEcho { echoes: echoes.to_vec() };
        let scan = MultiEchoLaserScan { ranges: vec![beam(&[1.5, 3.0]), beam(&[])], ..Default::default() };
        let channel = |schema_name: &str| Channel { schema_name: schema_name.to_owned(), ..Default::default() };
        let scan = encode(&scan).unwrap();
        let read = read_scan(&channel("sensor_msgs/MultiEchoLaserScan"), &scan).unwrap();
        assert!(matches!(read, Scan::Plane(scan) if scan.ranges == [1.5, f32::INFINITY]));
        assert!(read_scan(&channel(LaserScan::NAME), &[0, 1, 0, 0, 7]).is_err());
    }
}
