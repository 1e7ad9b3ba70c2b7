//! Localization of the tags of one robot.

use super::far_tags::{self, FarTag};
use super::landmark_slam::{self, Keyframes, LocatedTags};
use super::measured::Measured;
use super::tag::{REACH_TOLERANCE, Tag};
use super::{
    Bearing, BearingGroups, NoPose, PoseTrack, Position, Reading, ReadingGroups, Sighting, SightingGroups,
    TagLocalizerParameters, TagMode, largest_variance,
};
use crate::shared::geometry::{Point2, Pose2, pose};
use gridweave_runtime::message::LogTime;
use nalgebra::{Matrix2, Rotation2, Vector2};
use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::fmt;

/// A tag that was read less than this many seconds ago is not out of reach: otherwise poses that jump back and forth
/// would read out all tags at every jump, which takes far longer than the drive.
const LEAST_ABSENCE: f64 = 1.0;
/// Least standard deviation of a sighting, metres: a smaller covariance ignores how the camera is mounted.
const LEAST_SIGHTING_STDDEV: f64 = 0.01;
/// Largest distance at which a camera sees a tag, or a radio reads it, metres.
const FARTHEST: f64 = 1000.0;
/// Least distance between keyframes, metres.
const LEAST_SPACING: f64 = 0.1;
/// Tags of long range, and tags with the drive, are located again when there are so many times as many readings, and at
/// the end.
const MORE_READINGS: f64 = 1.5;

/// Localizes all tags of one robot from its poses and readings.
#[derive(Clone, Debug)]
pub struct TagLocalizer {
    parameters: TagLocalizerParameters,
    track: PoseTrack,
    tags: BTreeMap<String, Tag>,
    /// Readings later than the last pose, by time and then in order of arrival.
    pending: BTreeMap<(LogTime, u64), WaitingReading>,
    /// Number of readings that have waited.
    waited: u64,
    /// Number of readings of tags of long range when these were last located.
    far_readings: u32,
    /// The poses and readings, if the poses may be those of an odometry that drifts.
    drive: Option<Keyframes>,
    /// Number of its readings when the tags were last located with it.
    drive_readings: usize,
    estimated_poses: Vec<(LogTime, Pose2)>,
}

/// A reading that waits for the pose of its time.
#[derive(Clone, Debug, PartialEq)]
struct WaitingReading {
    time: LogTime,
    tag_id: String,
    measured: Measured,
    /// Metres.
    stddev: f64,
}

/// Standard deviation of the position at which a tag is seen, metres ahead of the robot and to its left, by its
/// covariance, or where that is zero or not finite by `share` of the distance, of at least a metre. `None` if the position
/// is not finite, or farther away than any tag is seen.
pub fn sighting_deviation(place: &Vector2<f64>, covariance: &Matrix2<f64>, share: f64) -> Option<f64> {
    let distance = place.norm();
    let known = largest_variance(covariance).sqrt();
    let deviation = match known.is_finite() && known > 0.0 {
        true => known.max(LEAST_SIGHTING_STDDEV),
        false => share * distance.max(1.0),
    };
    (distance.is_finite() && distance < FARTHEST).then_some(deviation)
}

/// Why a reading is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ReadingProblem {
    /// The tag has no id.
    NoId,
    /// The range is not positive.
    NoRange,
    /// The position is not finite.
    NoPosition,
    /// The bearing, or the position of its sensor, is not finite.
    NoBearing,
    /// The range is beyond the reach of a tag.
    TooFar,
    /// It is older than all known poses.
    NoPoseBefore,
    /// The last pose before it is older than `max_pose_age`.
    PoseTooOld,
}

impl fmt::Display for ReadingProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NoId => "tag readings without a tag id are left out",
            Self::NoRange => "tag readings with a range that is not positive are left out",
            Self::NoPosition => "tag readings with a position that is not finite are left out",
            Self::NoBearing => "tag readings with a bearing that is not finite are left out",
            Self::TooFar => {
                "tag readings with a range beyond `reach`, of tags most of whose ranges are not, are left out"
            }
            Self::NoPoseBefore => "tag readings before the robot's first pose are left out",
            Self::PoseTooOld => "tag readings more than `max_pose_age` after the last pose are left out",
        })
    }
}

