//! The tags of one robot.

use super::{
    GridSize, NoPose, PoseTrack, Position, Posterior, Reading, ReadingGroups, RingProduct, TagLocalizerParameters,
};
use super::{TagMode, read_out};
use crate::geometry::Point2;
use gridweave_runtime::message::LogTime;
use std::collections::BTreeMap;
use std::fmt;

/// A range that exceeds the reach by less than this many standard deviations is noise.
const REACH_TOLERANCE: f64 = 4.0;
/// A tag that was read so lately is not out of reach, seconds: where poses jump to and fro, all tags would else be read
/// out at every jump, which takes far longer than the drive.
const LEAST_ABSENCE: f64 = 1.0;

/// Localizes all tags of one robot as its poses and readings come in.
#[derive(Clone, Debug)]
pub struct TagLocalizer {
    parameters: TagLocalizerParameters,
    track: PoseTrack,
    tags: BTreeMap<String, Tag>,
    /// Readings that are later than the last pose, by time and then as they came.
    pending: BTreeMap<(LogTime, u64), RangeReading>,
    /// How many readings have waited.
    waited: u64,
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
    first_place: Point2,
    groups: ReadingGroups,
    /// When, where and how far off the tag was heard last.
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
        let reading = RangeReading { time, tag_id: tag_id.to_owned(), range, stddev };
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

    fn place(&mut self, reading: RangeReading) -> Result<(), ReadingProblem> {
        let RangeReading { time, tag_id, range, stddev } = reading;
        let position = self.track.position(time, self.parameters.max_pose_age).map_err(|problem| match problem {
            NoPose::Before => ReadingProblem::NoPoseBefore,
            NoPose::TooOld => ReadingProblem::PoseTooOld,
        })?;
        let tag = self.tags.entry(tag_id).or_insert_with(|| Tag {
            first_place: position.place,
            groups: ReadingGroups::default(),
            last: (time, position.place, range),
            least_stddev: stddev,
            changed: false,
            mode: None,
        });
        tag.groups.add(&Reading { position, range, stddev }, self.parameters.min_travel);
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
        let grid = GridSize { centre: self.first_place, cells: parameters.cells(), resolution };
        let mut mode = read_out(&Posterior::new(&product, grid)?, readout, parameters.window_cells(self.least_stddev))?;
        mode.covariance += self.groups.shared_covariance(pose_stddev);
        for axis in 0..2 {
            mode.covariance[(axis, axis)] += position_stddev * position_stddev;
        }
        Some(mode)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, Normal};

    const TAG: Point2 = Point2::new(1.2, 1.1);

    fn position(x: f64, y: f64) -> Position {
        Position::new(Point2::new(x, y))
    }

    fn at(seconds: f64) -> LogTime {
        LogTime(1_000_000_000).plus_seconds(seconds)
    }

    /// Drives along the path and reads the tag ten times a second with noise; a share of readings is any range.
    fn locate(parameters: TagLocalizerParameters, outliers: f64, path: impl Iterator<Item = (f64, f64)>) -> TagMode {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let noise = Normal::new(0.0, 0.05).unwrap();
        let mut localizer = TagLocalizer::new(parameters);
        for (step, (x, y)) in path.enumerate() {
            let time = at(0.1 * step as f64);
            assert!(localizer.add_pose(time, position(x, y), |problem| panic!("{problem}")));
            let range = match random.random::<f64>() < outliers {
                true => 0.1 + 2.8 * random.random::<f64>(),
                false => (TAG - Point2::new(x, y)).norm() + noise.sample(&mut random),
            };
            localizer.add_reading(time, "tag", range, 0.05).unwrap();
        }
        assert!(localizer.read_out_all());
        *localizer.modes().next().unwrap().1
    }

    /// Two metres along one side of the tag, then two along another.
    fn corner() -> impl Iterator<Item = (f64, f64)> {
        (0..190).map(|step| 0.021 * f64::from(step)).map(|way| if way < 2.0 { (way, 0.0) } else { (2.0, way - 2.0) })
    }

