//! The tags of one robot.

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
/// A tag that was read so lately is not out of reach, seconds: where poses jump to and fro, all tags would else be read
/// out at every jump, which takes far longer than the drive.
const LEAST_ABSENCE: f64 = 1.0;
/// No camera tells where a tag is more exactly, metres: a covariance that says so knows nothing of how the camera is mounted.
const LEAST_SIGHTING_STDDEV: f64 = 0.01;
/// No camera sees a tag farther off, metres.
const FARTHEST: f64 = 1000.0;
/// A tag of which nothing but bearings is known is looked for first on a grid that is so many times as wide: they do not say how
/// far off it is.
const WIDER: f64 = 4.0;

/// Localizes all tags of one robot as its poses and readings come in.
#[derive(Clone, Debug)]
pub struct TagLocalizer {
    parameters: TagLocalizerParameters,
    track: PoseTrack,
    tags: BTreeMap<String, Tag>,
    /// Readings that are later than the last pose, by time and then as they came.
    pending: BTreeMap<(LogTime, u64), TagReading>,
    /// How many readings have waited.
    waited: u64,
}

/// A reading as it comes: when, which tag, and what it says of it.
#[derive(Clone, Debug, PartialEq)]
struct TagReading {
    time: LogTime,
    tag_id: String,
    says: Says,
    /// Metres.
    stddev: f64,
}

/// What a reading says of a tag.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Says {
    /// How far it is, metres.
    Range(f64),
    /// Where it is from the robot: metres ahead, and to the left.
    Place(Vector2<f64>),
    /// In which direction it is, radians from straight ahead of the robot, with its standard deviation, seen from the sensor:
    /// metres ahead of the robot, and to its left.
    Bearing { sensor: Vector2<f64>, bearing: f64, stddev: f64 },
}

/// What is known of one tag.
#[derive(Clone, Debug)]
struct Tag {
    /// Where the robot was when it heard the tag first, or saw it: the middle of the grid.
    first_place: Point2,
    groups: ReadingGroups,
    sightings: SightingGroups,
    bearings: BearingGroups,
    /// When, where and how far off the tag was heard or seen last.
    last: (LogTime, Point2, f64),
    /// Standard deviation of the most exact reading, metres.
    least_stddev: f64,
    /// Whether readings have come since the last read-out.
    changed: bool,
    mode: Option<TagMode>,
}

/// Why a reading is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ReadingProblem {
    /// The tag has no id.
    NoId,
    /// The range is not a positive number.
    NoRange,
    /// The position is not finite.
    NoPlace,
    /// The bearing, or where its sensor is, is not finite.
    NoBearing,
    /// The range is beyond the reach of a tag.
    TooFar,
    /// It is older than all poses that are known.
    NoPoseBefore,
    /// The last pose before it is older than `max_pose_age`.
    PoseTooOld,
}

impl fmt::Display for ReadingProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NoId => "tag readings without a tag id are left out",
            Self::NoRange => "tag readings whose range is no positive number are left out",
            Self::NoPlace => "tag readings whose position is no finite number are left out",
            Self::NoBearing => "tag readings whose bearing is no finite number are left out",
            Self::TooFar => "tag readings with a range beyond `reach` are left out",
            Self::NoPoseBefore => "tag readings before the robot's first pose are left out",
            Self::PoseTooOld => "tag readings whose last pose is older than `max_pose_age` are left out",
        })
    }
}

impl TagLocalizer {
    /// A robot that has heard nothing yet.
    pub fn new(parameters: TagLocalizerParameters) -> Self {
        Self { parameters, track: PoseTrack::default(), tags: BTreeMap::new(), pending: BTreeMap::new(), waited: 0 }
    }

    /// Adds where the robot is, and the readings that waited for it. `false`, and it is left out, if it is older than the
    /// last one.
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

