//! Poses in another frame than that of the robot's map, transformed to it by tf.

use super::channels::RobotChannels;
use crate::tf::{self, FrameTree, isometry};
use gridweave_runtime::ros::{
    Header, Point, Pose, PoseWithCovarianceStamped, TFMessage, Transform, Vector3, decode, encode,
};
use gridweave_runtime::stage::frame_of_robot;
use nalgebra::Matrix6;
use std::collections::BTreeMap;

/// Transforms the poses on pose topics to the frames of the robots' maps.
#[derive(Debug, Default)]
pub(crate) struct PosesInMap {
    tree: FrameTree,
    /// The robots with maps and a pose topic, and the frames of their maps once they are known.
    map_frames: BTreeMap<String, Option<String>>,
}

impl PosesInMap {
    /// Sets the robots: those with maps and a pose topic. Known frames are kept.
    pub(crate) fn set_channels(&mut self, channels: &RobotChannels) {
        let mut known = std::mem::take(&mut self.map_frames);
        let with_frame = channels.mapped_and_posed().map(|robot| (robot.to_owned(), known.remove(robot).flatten()));
        self.map_frames = with_frame.collect();
    }

    /// Whether there are robots with maps and a pose topic.
    pub(crate) fn has_robots(&self) -> bool {
        !self.map_frames.is_empty()
    }

    /// Whether the frame of a robot's map is needed and not known.
    pub(crate) fn asks_for_map(&self, robot: &str) -> bool {
        self.map_frames.get(robot).is_some_and(Option::is_none)
    }

    /// Sets the frame of a robot's map.
    pub(crate) fn set_map_frame(&mut self, robot: &str, frame: &str) {
        if let Some(known) = self.map_frames.get_mut(robot).filter(|_| !frame.is_empty()) {
            *known = Some(frame.to_owned());
        }
    }

    /// Adds transforms whose frame names lack `prefix`.
    pub(crate) fn transforms(&mut self, prefix: &str, is_static: bool, message: &TFMessage) {
        if !self.has_robots() {
            return;
        }
        for edge in &message.transforms {
            let parent = frame_of_robot(prefix, &edge.header.frame_id);
            let child = frame_of_robot(prefix, &edge.child_frame_id);
            self.tree.insert(&parent, &child, &edge.transform, is_static);
        }
    }

    /// An encoded pose, transformed to the frame of the robot's map; `None` if it is in it, or if tf does not connect
    /// the two.
    pub(crate) fn in_map(&self, robot: &str, pose: &[u8]) -> Option<Vec<u8>> {
        let map = self.map_frames.get(robot)?.as_ref()?;
        let Header { frame_id, .. } = decode(pose).ok()?;
        if frame_id == *map || frame_id.is_empty() {
            return None;
        }
        let transform_map_frame = self.tree.lookup(map, &frame_id)?;
        let PoseWithCovarianceStamped { mut header, mut pose } = decode(pose).ok()?;
        header.frame_id.clone_from(map);
        let Pose { position: Point { x, y, z }, orientation: rotation } = pose.pose;
        let in_frame = isometry(&Transform { translation: Vector3 { x, y, z }, rotation })?;
        pose.pose = tf::pose(&(transform_map_frame * in_frame));
        let rotation = transform_map_frame.rotation.to_rotation_matrix();
        let mut turn = Matrix6::zeros();
        for block in [0, 3] {
            turn.fixed_view_mut::<3, 3>(block, block).copy_from(rotation.matrix());
        }
        let covariance = Matrix6::from_fn(|row, column| pose.covariance[row][column]);
        // A pose without covariance has zeros, which stay zeros.
        let turned = turn * covariance * turn.transpose();
        pose.covariance = std::array::from_fn(|row| std::array::from_fn(|column| turned[(row, column)]));
        encode(&PoseWithCovarianceStamped { header, pose }).ok()
    }
}
