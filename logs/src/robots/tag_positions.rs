//! Tag positions and bearings, transformed from the sensor frame to the base frame of the robot.

use super::mounts::{Mounts, NoTransform};
use super::tag_reader::tag_of_frame;
use gridweave_runtime::ros::{Header, TFMessage, TagBearing, TagPosition, Time};
use gridweave_runtime::stage::frame_of_robot;
use nalgebra::{Point3, Vector3};
use std::collections::BTreeSet;

/// Transforms tag detections to the base frame, by the mounting poses of sensors in tf.
#[derive(Debug)]
pub(crate) struct TagPositions {
    mounts: Mounts,
    /// Robots whose tags are frames in tf.
    in_tf: BTreeSet<String>,
}

impl TagPositions {
    /// Creates a transformer for robots with the base frame `base`, or one of the usual names; the tags of the robots
    /// `in_tf` are frames in tf.
    pub(crate) fn new(base: Option<&str>, in_tf: BTreeSet<String>) -> Self {
        Self { mounts: Mounts::new(base), in_tf }
    }

    /// Sets the robots whose tags are frames in tf.
    pub(crate) fn set_robots(&mut self, in_tf: BTreeSet<String>) {
        self.in_tf = in_tf;
    }

    /// Adds transforms whose frame names lack `prefix`. Returns the tags detected in them: the robot, and the tag's
    /// position in its base frame or the lack of a transform.
    pub(crate) fn transforms(
        &mut self,
        prefix: &str,
        is_static: bool,
        message: &TFMessage,
    ) -> Vec<(String, Result<TagPosition, NoTransform>)> {
        let mut tags = Vec::new();
        for edge in &message.transforms {
            let parent = frame_of_robot(prefix, &edge.header.frame_id);
            let child = frame_of_robot(prefix, &edge.child_frame_id);
            match tag_of_frame(&child).zip(self.robot_of(&parent)) {
                Some((tag, robot)) => {
                    let at = edge.transform.translation;
                    let found = self.position(&robot, tag, edge.header.stamp, &parent, &Point3::new(at.x, at.y, at.z));
                    tags.push((robot, found));
                }
                None => {
                    self.mounts.insert(&parent, &child, &edge.transform, is_static);
                }
            }
        }
        tags
    }

    /// The robot with tags in tf that a frame belongs to.
    fn robot_of(&self, frame: &str) -> Option<String> {
        let bears =
            |robot: &&String| frame.strip_prefix(robot.as_str()).is_some_and(|rest| rest.starts_with(['/', '_']));
        self.in_tf.iter().find(bears).cloned()
    }

    /// The position, in the base frame, of a tag at `point` in a sensor frame.
    pub(crate) fn position(
        &self,
        robot: &str,
        tag_id: &str,
        stamp: Time,
        frame: &str,
        point: &Point3<f64>,
    ) -> Result<TagPosition, NoTransform> {
        let (base, transform_base_frame) = self.mounts.mount(robot, frame)?;
        let place = transform_base_frame * point;
        let header = Header { stamp, frame_id: base };
        Ok(TagPosition { header, tag_id: tag_id.to_owned(), x: place.x, y: place.y, covariance: [0.0; 4] })
    }

