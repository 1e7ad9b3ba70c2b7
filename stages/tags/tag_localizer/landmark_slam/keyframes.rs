//! The odometry of a robot by keyframes, with its readings of tags.

use super::super::measured::Measured;
use super::step::OdometryStep;
use crate::shared::geometry::{Pose2, wrap_angle};
use gridweave_runtime::message::LogTime;
use std::collections::BTreeMap;

/// Largest number of keyframes. Beyond it every other one is dropped.
const MOST_KEYFRAMES: usize = 500;
/// Turn after which there is a keyframe, radians.
const TURN: f64 = 0.35;
/// Largest number of readings of one tag and one kind at a keyframe: the errors of more are correlated.
const MOST_AT_ONE: u8 = 8;

/// A pose of the odometry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Keyframe {
    /// When the robot was there.
    pub(super) time: LogTime,
    /// As the odometry has it.
    pub(super) odometry: Pose2,
    /// From the keyframe before it.
    pub(super) step: OdometryStep,
}

/// A reading of a tag.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct KeyframeReading {
    /// The keyframe before it.
    pub(super) keyframe: usize,
    /// The number of its tag.
    pub(super) tag: usize,
    /// Pose of the robot in the keyframe.
    pub(super) offset: Pose2,
    /// What was measured.
    pub(super) measured: Measured,
    /// Standard deviation of a distance or a position, metres.
    pub(super) stddev: f64,
}

/// The odometry of a robot by keyframes, with the readings of tags at each.
#[derive(Clone, Debug)]
pub(in super::super) struct Keyframes {
    pub(super) keyframes: Vec<Keyframe>,
    /// By keyframe.
    pub(super) readings: Vec<KeyframeReading>,
    /// Number of each tag, by its id.
    pub(super) tags: BTreeMap<String, usize>,
    /// Readings of each tag and kind at the last keyframe.
    at_last: BTreeMap<(usize, u8), u8>,
    /// Metres between keyframes.
    spacing: f64,
    /// Radians between keyframes.
    turn: f64,
    /// The last pose, and the step to it from the last keyframe.
    last: Option<(Pose2, OdometryStep)>,
}

impl Keyframes {
    /// A drive with a keyframe each `spacing` metres, where tags are read.
    pub(in super::super) fn new(spacing: f64) -> Self {
        Self {
            keyframes: Vec::new(),
            readings: Vec::new(),
            tags: BTreeMap::new(),
            at_last: BTreeMap::new(),
            spacing,
            turn: TURN,
            last: None,
        }
    }

    /// Adds a pose of the odometry.
    pub(in super::super) fn add_pose(&mut self, time: LogTime, pose: &Pose2) {
        let Some((last, since)) = &mut self.last else {
            // The first pose fixes the frame.
            self.keyframes.push(Keyframe { time, odometry: *pose, step: OdometryStep::none() });
            self.last = Some((*pose, OdometryStep::none()));
            return;
        };
        *since = since.then(&OdometryStep::short(last.inv_mul(pose)));
        *last = *pose;
        if since.way >= self.spacing || since.turned >= self.turn {
            self.keyframes.push(Keyframe { time, odometry: *pose, step: *since });
            *since = OdometryStep::none();
            self.at_last.clear();
            if self.keyframes.len() > MOST_KEYFRAMES {
                self.thin_out();
            }
        }
    }

    /// Adds a reading of a tag at a pose of the odometry.
    pub(in super::super) fn add_reading(&mut self, pose: &Pose2, id: &str, measured: Measured, stddev: f64) {
        if self.keyframes.is_empty() {
            return;
        }
        let next = self.tags.len();
        let tag = match self.tags.get(id) {
            Some(&tag) => tag,
            None => *self.tags.entry(id.to_owned()).or_insert(next),
        };
        let keyframe = self.keyframes.len() - 1;
        let read = self.at_last.entry((tag, measured.kind())).or_insert(0);
        if *read < MOST_AT_ONE {
            *read += 1;
            let offset = self.keyframes[keyframe].odometry.inv_mul(pose);
            self.readings.push(KeyframeReading { keyframe, tag, offset, measured, stddev });
        }
    }

