//! The tags of one robot.

use super::{GridSize, NoPose, PoseTrack, Posterior, Reading, ReadingGroups, RingProduct, TagLocalizerParameters};
use super::{TagMode, read_out};
use crate::geometry::{Point2, Pose2};
use gridweave_runtime::message::LogTime;
use std::collections::BTreeMap;
use std::fmt;

/// A range that exceeds the reach by less than this many standard deviations is noise.
const REACH_TOLERANCE: f64 = 4.0;

/// Localizes all tags of one robot as its poses and readings come in.
#[derive(Clone, Debug)]
pub struct TagLocalizer {
    parameters: TagLocalizerParameters,
    track: PoseTrack,
    tags: BTreeMap<String, Tag>,
    /// Readings that are later than the last pose.
    pending: Vec<RangeReading>,
}

/// A reading as it comes: when, which tag, how far.
#[derive(Clone, Debug, PartialEq)]
struct RangeReading {
    time: LogTime,
    tag_id: String,
    range: f64,
    stddev: f64,
}

/// What is known of one tag.
#[derive(Clone, Debug)]
struct Tag {
    /// Where the robot was at the first reading: the middle of the grid.
    first_position: Point2,
    groups: ReadingGroups,
    /// When, where and how far off the tag was heard last.
    last: (LogTime, Point2, f64),
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
            Self::TooFar => "tag readings with a range beyond `reach` are left out",
            Self::NoPoseBefore => "tag readings before the robot's first pose are left out",
            Self::PoseTooOld => "tag readings whose last pose is older than `max_pose_age` are left out",
        })
    }
}

impl TagLocalizer {
    /// A robot that has heard nothing yet.
    pub fn new(parameters: TagLocalizerParameters) -> Self {
        Self { parameters, track: PoseTrack::default(), tags: BTreeMap::new(), pending: Vec::new() }
    }

    /// Adds a pose, and the readings that waited for it. `false`, and it is left out, if it is older than the last one.
    pub fn add_pose(&mut self, time: LogTime, pose: Pose2, mut problem: impl FnMut(ReadingProblem)) -> bool {
        if !self.track.add(time, pose) {
            return false;
        }
        let (ready, later) = std::mem::take(&mut self.pending).into_iter().partition(|reading| reading.time <= time);
        self.pending = later;
        let ready: Vec<RangeReading> = ready;
        for reading in ready {
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
        let reading = RangeReading { time, tag_id: tag_id.to_owned(), range, stddev };
        match self.track.latest_time().is_some_and(|latest| time <= latest) {
            true => self.place(reading),
            false => {
                self.pending.push(reading);
                Ok(())
            }
        }
    }

    /// Puts the readings that still wait for a pose where the robot was last seen.
    pub fn place_pending(&mut self, mut problem: impl FnMut(ReadingProblem)) {
        for reading in std::mem::take(&mut self.pending) {
            self.place(reading).unwrap_or_else(&mut problem);
        }
    }

    fn place(&mut self, reading: RangeReading) -> Result<(), ReadingProblem> {
        let RangeReading { time, tag_id, range, stddev } = reading;
        let position = self.track.position(time, self.parameters.max_pose_age).map_err(|problem| match problem {
            NoPose::Before => ReadingProblem::NoPoseBefore,
            NoPose::TooOld => ReadingProblem::PoseTooOld,
        })?;
        let tag = self.tags.entry(tag_id).or_insert_with(|| Tag {
            first_position: position,
            groups: ReadingGroups::default(),
            last: (time, position, range),
            changed: false,
            mode: None,
        });
        tag.groups.add(&Reading { position, range, stddev }, self.parameters.min_travel);
        tag.last = (time, position, range);
        tag.changed = true;
        Ok(())
    }

    /// Reads out the tags that are out of reach and have changed since their last read-out. Whether there were any.
    pub fn read_out_lost(&mut self) -> bool {
        let (Some(time), Some(position)) = (self.track.latest_time(), self.track.latest_position()) else {
            return false;
        };
        let TagLocalizerParameters { timeout, reach, .. } = self.parameters;
        self.read_out_if(|&(last_time, last_position, last_range)| {
            // By the triangle inequality the tag is at least this far away.
            let distance = (position - last_position).norm() - last_range;
            time.seconds_since(last_time) > timeout || distance > reach
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
            if tag.changed && tag.groups.readings() >= parameters.min_readings && due(&tag.last) {
                tag.changed = false;
                tag.mode = tag.locate(parameters);
                any = true;
            }
        }
        any
    }

    /// The tags that have been read out with the number of their readings, by id.
    pub fn modes(&self) -> impl Iterator<Item = (&str, &TagMode, u32)> {
        self.tags.iter().filter_map(|(id, tag)| Some((id.as_str(), tag.mode.as_ref()?, tag.groups.readings())))
    }
}

impl Tag {
    fn locate(&self, parameters: &TagLocalizerParameters) -> Option<TagMode> {
        let TagLocalizerParameters { pose_stddev, outlier_share, reach, resolution, readout, position_stddev, .. } =
            *parameters;
        let product = RingProduct::new(self.groups.rings(pose_stddev), outlier_share, reach);
        let grid = GridSize { centre: self.first_position, cells: parameters.cells(), resolution };
        let mut mode = read_out(&Posterior::new(&product, grid)?, readout, parameters.window_cells())?;
        for axis in 0..2 {
            mode.covariance[(axis, axis)] += position_stddev * position_stddev;
        }
        Some(mode)
    }
}