impl TagLocalizer {
    /// A robot without readings.
    pub fn new(parameters: TagLocalizerParameters) -> Self {
        Self {
            track: PoseTrack::default(),
            tags: BTreeMap::new(),
            pending: BTreeMap::new(),
            waited: 0,
            far_readings: 0,
            drive: parameters.drift.then(|| Keyframes::new(parameters.min_travel.max(LEAST_SPACING))),
            drive_readings: 0,
            estimated_poses: Vec::new(),
            parameters,
        }
    }

    /// The poses of the robot as they were estimated with the tags, where the poses that it got drift: a batch with its
    /// last estimate, once.
    pub fn take_estimated_poses(&mut self) -> Vec<(LogTime, Pose2)> {
        std::mem::take(&mut self.estimated_poses)
    }

    /// Adds a pose of the robot, and the readings that waited for it. Returns `false`, and ignores it, if it is older
    /// than the last one.
    pub fn add_pose(&mut self, time: LogTime, position: Position, mut problem: impl FnMut(ReadingProblem)) -> bool {
        if !self.track.add(time, position) {
            return false;
        }
        // Without a heading a pose is none of odometry.
        if let Some(drive) = self.drive.as_mut().filter(|_| position.yaw.is_finite()) {
            drive.add_pose(time, &pose(position.place.x, position.place.y, position.yaw));
        }
        while let Some(entry) = self.pending.first_entry().filter(|entry| entry.key().0 <= time) {
            let reading = entry.remove();
            self.place(reading).unwrap_or_else(&mut problem);
        }
        true
    }

    /// Adds a range reading of a tag with its standard deviation (0 or not finite if it is unknown), in metres. One
    /// later than the last pose waits for the next one, so that its position can be interpolated.
    pub fn add_reading(&mut self, time: LogTime, tag_id: &str, range: f64, stddev: f64) -> Result<(), ReadingProblem> {
        let TagLocalizerParameters { reach, range_stddev, .. } = self.parameters;
        // `max` returns the other value for NaN.
        let stddev = range_stddev.max(stddev).min(range_stddev.max(reach).max(range));
        if tag_id.is_empty() {
            return Err(ReadingProblem::NoId);
        }
        if !(range.is_finite() && range > 0.0) {
            return Err(ReadingProblem::NoRange);
        }
        if range > FARTHEST {
            return Err(ReadingProblem::TooFar);
        }
        self.place_or_wait(WaitingReading { time, tag_id: tag_id.to_owned(), measured: Measured::Range(range), stddev })
    }

    /// Adds a sighting of a tag, metres ahead of the robot and to its left, with its covariance (zeros if it is
    /// unknown). It waits for the next pose as a range does.
    pub fn add_sighting(
        &mut self,
        time: LogTime,
        tag_id: &str,
        place: Vector2<f64>,
        covariance: &Matrix2<f64>,
    ) -> Result<(), ReadingProblem> {
        if tag_id.is_empty() {
            return Err(ReadingProblem::NoId);
        }
        let stddev = sighting_deviation(&place, covariance, self.parameters.sighting_stddev)
            .ok_or(ReadingProblem::NoPosition)?;
        self.place_or_wait(WaitingReading { time, tag_id: tag_id.to_owned(), measured: Measured::Place(place), stddev })
    }