    /// Adds a reading: of which tag, how far, and with which standard deviation (0 or no number if it is not known), in
    /// metres. One that is later than the last pose waits for the next one, so that its position can be interpolated.
    pub fn add_reading(&mut self, time: LogTime, tag_id: &str, range: f64, stddev: f64) -> Result<(), ReadingProblem> {
        let TagLocalizerParameters { reach, range_stddev, .. } = self.parameters;
        // `max` takes the other value for one that is no number.
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
        self.place_or_wait(TagReading { time, tag_id: tag_id.to_owned(), says: Says::Range(range), stddev })
    }

    /// Adds where a tag was seen from the robot, metres ahead of it and to its left, with its covariance (zeros if it is not
    /// known). It waits for the next pose as a range does.
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
            return Err(ReadingProblem::NoPlace);
        }
        let known = largest_variance(covariance).sqrt();
        let stddev = match known.is_finite() && known > 0.0 {
            true => known.max(LEAST_SIGHTING_STDDEV),
            false => self.parameters.sighting_stddev * distance.max(1.0),
        };
        self.place_or_wait(TagReading { time, tag_id: tag_id.to_owned(), says: Says::Place(place), stddev })
    }

    /// Adds in which direction a tag is: radians, counterclockwise from straight ahead of the robot, with its standard deviation
    /// (0 or no number if it is not known). `sensor` is where the sensor is, metres ahead of the robot, and to its left.
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
        // `max` takes the other value for one that is no number.
        let stddev = bearing_stddev.max(stddev).min(bearing_stddev.max(PI));
        let says = Says::Bearing { sensor, bearing, stddev };
        // How far off the tag is it does not say: at the most as far as tags are perceived.
        self.place_or_wait(TagReading { time, tag_id: tag_id.to_owned(), says, stddev: stddev * reach })
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

    /// Puts the readings that still wait for a pose where the robot was last seen.
    pub fn place_pending(&mut self, mut problem: impl FnMut(ReadingProblem)) {
        for reading in std::mem::take(&mut self.pending).into_values() {
            self.place(reading).unwrap_or_else(&mut problem);
        }
    }

    fn place(&mut self, reading: TagReading) -> Result<(), ReadingProblem> {
        let TagReading { time, tag_id, says, stddev } = reading;
        let position = self.track.position(time, self.parameters.max_pose_age).map_err(|problem| match problem {
            NoPose::Before => ReadingProblem::NoPoseBefore,
            NoPose::TooOld => ReadingProblem::PoseTooOld,
        })?;
        let seen = |place| position.place + Rotation2::new(position.yaw) * place;
        let (first_place, range) = match says {
            Says::Range(range) => (position.place, range),
            Says::Place(place) => (seen(place), place.norm()),
            Says::Bearing { sensor, .. } => (seen(sensor), self.parameters.reach),
        };
        // A pose whose rotation is none says nothing of where the robot looks.
        if !first_place.iter().all(|value| value.is_finite()) {
            return Err(ReadingProblem::NoPlace);
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
        match says {
            Says::Range(range) => tag.groups.add(&Reading { position, range, stddev }, min_travel),
            Says::Place(place) => tag.sightings.add(&Sighting { position, seen: seen(place), stddev }, min_travel),
            Says::Bearing { sensor, bearing, stddev } => {
                let position = Position { place: seen(sensor), ..position };
                tag.bearings.add(&Bearing { position, bearing: position.yaw + bearing, stddev }, min_travel);
            }
        }
        tag.last = (time, position.place, range);
        tag.least_stddev = tag.least_stddev.min(stddev);
        tag.changed = true;
        Ok(())
    }

    /// Reads out the tags that are out of reach and have changed since their last read-out. Whether there were any.
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

    /// Reads out all tags that have changed since their last read-out. Whether there were any.
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

    /// The tags that have been read out with the number of their readings, by id.
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
            // Bearings that cross at the edge, or beyond, do not say where.
            if (about - grid.centre).amax() > edge {
                return None;
            }
            grid.centre = about;
            // From farther off than the reach a direction says less of the place.
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

    /// The error that the poses of all readings may have in common: the mean over the ways in which the tag was read.
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