    /// The bearing, in the base frame, of a tag whose bearing in the sensor frame is known: an angle about the z axis
    /// of `frame`, radians, with its standard deviation.
    pub(crate) fn bearing(
        &self,
        robot: &str,
        tag_id: &str,
        stamp: Time,
        frame: &str,
        (bearing, bearing_stddev): (f64, f64),
    ) -> Result<TagBearing, NoTransform> {
        let (base, transform_base_frame) = self.mounts.mount(robot, frame)?;
        let direction = transform_base_frame * Vector3::new(bearing.cos(), bearing.sin(), 0.0);
        let sensor = transform_base_frame.translation;
        Ok(TagBearing {
            header: Header { stamp, frame_id: base },
            tag_id: tag_id.to_owned(),
            x: sensor.x,
            y: sensor.y,
            bearing: direction.y.atan2(direction.x),
            bearing_stddev,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::ros::{Transform, TransformStamped, Vector3};
    use nalgebra::UnitQuaternion;

    fn edge(parent: &str, child: &str, at: [f64; 3], rotation: UnitQuaternion<f64>) -> TransformStamped {
        let [x, y, z] = at;
        let mut transform = Transform { translation: Vector3 { x, y, z }, ..Default::default() };
        let r = rotation;
        transform.rotation = gridweave_runtime::ros::Quaternion { x: r.i, y: r.j, z: r.k, w: r.w };
        let header = Header { stamp: Time { sec: 7, nanosec: 0 }, frame_id: parent.into() };
        TransformStamped { header, child_frame_id: child.into(), transform }
    }

    /// An optical frame: z ahead, x to the right.
    fn optical() -> UnitQuaternion<f64> {
        UnitQuaternion::from_euler_angles(-std::f64::consts::FRAC_PI_2, 0.0, -std::f64::consts::FRAC_PI_2)
    }

    #[test]
    fn a_tag_ahead_of_a_camera_is_ahead_of_its_robot() {
        let mut positions = TagPositions::new(None, BTreeSet::from(["r1".to_owned()]));
        let mount = edge("base_footprint", "camera", [0.2, 0.1, 0.5], optical());
        assert!(positions.transforms("r1", true, &TFMessage { transforms: vec![mount] }).is_empty());
        // Two metres ahead of the camera, and half a metre to its right.
        let tag = edge("camera", "tag36h11:5", [0.5, 0.3, 2.0], UnitQuaternion::identity());
        let found = positions.transforms("r1", false, &TFMessage { transforms: vec![tag] });
        let [(robot, Ok(seen))] = &found[..] else { panic!("{found:?}") };
        assert_eq!(
            (robot.as_str(), seen.tag_id.as_str(), seen.header.frame_id.as_str()),
            ("r1", "tag36h11:5", "r1/base_footprint")
        );
        assert!((seen.x - 2.2).abs() < 1e-9 && (seen.y + 0.4).abs() < 1e-9 && seen.header.stamp.sec == 7, "{seen:?}");
    }

    #[test]
    fn a_bearing_turns_with_the_sensor_and_keeps_where_it_is() {
        let mut positions = TagPositions::new(None, BTreeSet::new());
        let turned = UnitQuaternion::from_euler_angles(0.0, 0.0, 1.0);
        let mount = edge("r1/base_link", "r1/antennas", [0.2, 0.1, 0.5], turned);
        positions.transforms("", true, &TFMessage { transforms: vec![mount] });
        let found = |frame: &str| positions.bearing("r1", "a", Time::default(), frame, (0.5, 0.05));
        let seen = found("r1/antennas").unwrap();
        assert_eq!(
            (seen.header.frame_id.as_str(), seen.x, seen.y, seen.bearing_stddev),
            ("r1/base_link", 0.2, 0.1, 0.05)
        );
        assert!((seen.bearing - 1.5).abs() < 1e-9, "{seen:?}");
        assert!((found("r1/base_link").unwrap().bearing - 0.5).abs() < 1e-9);
        assert_eq!(found("r1/other"), Err(NoTransform));
    }

    #[test]
    fn a_camera_that_nothing_ties_to_its_robot_sees_no_position() {
        let mut positions = TagPositions::new(Some("{robot}/body"), BTreeSet::from(["r1".to_owned()]));
        let point = Point3::new(1.0, 0.0, 0.0);
        let seen = |positions: &TagPositions| positions.position("r1", "a", Time::default(), "r1/camera", &point);
        assert_eq!(seen(&positions), Err(NoTransform));
        let mount = edge("r1/body", "r1/camera", [1.0, 0.0, 0.0], UnitQuaternion::identity());
        positions.transforms("", true, &TFMessage { transforms: vec![mount] });
        assert_eq!(seen(&positions).unwrap().x, 2.0);
        // Without tags in tf, a tag frame is like any other frame.
        let other = edge("r2/camera", "r2/tag:1", [1.0, 0.0, 0.0], UnitQuaternion::identity());
        assert!(positions.transforms("", false, &TFMessage { transforms: vec![other] }).is_empty());
    }
}
