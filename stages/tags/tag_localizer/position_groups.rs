//! Measurements of a tag, averaged by the robot's position.

use super::{Position, largest_variance};
use crate::shared::geometry::Point2;
use nalgebra::{Matrix2, Vector2};

/// A measurement of a tag.
pub trait Measurement {
    /// Weighted sums of what is measured, relative to the first measurement: then they lose no digits far from the
    /// origin, and angles do not wrap.
    type Sums;

    /// Pose of the robot.
    fn position(&self) -> &Position;

    /// Standard deviation of what is measured.
    fn stddev(&self) -> f64;

    /// Sums of no measurement, relative to this one.
    fn no_sums(&self) -> Self::Sums;

    /// Adds this to sums, with a weight.
    fn add_to(&self, sums: &mut Self::Sums, weight: f64);

    /// Whether it agrees with the mean of a group, where the robot is `offset` metres from the group's anchor.
    fn agrees(&self, group: &PositionGroup<Self::Sums>, offset: f64) -> bool;
}

/// The measurements of one tag, averaged by position.
///
/// The noise of measurements averages out, the error of the pose does not, as measurements at one position share it.
/// So a robot that waits does not make a tag certain. A measurement that contradicts the others at its position makes
/// a separate group, so that an outlier does not spoil a mean.
#[derive(Clone, Debug, Default)]
pub struct PositionGroups<S> {
    groups: Vec<PositionGroup<S>>,
    /// Index of the first group at the robot's present position.
    here: usize,
    measurements: u32,
}

/// Weighted sums over the measurements of one group.
#[derive(Clone, Copy, Debug)]
pub struct PositionGroup<S> {
    /// Where the robot was at the first measurement at this position.
    pub(super) anchor: Point2,
    /// Sum of the weights: those are inverse variances of what is measured.
    pub(super) weight: f64,
    /// Of the robot's place, relative to the anchor.
    offset: Vector2<f64>,
    pose_covariance: Matrix2<f64>,
    /// Of what is measured.
    pub(super) sums: S,
}

impl<S> PositionGroups<S> {
    /// Adds a measurement. The robot is at a new position when it is `min_travel` metres or more away from the start
    /// of the last one.
    pub fn add<M: Measurement<Sums = S>>(&mut self, measurement: &M, min_travel: f64) {
        self.measurements = self.measurements.saturating_add(1);
        let Position { place, covariance, .. } = *measurement.position();
        let last = self.groups.get(self.here).map(|group| group.anchor);
        let anchor = match last.filter(|anchor| (place - anchor).norm() < min_travel) {
            Some(anchor) => anchor,
            None => {
                self.here = self.groups.len();
                place
            }
        };
        let offset = place - anchor;
        let here = &self.groups[self.here..];
        let number = match here.iter().position(|group| measurement.agrees(group, offset.norm())) {
            Some(number) => self.here + number,
            None => {
                let (offset, pose_covariance) = (Vector2::zeros(), Matrix2::zeros());
                let sums = measurement.no_sums();
                self.groups.push(PositionGroup { anchor, weight: 0.0, offset, pose_covariance, sums });
                self.groups.len() - 1
            }
        };
        let weight = 1.0 / (measurement.stddev() * measurement.stddev());
        let group = &mut self.groups[number];
        group.weight += weight;
        group.offset += offset * weight;
        group.pose_covariance += covariance * weight;
        measurement.add_to(&mut group.sums, weight);
    }

    /// Number of measurements.
    pub fn measurements(&self) -> u32 {
        self.measurements
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &PositionGroup<S>> {
        self.groups.iter()
    }

    /// Common error of the poses, which moves the tag and does not average out over positions: their mean covariance,
    /// weighted by the information of each group, which has a `variance`; square metres. Zeros if it is unknown.
    ///
    /// The correlation of the errors of the poses is unknown. If it is full, the error of the tag is theirs; in any
    /// case a mean of errors varies by no more than the mean of their variances.
    pub(super) fn mean_pose_covariance(&self, variance: impl Fn(&PositionGroup<S>) -> f64) -> Matrix2<f64> {
        let mut sum = Matrix2::zeros();
        let mut weights = 0.0;
        for group in &self.groups {
            let weight = 1.0 / variance(group);
            sum += group.pose_covariance * (weight / group.weight);
            weights += weight;
        }
        if weights > 0.0 { sum / weights } else { sum }
    }
}

impl<S> PositionGroup<S> {
    /// Mean place of the robot.
    pub(super) fn place(&self) -> Point2 {
        self.anchor + self.offset / self.weight
    }

    /// Variance of the pose in any direction at most, square metres; `pose_stddev`, metres, is a lower bound of its
    /// deviation.
    ///
    /// An error of the pose changes a distance by its component along the line to the tag. That line is unknown, and
    /// the mirror image is along another one. So the pose counts with its largest variance in any direction: that is
    /// never too small, and at most twice the mean over all directions.
    pub(super) fn pose_variance(&self, pose_stddev: f64) -> f64 {
        (largest_variance(&self.pose_covariance) / self.weight).max(pose_stddev * pose_stddev)
    }
}
