//! Localization of the tags of one robot.

use super::{
    Bearing, BearingGroups, GridSize, Likelihood, NoPose, PoseTrack, Position, Posterior, Reading, ReadingGroups,
    Sighting, SightingGroups, TagLocalizerParameters, TagMode, largest_variance, read_out,
};
use crate::shared::geometry::Point2;
use gridweave_runtime::message::LogTime;
use nalgebra::{Matrix2, Rotation2, Vector2};
use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::fmt;

/// A range that exceeds the reach by less than this many standard deviations is noise.
const REACH_TOLERANCE: f64 = 4.0;
/// A tag that was read less than this many seconds ago is not out of reach: otherwise poses that jump back and forth
/// would read out all tags at every jump, which takes far longer than the drive.
const LEAST_ABSENCE: f64 = 1.0;
/// Least standard deviation of a sighting, metres: a smaller covariance ignores how the camera is mounted.
const LEAST_SIGHTING_STDDEV: f64 = 0.01;
/// Largest distance at which a camera sees a tag, metres.
const FARTHEST: f64 = 1000.0;
/// Factor by which the first grid of a tag with bearings only is larger, as its distance is unknown.
const WIDER: f64 = 4.0;

/// Localizes all tags of one robot from its poses and readings.
#[derive(Clone, Debug)]
pub struct TagLocalizer {
    parameters: TagLocalizerParameters,
    track: PoseTrack,
    tags: BTreeMap<String, Tag>,
    /// Readings later than the last pose, by time and then in order of arrival.
    pending: BTreeMap<(LogTime, u64), TagReading>,
    /// Number of readings that have waited.
    waited: u64,
}

/// A reading: its time, its tag, and its measurement.
#[derive(Clone, Debug, PartialEq)]
struct TagReading {
    time: LogTime,
    tag_id: String,
    measured: Measured,
    /// Metres.
    stddev: f64,
}

/// A measurement of a tag.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Measured {
    /// Distance, metres.
    Range(f64),
    /// Position relative to the robot: metres ahead, and to the left.
    Place(Vector2<f64>),
    /// Bearing, radians from straight ahead of the robot, with its standard deviation, relative to the sensor: metres
    /// ahead of the robot, and to its left.
    Bearing { sensor: Vector2<f64>, bearing: f64, stddev: f64 },
}

/// Readings and estimate of one tag.
#[derive(Clone, Debug)]
struct Tag {
    /// Position of the robot at the first reading: the centre of the grid.
    first_place: Point2,
    groups: ReadingGroups,
    sightings: SightingGroups,
    bearings: BearingGroups,
    /// Time, position and distance of the last reading.
    last: (LogTime, Point2, f64),
    /// Standard deviation of the most accurate reading, metres.
    least_stddev: f64,
    /// Whether there are readings since the last read-out.
    changed: bool,
    mode: Option<TagMode>,
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
            Self::TooFar => "tag readings with a range beyond `reach` are left out",
            Self::NoPoseBefore => "tag readings before the robot's first pose are left out",
            Self::PoseTooOld => "tag readings more than `max_pose_age` after the last pose are left out",
        })
    }
}

impl TagLocalizer {
    /// A robot without readings.
    pub fn new(parameters: TagLocalizerParameters) -> Self {
        Self { parameters, track: PoseTrack::default(), tags: BTreeMap::new(), pending: BTreeMap::new(), waited: 0 }
    }