    /// Adds a bearing of a tag: radians, counterclockwise from straight ahead of the robot, with its standard
    /// deviation (0 or not finite if it is unknown). `sensor` is the position of the sensor, metres ahead of the
    /// robot, and to its left.
    pub fn add_bearing(
        &mut self,
        time: LogTime,
        tag_id: &str,
        sensor: Vector2<f64>,
        bearing: f64,
        stddev: f64,
    ) -> Result<(), ReadingProblem> {
        let TagLocalizerParameters { reach, bearing_stddev, .. } = self.parameters;
        if tag_id.is_empty() {
            return Err(ReadingProblem::NoId);
        }
        let distance = sensor.norm();
        if !(bearing.is_finite() && distance.is_finite() && distance < FARTHEST) {
            return Err(ReadingProblem::NoBearing);
        }
        // `max` returns the other value for NaN.
        let stddev = bearing_stddev.max(stddev).min(bearing_stddev.max(PI));
        let measured = Measured::Bearing { sensor, bearing, stddev };
        // The distance is unknown: at most as far as tags are perceived.
        self.place_or_wait(WaitingReading { time, tag_id: tag_id.to_owned(), measured, stddev: stddev * reach })
    }

    fn place_or_wait(&mut self, reading: WaitingReading) -> Result<(), ReadingProblem> {
        let time = reading.time;
        match self.track.latest_time().is_some_and(|latest| time <= latest) {
            true => self.place(reading),
            false => {
                self.pending.insert((time, self.waited), reading);
                self.waited += 1;
                Ok(())
            }
        }
    }

    /// Adds the readings that still wait for a pose at the last pose of the robot.
    pub fn place_pending(&mut self, mut problem: impl FnMut(ReadingProblem)) {
        for reading in std::mem::take(&mut self.pending).into_values() {
            self.place(reading).unwrap_or_else(&mut problem);
        }
    }

    fn place(&mut self, reading: WaitingReading) -> Result<(), ReadingProblem> {
        let WaitingReading { time, tag_id, measured, stddev } = reading;
        let position = self.track.position(time, self.parameters.max_pose_age).map_err(|problem| match problem {
            NoPose::Before => ReadingProblem::NoPoseBefore,
            NoPose::TooOld => ReadingProblem::PoseTooOld,
        })?;
        let seen = |place| position.place + Rotation2::new(position.yaw) * place;
        let (first_place, range) = match measured {
            Measured::Range(range) => (position.place, range),
            Measured::Place(place) => (seen(place), place.norm()),
            Measured::Bearing { sensor, .. } => (seen(sensor), self.parameters.reach),
        };
        // A pose with an invalid rotation has no heading.
        if !first_place.iter().all(|value| value.is_finite()) {
            return Err(ReadingProblem::NoPosition);
        }
        if let Some(drive) = self.drive.as_mut().filter(|_| position.yaw.is_finite()) {
            let here = pose(position.place.x, position.place.y, position.yaw);
            drive.add_reading(&here, &tag_id, measured, stddev);
        }
        let tag = self.tags.entry(tag_id).or_insert_with(|| Tag {
            first_place,
            groups: ReadingGroups::default(),
            far_groups: None,
            beyond: 0,
            sightings: SightingGroups::default(),
            bearings: BearingGroups::default(),
            last: (time, position.place, range),
            least_stddev: stddev,
            changed: false,
            mode: None,
        });
        let TagLocalizerParameters { min_travel, reach, .. } = self.parameters;
        if !matches!(measured, Measured::Bearing { .. })
            && tag.readings() == tag.bearings.measurements()
            && tag.beyond == 0
        {
            tag.first_place = first_place;
        }
        match measured {
            Measured::Range(range) => {
                tag.add_range(&Reading { position, range, stddev }, min_travel, reach);
            }
            Measured::Place(place) => tag.sightings.add(&Sighting { position, seen: seen(place), stddev }, min_travel),
            Measured::Bearing { sensor, bearing, stddev } => {
                let position = Position { place: seen(sensor), ..position };
                tag.bearings.add(&Bearing { position, bearing: position.yaw + bearing, stddev }, min_travel);
            }
        }
        if let Measured::Range(range) = measured
            && range > reach + REACH_TOLERANCE * stddev
            && !tag.is_far()
        {
            // An echo does not show where the tag is.
            return Ok(());
        }
        tag.last = (time, position.place, range);
        tag.least_stddev = tag.least_stddev.min(stddev);
        tag.changed = true;
        Ok(())
    }

