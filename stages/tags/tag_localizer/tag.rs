//! The readings of one tag, and its estimate.

use super::far_tags::FarTag;
use super::{
    BearingGroups, GridSize, Likelihood, Posterior, Reading, ReadingGroups, SightingGroups, TagLocalizerParameters,
    TagMode, read_out,
};
use crate::shared::geometry::Point2;
use gridweave_runtime::message::LogTime;
use nalgebra::Matrix2;

/// A range that exceeds the reach by less than this many standard deviations is noise.
pub(super) const REACH_TOLERANCE: f64 = 4.0;
/// Fewer ranges from beyond the reach may be echoes, and do not show that a tag is of long range.
const LEAST_FAR: u32 = 5;
/// Factor by which the first grid of a tag with bearings only is larger, as its distance is unknown.
const WIDER: f64 = 4.0;

/// Readings and estimate of one tag.
#[derive(Clone, Debug)]
pub(super) struct Tag {
    /// The centre of the grid: the position of the robot at the first range, or that of the first sighting. As long as
    /// there is neither, it is the position of the sensor at the first bearing, which says nothing of the distance.
    pub(super) first_place: Point2,
    /// Ranges within the reach of a tag of short range.
    pub(super) groups: ReadingGroups,
    /// All ranges, once there is one from beyond.
    pub(super) far_groups: Option<ReadingGroups>,
    /// Ranges from beyond.
    pub(super) beyond: u32,
    pub(super) sightings: SightingGroups,
    pub(super) bearings: BearingGroups,
    /// Time, position and distance of the last reading.
    pub(super) last: (LogTime, Point2, f64),
    /// Standard deviation of the most accurate reading, metres.
    pub(super) least_stddev: f64,
    /// Whether there are readings since the last read-out.
    pub(super) changed: bool,
    pub(super) mode: Option<TagMode>,
}

impl Tag {
    /// Whether most of its ranges are from beyond the reach of a tag of short range.
    pub(super) fn is_far(&self) -> bool {
        self.beyond >= LEAST_FAR && self.beyond > self.groups.measurements()
    }

    /// Adds a range: to those from beyond the reach, or to the others.
    pub(super) fn add_range(&mut self, reading: &Reading, min_travel: f64, reach: f64) {
        if reading.range > reach + REACH_TOLERANCE * reading.stddev {
            self.beyond = self.beyond.saturating_add(1);
            // Those before this one, too.
            let all = self.far_groups.get_or_insert_with(|| self.groups.clone());
            all.add(reading, min_travel);
        } else {
            self.groups.add(reading, min_travel);
            if let Some(all) = &mut self.far_groups {
                all.add(reading, min_travel);
            }
        }
    }

    /// The ranges that count.
    fn ranges(&self) -> &ReadingGroups {
        self.far_groups.as_ref().filter(|_| self.is_far()).unwrap_or(&self.groups)
    }

    /// The readings of a tag of long range.
    pub(super) fn far_tag(&self, parameters: &TagLocalizerParameters) -> FarTag {
        let TagLocalizerParameters { pose_stddev, heading_stddev, .. } = *parameters;
        FarTag {
            ranges: self.ranges().rings(pose_stddev).collect(),
            seen: self.sightings.rings(pose_stddev, heading_stddev).collect(),
            rays: self.bearings.rays(pose_stddev, heading_stddev).collect(),
        }
    }

    pub(super) fn readings(&self) -> u32 {
        self.ranges()
            .measurements()
            .saturating_add(self.sightings.measurements())
            .saturating_add(self.bearings.measurements())
    }

    pub(super) fn locate(&self, parameters: &TagLocalizerParameters) -> Option<TagMode> {
        let TagLocalizerParameters { pose_stddev, heading_stddev, outlier_share, reach, readout, .. } = *parameters;
        let resolution = parameters.resolution;
        let rings = self.groups.rings(pose_stddev).chain(self.sightings.rings(pose_stddev, heading_stddev));
        let rays = self.bearings.rays(pose_stddev, heading_stddev);
        let likelihood = Likelihood::new(rings, rays, outlier_share, reach);
        let mut window = parameters.window_cells(self.least_stddev);
        let mut grid = GridSize { centre: self.first_place, cells: parameters.cells(), resolution };
        if self.readings() == self.bearings.measurements() {
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
        let mode = read_out(&Posterior::new(&likelihood, grid)?, readout, window)?;
        Some(self.with_shared_error(mode, parameters))
    }

    /// The estimate with the errors that all readings share.
    pub(super) fn with_shared_error(&self, mut mode: TagMode, parameters: &TagLocalizerParameters) -> TagMode {
        let TagLocalizerParameters { pose_stddev, heading_stddev, position_stddev, .. } = *parameters;
        mode.covariance += self.shared_covariance(pose_stddev, heading_stddev);
        for axis in 0..2 {
            mode.covariance[(axis, axis)] += position_stddev * position_stddev;
        }
        mode
    }

    /// Common error of the poses of all readings: the mean over the kinds of readings.
    fn shared_covariance(&self, pose_stddev: f64, heading_stddev: f64) -> Matrix2<f64> {
        let ranges = self.ranges();
        let ways = [
            (ranges.measurements(), ranges.shared_covariance(pose_stddev)),
            (self.sightings.measurements(), self.sightings.shared_covariance(pose_stddev, heading_stddev)),
            (self.bearings.measurements(), self.bearings.shared_covariance(heading_stddev)),
        ];
        let read = ways.iter().filter(|(readings, _)| *readings > 0);
        let count = read.clone().count().max(1);
        read.map(|(_, covariance)| covariance).sum::<Matrix2<f64>>() / count as f64
    }
}
