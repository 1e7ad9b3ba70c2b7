//! Beams of a scan, in the frame of the robot's base.

use super::ScanMapperParameters;
use crate::shared::geometry::{Point2, Pose2, pose};
use gridweave_runtime::ros::RangeScan;

/// Beams of a scan that is used, at most. Lidars that look into one plane send some thousands.
const MOST_BEAMS: usize = 100_000;

/// Why a scan cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ScanError {
    /// A number for all of its beams is not finite.
    #[error("angle_min, angle_increment, time_increment or the mount of the lidar is not finite")]
    NotFinite,
    /// Its beams would go back in time.
    #[error("time_increment is below 0")]
    BackInTime,
    /// Its size is none of a lidar.
    #[error("a scan has more than {MOST_BEAMS} beams")]
    TooManyBeams,
}

/// A beam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseBeam {
    /// Direction relative to the base, radians.
    pub angle: f64,
    /// Distance up to which it shows what is there, metres.
    pub range: f64,
    /// Whether it has hit something at its end.
    pub is_hit: bool,
    /// Time since the first beam, seconds.
    pub delay: f64,
}

/// The valid beams of a scan.
#[derive(Clone, Debug, PartialEq)]
pub struct ScanBeams {
    /// Pose of the lidar in the frame of the base.
    pub transform_base_lidar: Pose2,
    /// In the order in which they were sent.
    pub beams: Vec<BaseBeam>,
    /// Seconds from the first beam of the scan to the last one, valid or not; 0 if it is unknown.
    pub duration: f64,
}

impl ScanBeams {
    /// Extracts the beams of a scan. Ranges below the lidar's minimum or not a number are left out; those of its
    /// maximum, as many drivers report where nothing is, above it, or infinite, have hit nothing (REP 117).
    ///
    /// # Errors
    /// The numbers for all beams are not finite or in no order, or there are too many beams.
    pub fn of(scan: &RangeScan, parameters: &ScanMapperParameters) -> Result<Self, ScanError> {
        let RangeScan { x, y, yaw, angle_min, angle_increment, time_increment, .. } = *scan;
        let numbers = [x, y, yaw, angle_min, angle_increment, time_increment];
        if !numbers.iter().all(|number| number.is_finite()) {
            return Err(ScanError::NotFinite);
        }
        if time_increment < 0.0 {
            return Err(ScanError::BackInTime);
        }
        if scan.ranges.len() > MOST_BEAMS {
            return Err(ScanError::TooManyBeams);
        }
        let (nearest, farthest) = (f64::from(scan.range_min), f64::from(scan.range_max));
        // A lidar that reports no limit has none.
        let farthest = if farthest > nearest { farthest } else { f64::INFINITY };
        let seen = |range: f64| match range {
            range if range < nearest.max(f64::MIN_POSITIVE) => None,
            range if range.is_nan() => None,
            range if range >= farthest || range.is_infinite() => {
                let free = parameters.free_without_echo.min(parameters.max_range).min(farthest);
                (free > 0.0).then_some((free, false))
            }
            range if range > parameters.max_range => Some((parameters.max_range, false)),
            range => Some((range, true)),
        };
        let beams = scan.ranges.iter().enumerate().filter_map(|(number, range)| {
            let (range, is_hit) = seen(f64::from(*range))?;
            let number = number as f64;
            let (angle, delay) = (angle_min + number * angle_increment, number * time_increment);
            Some(BaseBeam { angle, range, is_hit, delay })
        });
        let beams = beams.collect();
        let duration = scan.ranges.len().saturating_sub(1) as f64 * time_increment;
        Ok(Self { transform_base_lidar: pose(x, y, yaw), beams, duration })
    }

    /// The scan of a robot that stands still where it is at the first beam; `moved(delay)` is where it really is that many
    /// seconds later, relative to there.
    pub fn without_motion(&self, moved: impl Fn(f64) -> Option<Pose2>) -> Self {
        let mut still = self.clone();
        if self.duration == 0.0 {
            return still;
        }
        let transform_lidar_base = self.transform_base_lidar.inverse();
        for beam in &mut still.beams {
            let Some(base) = moved(beam.delay) else { continue };
            let (sine, cosine) = beam.angle.sin_cos();
            let end = Point2::new(cosine * beam.range, sine * beam.range);
            let end = transform_lidar_base * (base * (self.transform_base_lidar * end));
            (beam.angle, beam.range, beam.delay) = (end.y.atan2(end.x), end.coords.norm(), 0.0);
        }
        still.duration = 0.0;
        still
    }

    /// Number of beams with a hit.
    pub fn hits(&self) -> usize {
        self.beams.iter().filter(|beam| beam.is_hit).count()
    }
}