    /// Reads out the tags that are out of reach and have changed since their last read-out. Returns whether there
    /// were any.
    pub fn read_out_lost(&mut self) -> bool {
        let (Some(time), Some(place)) = (self.track.latest_time(), self.track.latest_place()) else {
            return false;
        };
        let TagLocalizerParameters { timeout, reach, .. } = self.parameters;
        self.read_out_if(false, |&(last_time, last_place, last_range)| {
            // By the triangle inequality the tag is at least this far away.
            let distance = (place - last_place).norm() - last_range;
            let age = time.seconds_since(last_time);
            age > timeout || (distance > reach && age > LEAST_ABSENCE)
        })
    }

    /// Reads out all tags that have changed since their last read-out. Returns whether there were any.
    pub fn read_out_all(&mut self) -> bool {
        self.read_out_if(true, |_| true)
    }

    fn read_out_if(&mut self, is_end: bool, due: impl Fn(&(LogTime, Point2, f64)) -> bool) -> bool {
        let least = self.parameters.min_readings;
        let is_due = |tag: &Tag| tag.changed && tag.readings() >= least && due(&tag.last);
        if self.tags.values().any(&is_due)
            && let Some(any) = self.locate_with_drive(is_end)
        {
            return any;
        }
        let parameters = &self.parameters;
        let (mut any, mut any_far) = (false, false);
        for tag in self.tags.values_mut() {
            if !is_due(tag) {
                continue;
            }
            if tag.is_far() {
                any_far = true;
            } else {
                tag.changed = false;
                tag.mode = tag.locate(parameters);
                any = true;
            }
        }
        if any_far && self.locate_far(is_end) { true } else { any }
    }

    /// Locates all tags of long range, unless there are hardly more readings than the last time: all of them are
    /// located together. Returns whether it did.
    fn locate_far(&mut self, is_end: bool) -> bool {
        let parameters = &self.parameters;
        let far = || self.tags.values().filter(|tag| tag.is_far() && tag.readings() >= parameters.min_readings);
        let readings = far().map(Tag::readings).fold(0, u32::saturating_add);
        if !is_end && f64::from(readings) < MORE_READINGS * f64::from(self.far_readings) {
            return false;
        }
        let read: Vec<FarTag> = far().map(|tag| tag.far_tag(parameters)).collect();
        let mut modes = far_tags::locate(&read, parameters).into_iter();
        self.far_readings = readings;
        for tag in self.tags.values_mut().filter(|tag| tag.is_far() && tag.readings() >= parameters.min_readings) {
            tag.changed = false;
            tag.mode = modes.next().flatten().map(|mode| tag.with_shared_error(mode, parameters));
        }
        true
    }

    /// Locates all tags together with the drive, if its odometry may drift. Returns whether any was located, and `None`
    /// if that is left to the tags one by one.
    fn locate_with_drive(&mut self, is_end: bool) -> Option<bool> {
        let drive = self.drive.as_ref().filter(|drive| drive.len() >= self.parameters.min_readings as usize)?;
        let is_more = drive.len() as f64 >= MORE_READINGS * self.drive_readings as f64;
        if !(is_more || is_end) {
            return Some(false);
        }
        self.drive_readings = drive.len();
        let LocatedTags { modes, poses } = landmark_slam::locate(drive, &self.parameters)?;
        self.estimated_poses = poses;
        for (id, mode) in modes {
            if let Some(tag) = self.tags.get_mut(&id) {
                tag.changed = false;
                tag.mode = mode.map(|mode| tag.with_shared_error(mode, &self.parameters));
            }
        }
        Some(true)
    }

    /// Number of ranges from beyond the reach of the tags that they are of.
    pub fn too_far(&self) -> u32 {
        self.tags.values().filter(|tag| !tag.is_far()).map(|tag| tag.beyond).fold(0, u32::saturating_add)
    }

    /// The tags that have been read out, with the number of their readings, by id.
    pub fn modes(&self) -> impl Iterator<Item = (&str, &TagMode, u32)> {
        self.tags.iter().filter_map(|(id, tag)| Some((id.as_str(), tag.mode.as_ref()?, tag.readings())))
    }
}

#[cfg(test)]
mod tests;