    /// Adds a pose of the robot, and the readings that waited for it. Returns `false`, and ignores it, if it is older
    /// than the last one.
    pub fn add_pose(&mut self, time: LogTime, position: Position, mut problem: impl FnMut(ReadingProblem)) -> bool {
        if !self.track.add(time, position) {
            return false;
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
        let stddev = range_stddev.max(stddev).min(range_stddev.max(reach));
        if tag_id.is_empty() {
            return Err(ReadingProblem::NoId);
        }
        if !(range.is_finite() && range > 0.0) {
            return Err(ReadingProblem::NoRange);
        }
        if range > reach + REACH_TOLERANCE * stddev {
            return Err(ReadingProblem::TooFar);
        }
        self.place_or_wait(TagReading { time, tag_id: tag_id.to_owned(), measured: Measured::Range(range), stddev })
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
        let distance = place.norm();
        if !(distance.is_finite() && distance < FARTHEST) {
            return Err(ReadingProblem::NoPosition);
        }
        let known = largest_variance(covariance).sqrt();
        let stddev = match known.is_finite() && known > 0.0 {
            true => known.max(LEAST_SIGHTING_STDDEV),
            false => self.parameters.sighting_stddev * distance.max(1.0),
        };
        self.place_or_wait(TagReading { time, tag_id: tag_id.to_owned(), measured: Measured::Place(place), stddev })
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
        self.place_or_wait(TagReading { time, tag_id: tag_id.to_owned(), measured, stddev: stddev * reach })
    }

    fn place_or_wait(&mut self, reading: TagReading) -> Result<(), ReadingProblem> {
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

    fn place(&mut self, reading: TagReading) -> Result<(), ReadingProblem> {
        let TagReading { time, tag_id, measured, stddev } = reading;
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
        let tag = self.tags.entry(tag_id).or_insert_with(|| Tag {
            first_place,
            groups: ReadingGroups::default(),
            sightings: SightingGroups::default(),
            bearings: BearingGroups::default(),
            last: (time, position.place, range),
            least_stddev: stddev,
            changed: false,
            mode: None,
        });
        let min_travel = self.parameters.min_travel;
        match measured {
            Measured::Range(range) => tag.groups.add(&Reading { position, range, stddev }, min_travel),
            Measured::Place(place) => tag.sightings.add(&Sighting { position, seen: seen(place), stddev }, min_travel),
            Measured::Bearing { sensor, bearing, stddev } => {
                let position = Position { place: seen(sensor), ..position };
                tag.bearings.add(&Bearing { position, bearing: position.yaw + bearing, stddev }, min_travel);
            }
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
        self.read_out_if(|&(last_time, last_place, last_range)| {
            // By the triangle inequality the tag is at least this far away.
            let distance = (place - last_place).norm() - last_range;
            let age = time.seconds_since(last_time);
            age > timeout || (distance > reach && age > LEAST_ABSENCE)
        })
    }

    /// Reads out all tags that have changed since their last read-out. Returns whether there were any.
    pub fn read_out_all(&mut self) -> bool {
        self.read_out_if(|_| true)
    }

    fn read_out_if(&mut self, due: impl Fn(&(LogTime, Point2, f64)) -> bool) -> bool {
        let parameters = &self.parameters;
        let mut any = false;
        for tag in self.tags.values_mut() {
            if tag.changed && tag.readings() >= parameters.min_readings && due(&tag.last) {
                tag.changed = false;
                tag.mode = tag.locate(parameters);
                any = true;
            }
        }
        any
    }

    /// The tags that have been read out, with the number of their readings, by id.
    pub fn modes(&self) -> impl Iterator<Item = (&str, &TagMode, u32)> {
        self.tags.iter().filter_map(|(id, tag)| Some((id.as_str(), tag.mode.as_ref()?, tag.readings())))
    }
}

impl Tag {
    fn readings(&self) -> u32 {
        self.groups.readings().saturating_add(self.sightings.sightings()).saturating_add(self.bearings.bearings())
    }

    fn locate(&self, parameters: &TagLocalizerParameters) -> Option<TagMode> {
        let TagLocalizerParameters { pose_stddev, heading_stddev, outlier_share, reach, readout, .. } = *parameters;
        let TagLocalizerParameters { resolution, position_stddev, .. } = *parameters;
        let rings = self.groups.rings(pose_stddev).chain(self.sightings.rings(pose_stddev, heading_stddev));
        let rays = self.bearings.rays(pose_stddev, heading_stddev);
        let likelihood = Likelihood::new(rings, rays, outlier_share, reach);
        let mut window = parameters.window_cells(self.least_stddev);
        let mut grid = GridSize { centre: self.first_place, cells: parameters.cells(), resolution };
        if self.readings() == self.bearings.bearings() {
            let wide = GridSize { resolution: WIDER * resolution, ..grid };
            let about = read_out(&Posterior::new(&likelihood, wide)?, readout, window)?.position;
            let edge = 0.5 * (WIDER - 1.0) * grid.cells as f64 * resolution;
            // Bearings that cross at the edge or beyond determine no position.
            if (about - grid.centre).amax() > edge {
                return None;
            }
            grid.centre = about;
            // From beyond the reach a bearing is less accurate.
            let nearest = self.bearings.rays(pose_stddev, heading_stddev).map(|ray| (about - ray.origin).norm());
            let farther = nearest.fold(f64::INFINITY, f64::min) / reach;
            window = parameters.window_cells(self.least_stddev * farther.max(1.0));
        }
        let mut mode = read_out(&Posterior::new(&likelihood, grid)?, readout, window)?;
        mode.covariance += self.shared_covariance(pose_stddev, heading_stddev);
        for axis in 0..2 {
            mode.covariance[(axis, axis)] += position_stddev * position_stddev;
        }
        Some(mode)
    }

    /// Common error of the poses of all readings: the mean over the kinds of readings.
    fn shared_covariance(&self, pose_stddev: f64, heading_stddev: f64) -> Matrix2<f64> {
        let ways = [
            (self.groups.readings(), self.groups.shared_covariance(pose_stddev)),
            (self.sightings.sightings(), self.sightings.shared_covariance(pose_stddev, heading_stddev)),
            (self.bearings.bearings(), self.bearings.shared_covariance(heading_stddev)),
        ];
        let read = ways.iter().filter(|(readings, _)| *readings > 0);
        let count = read.clone().count().max(1);
        read.map(|(_, covariance)| covariance).sum::<Matrix2<f64>>() / count as f64
    }
}

#[cfg(test)]
mod tests;
