//! Parameters of the tag localizer.

use gridweave_runtime::stage::{ParameterError, Parameters};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the certainty of a tag is computed from its grid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Readout {
    /// The largest share in a window at any position.
    #[default]
    Window,
    /// The largest share in a block of a fixed raster (the paper). A tag on the border of two blocks gets half its
    /// certainty.
    Blocks,
}

/// Parameters of `tag_localizer`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TagLocalizerParameters {
    /// Width and height of a tag's grid, metres; its centre is the robot's position at the first reading or, for a
    /// tag with bearings only, about where they cross. The paper has 6 m (300 px), which cuts off tags that are first
    /// read at the full reach along an axis. At least twice `reach`.
    pub grid_size: f64,
    /// Width of a grid cell, metres. The paper has 0.02 m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub resolution: f64,
    /// How the certainty is computed from the grid: `window` or `blocks`.
    pub readout: Readout,
    /// Width of the window or block whose share of the probability is the certainty, metres; rounded to whole cells.
    /// The paper has 0.06 m (3 px).
    pub window: f64,
    /// Least width of the window in standard deviations of the tag's most accurate reading. The paper's 0.06 m are
    /// 1.2 of its 0.05 m; so the certainty is that of a unique position, whatever the noise, and the covariance is
    /// its accuracy. 0 keeps `window` as it is.
    #[schemars(range(min = 0.0))]
    pub window_deviations: f64,
    /// Largest distance at which a tag of short range is read, metres. Greater readings of such a tag are left out, and
    /// it is read out when it is out of reach. The paper has 3 m. A tag most of whose readings are greater has a radio
    /// of long range, such as UWB: all its readings count, and its reach is theirs.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub reach: f64,
    /// Least standard deviation of a reading, metres: used where a reading has none, or a smaller one. The paper has
    /// 0.05 m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub range_stddev: f64,
    /// Standard deviation of the robot's position, metres. It is common to all readings at one position, so many
    /// readings of a robot that stands still do not make a tag certain. 0 is the paper's.
    #[schemars(range(min = 0.0))]
    pub pose_stddev: f64,
    /// Distance at which the robot counts as at a new position, metres. Readings at one position are averaged. 0
    /// keeps every reading separate, as in the paper.
    #[schemars(range(min = 0.0))]
    pub min_travel: f64,
    /// Share of outliers among readings, such as echoes: every ring is mixed with this share of a uniform
    /// distribution over ranges up to `reach`. 0 is the paper's pure Gaussian, which one bad reading can mislead.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub outlier_share: f64,
    /// Standard deviation of the offset of ranges, metres, which is estimated with the tags of long range: delays that
    /// are the same for all tags of a robot. 0 for a radio that is calibrated.
    #[schemars(range(min = 0.0))]
    pub offset_stddev: f64,
    /// The same for the scale of ranges: 0.05 is five in a hundred.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub scale_stddev: f64,
    /// Standard deviation of a sighting without a covariance, metres at a distance of up to one metre, and
    /// proportionally more at a greater distance.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub sighting_stddev: f64,
    /// Least standard deviation of a bearing, radians: used where a reading has none, or a smaller one.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub bearing_stddev: f64,
    /// Standard deviation of the robot's heading, radians: it moves a tag in proportion to its distance. For bearings
    /// it is a lower bound: they count with that of the pose if it is greater.
    #[schemars(range(min = 0.0))]
    pub heading_stddev: f64,
    /// Least standard deviation of a tag's position, metres: errors that the grid does not include, such as the
    /// deformation of the map.
    #[schemars(range(min = 0.0))]
    pub position_stddev: f64,
    /// A tag without readings for so long is out of reach, seconds.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub timeout: f64,
    /// Largest age of the last pose before a reading, seconds. Between two poses the position is interpolated.
    #[schemars(range(min = 0.0))]
    pub max_pose_age: f64,
    /// A tag with fewer readings is not reported.
    pub min_readings: u32,
    /// Whether the poses may be those of an odometry that drifts: then, if the readings show that it does, tags and
    /// poses are estimated together, in the frame of the first pose. Not for robots with maps, in which their poses do
    /// not drift.
    pub drift: bool,
}

impl Default for TagLocalizerParameters {
    fn default() -> Self {
        Self {
            grid_size: 7.0,
            resolution: 0.02,
            readout: Readout::Window,
            window: 0.06,
            window_deviations: 1.2,
            reach: 3.0,
            range_stddev: 0.05,
            pose_stddev: 0.02,
            min_travel: 0.1,
            outlier_share: 0.02,
            offset_stddev: 1.0,
            scale_stddev: 0.05,
            sighting_stddev: 0.05,
            bearing_stddev: 0.05,
            heading_stddev: 0.02,
            position_stddev: 0.02,
            timeout: 2.0,
            max_pose_age: 0.5,
            min_readings: 5,
            drift: false,
        }
    }
}

/// Most cells along a side: a larger grid would take too much memory.
const MOST_CELLS: f64 = 4000.0;

impl TagLocalizerParameters {
    /// Cells along a side of a tag's grid.
    pub fn cells(&self) -> usize {
        (self.grid_size / self.resolution).round().clamp(1.0, MOST_CELLS) as usize
    }

    /// Cells along a side of the window of a tag whose most accurate reading has this standard deviation, metres.
    pub fn window_cells(&self, range_stddev: f64) -> usize {
        let window = self.window.max(self.window_deviations * range_stddev).min(self.grid_size);
        (window / self.resolution).round().clamp(1.0, MOST_CELLS) as usize
    }
}

impl Parameters for TagLocalizerParameters {
    fn check_together(&self) -> Vec<ParameterError> {
        let mut errors = Vec::new();
        let mut expect = |good: bool, field, problem| {
            if !good {
                errors.push(ParameterError::new(field, problem));
            }
        };
        expect(self.grid_size >= 2.0 * self.reach, "grid_size", "must be at least twice `reach`");
        let cells = self.grid_size / self.resolution;
        expect(cells <= MOST_CELLS, "resolution", "must not divide `grid_size` into more than 4000 cells");
        let is_between = self.window >= self.resolution && self.window <= self.grid_size;
        expect(is_between, "window", "must lie between `resolution` and `grid_size`");
        errors
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_paper_has_300_cells_and_a_window_of_3() {
        let paper = TagLocalizerParameters { grid_size: 6.0, ..Default::default() };
        assert_eq!((paper.cells(), paper.window_cells(0.05)), (300, 3));
        assert_eq!((paper.window_cells(0.0), paper.window_cells(0.5), paper.window_cells(1e9)), (3, 30, 300));
        assert_eq!(paper.check(), vec![]);
    }
}