    /// Drops every other keyframe; its readings belong to the one before it, and the step to it to the one after it.
    fn thin_out(&mut self) {
        (self.spacing, self.turn) = (2.0 * self.spacing, 2.0 * self.turn);
        for reading in &mut self.readings {
            let (before, own) = (reading.keyframe & !1, reading.keyframe);
            let between = self.keyframes[before].odometry.inv_mul(&self.keyframes[own].odometry);
            reading.offset = between * reading.offset;
            reading.keyframe = own / 2;
        }
        let dropped = self.keyframes.len() / 2 * 2;
        if dropped == self.keyframes.len()
            && let (Some(last), Some((_, since))) = (self.keyframes.last(), &mut self.last)
        {
            *since = last.step.then(since);
        }
        let mut kept: Vec<Keyframe> = Vec::with_capacity(self.keyframes.len() / 2 + 1);
        for pair in self.keyframes.chunks(2) {
            let before = kept.len().checked_sub(1).and_then(|last| self.keyframes.get(2 * last + 1));
            let step = before.map_or(pair[0].step, |dropped| dropped.step.then(&pair[0].step));
            kept.push(Keyframe { step, ..pair[0] });
        }
        self.keyframes = kept;
    }

    /// Number of readings.
    pub(in super::super) fn len(&self) -> usize {
        self.readings.len()
    }
}

impl Measured {
    /// Number of kinds.
    pub(super) const KINDS: usize = 3;

    /// Number of its kind.
    pub(super) fn kind(&self) -> u8 {
        match self {
            Self::Range(_) => 0,
            Self::Place(_) => 1,
            Self::Bearing { .. } => 2,
        }
    }
}

/// The heading of a pose, radians.
pub(super) fn yaw(pose: &Pose2) -> f64 {
    wrap_angle(pose.rotation.angle())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::pose;

    #[test]
    fn readings_keep_their_places_when_keyframes_are_dropped() {
        let mut drive = Keyframes::new(0.1);
        let at = |step: usize| pose(0.2 * step as f64, 0.0, 0.001 * step as f64);
        for step in 0..3 * MOST_KEYFRAMES {
            drive.add_pose(LogTime::MIN, &at(step));
            drive.add_reading(&at(step), "a", Measured::Range(1.0 + step as f64), 0.1);
        }
        assert!(drive.keyframes.len() <= MOST_KEYFRAMES && drive.keyframes.len() > MOST_KEYFRAMES / 4);
        assert_eq!(drive.keyframes[0].odometry, at(0));
        for pair in drive.keyframes.windows(2) {
            let off = (pair[0].odometry * pair[1].step.transform).inv_mul(&pair[1].odometry);
            assert!(off.translation.vector.norm() < 1e-9 && pair[1].step.way > 0.2, "{pair:?}");
        }
        assert!(drive.readings.is_sorted_by_key(|reading| reading.keyframe));
        for reading in &drive.readings {
            let Measured::Range(range) = reading.measured else { panic!("{reading:?}") };
            let place = drive.keyframes[reading.keyframe].odometry * reading.offset;
            let off = place.translation.vector - at(range as usize - 1).translation.vector;
            assert!(off.norm() < 1e-6, "{reading:?}: {off}");
        }
    }

    #[test]
    fn a_robot_that_waits_keeps_few_readings_of_a_tag() {
        let mut drive = Keyframes::new(0.1);
        for _ in 0..100 {
            drive.add_pose(LogTime::MIN, &Pose2::identity());
            drive.add_reading(&Pose2::identity(), "a", Measured::Range(2.0), 0.1);
        }
        assert_eq!((drive.keyframes.len(), drive.len()), (1, usize::from(MOST_AT_ONE)));
    }
}
