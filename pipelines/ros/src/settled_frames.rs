//! Frames that stay where they were said to be until it is known better.

use gridweave_runtime::ros::{RobotFrame, RobotFrames, TransformStamped};
use nalgebra::{Isometry2, Matrix3, Vector2, Vector3};
use std::collections::BTreeMap;

/// A change is more than its uncertainty if it lies outside of the region that holds the truth with a probability of
/// 0.95: the quantile of the chi-squared distribution with three degrees of freedom.
const BEYOND: f64 = 7.815;
/// Smaller differences come of rounding.
const ROUNDING: f64 = 1e-9;

/// Static transforms as they were told to others. Whoever listens has planned with them, and so they change only where
/// that is better by more than its uncertainty.
///
/// They are static although they change: tf2 (`StaticCache`) holds the last one for all times, and what changes is not
/// where a frame lies but what is known of it. On `/tf` one would hold between stamps only, of whose clock nothing is
/// known here; and no frame may be on both, as tf2 (`BufferCore::setTransform`) takes the kind of cache of the last
/// message and drops the other with all it holds.
#[derive(Debug, Default)]
pub(crate) struct SettledFrames {
    /// By child frame.
    told: BTreeMap<String, TransformStamped>,
    /// How certain it is where frames lie: the covariance of (x, y, yaw), by child frame.
    covariances: BTreeMap<String, Matrix3<f64>>,
}

/// What becomes of a transform.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Change {
    /// It is told for the first time.
    First,
    /// It is told anew: the frame has moved so far (metres) and turned so far (radians).
    Moved { distance: f64, angle: f64 },
    /// It is not told: it differs by no more than it is uncertain.
    Held,
    /// It is as it was told.
    Same,
    /// It is not told, as the frame would get another parent.
    OtherParent { before: String },
}

impl SettledFrames {
    /// Takes up how certain it is where the frames of robots lie.
    pub(crate) fn learn(&mut self, frames: &RobotFrames) {
        let groups = frames.groups.iter().flat_map(|group| &group.frames);
        let covariance = |frame: &RobotFrame| (frame.frame_id.clone(), Matrix3::from_row_slice(&frame.covariance));
        self.covariances.extend(frames.frames.iter().chain(groups).map(covariance));
    }

    /// Takes up a transform, and says what becomes of it.
    pub(crate) fn update(&mut self, transform: &TransformStamped) -> Change {
        let child = &transform.child_frame_id;
        let Some(told) = self.told.get(child) else {
            self.told.insert(child.clone(), transform.clone());
            return Change::First;
        };
        if told.header.frame_id != transform.header.frame_id {
            return Change::OtherParent { before: told.header.frame_id.clone() };
        }
        let moved = planar(told).inv_mul(&planar(transform));
        let (distance, angle) = (moved.translation.vector.norm(), moved.rotation.angle().abs());
        if distance < ROUNDING && angle < ROUNDING {
            return Change::Same;
        }
        if !self.is_beyond(told, transform) {
            return Change::Held;
        }
        self.told.insert(child.clone(), transform.clone());
        Change::Moved { distance, angle }
    }

    /// All transforms as they are told, by child frame.
    pub(crate) fn told(&self) -> impl Iterator<Item = &TransformStamped> {
        self.told.values()
    }

    /// Whether a transform differs from what was told by more than its uncertainty. What is certain, or of which
    /// nothing is known, does.
    fn is_beyond(&self, told: &TransformStamped, transform: &TransformStamped) -> bool {
        let (before, after) = (planar(told), planar(transform));
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
        let mut settled = SettledFrames::default();
        settled.learn(&frames(0.1, 0.01));
        assert_eq!(settled.update(&transform("world", 1.0, 0.5)), Change::First);
        assert_eq!(settled.update(&transform("world", 1.0, 0.5)), Change::Same);
        assert_eq!(settled.update(&transform("world", 1.2, 0.5)), Change::Held);
        assert_eq!(settled.update(&transform("world", 1.0, 0.52)), Change::Held);
        assert_eq!(settled.told().next().unwrap().transform.translation.x, 1.0);
        let Change::Moved { distance, angle } = settled.update(&transform("world", 1.3, 0.5)) else { panic!() };
        assert!((distance - 0.3).abs() < 1e-12 && angle < 1e-12);
        assert!(matches!(settled.update(&transform("world", 1.3, 0.55)), Change::Moved { .. }));
        // The same is a change once it is more certain.
        assert_eq!(settled.update(&transform("world", 1.4, 0.55)), Change::Held);
        settled.learn(&frames(0.02, 0.01));
        assert!(matches!(settled.update(&transform("world", 1.4, 0.55)), Change::Moved { .. }));
    }

    #[test]
    fn turns_are_compared_across_half_a_turn() {
        let mut settled = SettledFrames::default();
        settled.learn(&frames(0.1, 0.01));
        settled.update(&transform("world", 0.0, std::f64::consts::PI - 0.005));
        assert_eq!(settled.update(&transform("world", 0.0, -std::f64::consts::PI + 0.005)), Change::Held);
    }

    #[test]
    fn a_frame_without_covariance_moves_and_none_changes_its_parent() {
        let mut settled = SettledFrames::default();
        settled.update(&transform("world", 1.0, 0.0));
        assert!(matches!(settled.update(&transform("world", 1.001, 0.0)), Change::Moved { .. }));
        let other = settled.update(&transform("world/robot2", 1.0, 0.0));
        assert_eq!(other, Change::OtherParent { before: "world".into() });
        assert_eq!(settled.told().count(), 1);
    }
}