    #[test]
    fn readings_with_noise_give_the_place_within_its_covariance() {
        let mode = locate(TagLocalizerParameters::default(), 0.0, corner());
        let error = mode.position - TAG;
        let squared = error.dot(&(mode.covariance.try_inverse().unwrap() * error));
        assert!(mode.certainty > 0.9 && squared < 9.0, "{mode:?} {squared}");
    }

    #[test]
    fn a_fifth_of_outliers_does_not_lead_astray() {
        let mode = locate(TagLocalizerParameters::default(), 0.2, corner());
        assert!((mode.position - TAG).norm() < 0.05 && mode.certainty > 0.75, "{mode:?}");
    }

    #[test]
    fn a_straight_drive_leaves_a_certainty_of_about_one_half() {
        let mode = locate(TagLocalizerParameters::default(), 0.0, (0..100).map(|step| (0.02 * f64::from(step), 0.0)));
        assert!(mode.certainty > 0.3 && mode.certainty < 0.6, "{mode:?}");
        assert!((mode.mass - 0.5).abs() < 0.05, "{mode:?}");
    }

    #[test]
    fn a_robot_that_stands_still_is_not_certain_however_long_it_stands() {
        let mode = locate(TagLocalizerParameters::default(), 0.0, (0..3000).map(|_| (0.0, 0.0)));
        assert!(mode.certainty < 0.05, "{mode:?}");
    }

    #[test]
    fn far_from_the_origin_nothing_is_lost() {
        let near = locate(TagLocalizerParameters::default(), 0.0, corner());
        let mut localizer = TagLocalizer::new(TagLocalizerParameters::default());
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let noise = Normal::new(0.0, 0.05).unwrap();
        for (step, (x, y)) in corner().enumerate() {
            let time = at(0.1 * step as f64);
            localizer.add_pose(time, position(x + 5e5, y - 4e6), |problem| panic!("{problem}"));
            let _outlier: f64 = random.random();
            let range = (TAG - Point2::new(x, y)).norm() + noise.sample(&mut random);
            localizer.add_reading(time, "tag", range, 0.05).unwrap();
        }
        localizer.read_out_all();
        let far = *localizer.modes().next().unwrap().1;
        assert!((far.position.coords - near.position.coords - nalgebra::Vector2::new(5e5, -4e6)).norm() < 1e-4);
        assert!((far.covariance - near.covariance).norm() < 1e-6);
    }

    #[test]
    fn a_reading_between_two_poses_waits_for_the_second() {
        let mut localizer = TagLocalizer::new(TagLocalizerParameters { min_readings: 1, ..Default::default() });
        let ignore = |_| ();
        localizer.add_pose(at(0.0), position(0.0, 0.0), ignore);
        localizer.add_reading(at(0.25), "tag", 1.0, 0.05).unwrap();
        assert!(!localizer.read_out_all(), "it has no place yet");
        localizer.add_pose(at(0.5), position(1.0, 0.0), ignore);
        assert_eq!(localizer.tags["tag"].first_place, Point2::new(0.5, 0.0));
        assert!(localizer.read_out_all());
    }

    #[test]
    fn a_standard_deviation_that_is_no_number_is_replaced() {
        let mut localizer = TagLocalizer::new(TagLocalizerParameters { min_readings: 1, ..Default::default() });
        localizer.add_pose(at(0.0), position(0.0, 0.0), |_| ());
        for stddev in [f64::NAN, -1.0, 0.0, f64::INFINITY, 1e300] {
            localizer.add_reading(at(0.0), "tag", 1.0, stddev).unwrap();
        }
        assert!(localizer.read_out_all());
        let mode = localizer.modes().next().unwrap().1;
        assert!(mode.position.coords.iter().chain(mode.covariance.iter()).all(|value| value.is_finite()), "{mode:?}");
    }
}
