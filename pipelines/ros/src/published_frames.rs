//! The static transforms of frames, as published.

use gridweave_runtime::ros::{RobotFrame, RobotFrames, TransformStamped};
use nalgebra::{Isometry2, Matrix3, Vector2, Vector3};
use std::collections::BTreeMap;

/// A change is more than its uncertainty if it lies outside of the region that holds the truth with a probability of
/// 0.95: the quantile of the chi-squared distribution with three degrees of freedom.
const BEYOND: f64 = 7.815;
/// Smaller differences come of rounding.
const ROUNDING: f64 = 1e-9;

/// Static transforms as published. A frame is published again only if it has moved by more than its uncertainty, because
/// subscribers have planned with it.
///
/// They are static although they change: tf2 (`StaticCache`) uses the last one for all times, and it is the estimate of a
/// frame that changes, not the frame. A transform on `/tf` would hold between stamps only, of a clock that is unknown
/// here; and no frame may be on both topics, as tf2 (`BufferCore::setTransform`) takes the kind of cache of the last
/// message and drops the other with its contents.
#[derive(Debug, Default)]
pub(crate) struct PublishedFrames {
    /// By child frame.
    published: BTreeMap<String, TransformStamped>,
    /// The covariance of (x, y, yaw), metres and radians, by child frame.
    covariances: BTreeMap<String, Matrix3<f64>>,
}

/// The change of a frame by a transform.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Change {
    /// The frame is published for the first time.
    First,
    /// It is published again.
    Moved {
        /// Metres.
        distance: f64,
        /// Radians.
        angle: f64,
    },
    /// It is not published again: it differs by no more than its uncertainty.
    WithinUncertainty,
    /// It is as published.
    Unchanged,
    /// It is not published, as the frame would get another parent.
    OtherParent { before: String },
}

impl PublishedFrames {
    /// Records the covariances of the frames of robots.
    pub(crate) fn set_covariances(&mut self, frames: &RobotFrames) {
        let groups = frames.groups.iter().flat_map(|group| &group.frames);
        let covariance = |frame: &RobotFrame| (frame.frame_id.clone(), Matrix3::from_row_slice(&frame.covariance));
        self.covariances.extend(frames.frames.iter().chain(groups).map(covariance));
    }

    /// Records a transform and returns the change of its frame.
    pub(crate) fn update(&mut self, transform: &TransformStamped) -> Change {
        let child = &transform.child_frame_id;
        let Some(published) = self.published.get(child) else {
            self.published.insert(child.clone(), transform.clone());
            return Change::First;
        };
        if published.header.frame_id != transform.header.frame_id {
            return Change::OtherParent { before: published.header.frame_id.clone() };
        }
        let moved = planar(published).inv_mul(&planar(transform));
        let (distance, angle) = (moved.translation.vector.norm(), moved.rotation.angle().abs());
        if distance < ROUNDING && angle < ROUNDING {
            return Change::Unchanged;
        }
        if !self.is_beyond(published, transform) {
            return Change::WithinUncertainty;
        }
        self.published.insert(child.clone(), transform.clone());
        Change::Moved { distance, angle }
    }

    /// All transforms as published, by child frame.
    pub(crate) fn transforms(&self) -> impl Iterator<Item = &TransformStamped> {
        self.published.values()
    }

    /// Whether a transform differs from the published one by more than its uncertainty. It does if the uncertainty is
    /// zero or unknown.
    fn is_beyond(&self, published: &TransformStamped, transform: &TransformStamped) -> bool {
        let (before, after) = (planar(published), planar(transform));
        let moved = after.translation.vector - before.translation.vector;
        let turned = before.rotation.rotation_to(&after.rotation).angle();
        let difference = Vector3::new(moved.x, moved.y, turned);
        let covariance = self.covariances.get(&transform.child_frame_id);
        let information = covariance.and_then(|covariance| covariance.cholesky());
        information.is_none_or(|information| difference.dot(&information.solve(&difference)) > BEYOND)
    }
}

fn planar(transform: &TransformStamped) -> Isometry2<f64> {
    let (at, turn) = (transform.transform.translation, transform.transform.rotation);
    let yaw = (2.0 * (turn.w * turn.z + turn.x * turn.y)).atan2(1.0 - 2.0 * (turn.y * turn.y + turn.z * turn.z));
    Isometry2::new(Vector2::new(at.x, at.y), yaw)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::ros::{Header, Quaternion, Transform, Vector3 as RosVector3};

    fn transform(parent: &str, x: f64, yaw: f64) -> TransformStamped {
        let rotation = Quaternion { z: (yaw / 2.0).sin(), w: (yaw / 2.0).cos(), ..Default::default() };
        let translation = RosVector3 { x, ..Default::default() };
        TransformStamped {
            header: Header { frame_id: parent.into(), ..Default::default() },
            child_frame_id: "robot2/map".into(),
            transform: Transform { translation, rotation },
        }
    }

    fn frames(stddev: f64, yaw_stddev: f64) -> RobotFrames {
        let (v, w) = (stddev * stddev, yaw_stddev * yaw_stddev);
        let covariance = [v, 0.0, 0.0, 0.0, v, 0.0, 0.0, 0.0, w];
        let frame = RobotFrame { frame_id: "robot2/map".into(), covariance, ..Default::default() };
        RobotFrames { frames: vec![frame], ..Default::default() }
    }

    #[test]
    fn a_frame_moves_only_by_more_than_its_uncertainty() {
        let mut published = PublishedFrames::default();
        published.set_covariances(&frames(0.1, 0.01));
        assert_eq!(published.update(&transform("world", 1.0, 0.5)), Change::First);
        assert_eq!(published.update(&transform("world", 1.0, 0.5)), Change::Unchanged);
        assert_eq!(published.update(&transform("world", 1.2, 0.5)), Change::WithinUncertainty);
        assert_eq!(published.update(&transform("world", 1.0, 0.52)), Change::WithinUncertainty);
        assert_eq!(published.transforms().next().unwrap().transform.translation.x, 1.0);
        let Change::Moved { distance, angle } = published.update(&transform("world", 1.3, 0.5)) else { panic!() };
        assert!((distance - 0.3).abs() < 1e-12 && angle < 1e-12);
        assert!(matches!(published.update(&transform("world", 1.3, 0.55)), Change::Moved { .. }));
        // The same is a change once it is more certain.
        assert_eq!(published.update(&transform("world", 1.4, 0.55)), Change::WithinUncertainty);
        published.set_covariances(&frames(0.02, 0.01));
        assert!(matches!(published.update(&transform("world", 1.4, 0.55)), Change::Moved { .. }));
    }

    #[test]
    fn turns_are_compared_across_half_a_turn() {
        let mut published = PublishedFrames::default();
        published.set_covariances(&frames(0.1, 0.01));
        published.update(&transform("world", 0.0, std::f64::consts::PI - 0.005));
        assert_eq!(
            published.update(&transform("world", 0.0, -std::f64::consts::PI + 0.005)),
            Change::WithinUncertainty
        );
    }

    #[test]
    fn a_frame_without_covariance_moves_and_none_changes_its_parent() {
        let mut published = PublishedFrames::default();
        published.update(&transform("world", 1.0, 0.0));
        assert!(matches!(published.update(&transform("world", 1.001, 0.0)), Change::Moved { .. }));
        let other = published.update(&transform("world/robot2", 1.0, 0.0));
        assert_eq!(other, Change::OtherParent { before: "world".into() });
        assert_eq!(published.transforms().count(), 1);
    }
}
