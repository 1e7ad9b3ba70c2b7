//! The search over all relative poses.

use super::correlation::{Correlator, ScoredShift, Workspace};
use super::known_cells::KnownCells;
use super::raster::Raster;
use crate::registration::pose_window::PoseWindow;
use crate::shared::geometry::{Pose2, pose};
use nalgebra::Vector2;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::f64::consts::PI;

/// Most poses that are taken from one rotation.
const MOST_AT_ONE: usize = 64;

/// A relative pose of map b in map a with its score.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScoredPose {
    /// `T_a_b`.
    pub transform_a_b: Pose2,
    /// How well the maps fit there. Only scores that were computed in the same way can be compared.
    pub score: f64,
}

impl ScoredPose {
    /// Sort order: the better one first.
    pub(super) fn best_first(&self, other: &Self) -> Ordering {
        other.score.total_cmp(&self.score)
    }
}

/// Rotations within half a turn: some or all of those that are evenly spaced.
#[derive(Clone, Debug, PartialEq)]
pub struct Rotations {
    /// Number of rotations in half a turn.
    count: usize,
    /// Indices of those that are selected.
    numbers: Vec<usize>,
}

impl Rotations {
    /// All rotations with a spacing of `step` radians, or a little less.
    pub fn all(step: f64) -> Self {
        let count = (PI / step - 1e-9).ceil() as usize;
        Self { count, numbers: (0..count).collect() }
    }

    /// Those from 0 to a quarter of a turn.
    pub fn within_quarter_turn(mut self) -> Self {
        self.numbers.retain(|number| 2 * number <= self.count);
        self
    }

    /// Of the rotations with a spacing of `step`, those nearest to the rotations of given poses, the first poses
    /// first, and `most` at most. The poses were found at rotations of `self`.
    pub fn nearest_to(&self, poses: &[ScoredPose], step: f64, most: usize) -> Self {
        let Self { count, mut numbers } = Self::all(step);
        let nearest = |angle: f64| (angle / self.step()).round().rem_euclid(self.count as f64) as usize;
        let mut of_each = vec![Vec::new(); self.count];
        for number in numbers.drain(..) {
            of_each[nearest(PI * number as f64 / count as f64)].push(number);
        }
        for pose in poses {
            let near = std::mem::take(&mut of_each[nearest(pose.transform_a_b.rotation.angle())]);
            if numbers.len() + near.len() > most {
                break;
            }
            numbers.extend(near);
        }
        numbers.sort_unstable();
        Self { count, numbers }
    }

    /// Spacing, radians.
    pub fn step(&self) -> f64 {
        PI / self.count as f64
    }

    fn angles(&self) -> impl Iterator<Item = f64> {
        self.numbers.iter().map(|number| PI * *number as f64 / self.count as f64)
    }
}

/// Scores every pose of map `b` on map `a`, to a cell of twice the width of those of the rasters, at the given
/// `rotations` and at half a turn more. Returns the best `most` of the poses that are the best at their rotation
/// within a square of `spacing` metres, the best first. With a `window`, every pose in it is taken, and none outside.
pub fn search(
    a: &Raster,
    b: &Raster,
    window: Option<&PoseWindow>,
    rotations: &Rotations,
    penalty: f64,
    spacing: f64,
    most: usize,
) -> Vec<ScoredPose> {
    let step = rotations.step();
    let may_turn = |angle: f64| window.is_none_or(|window| window.contains_yaw(angle, step));
    let angles: Vec<f64> = rotations.angles().filter(|angle| may_turn(*angle) || may_turn(angle + PI)).collect();
    let (spacing, most_at_one) = if window.is_some() { (0.0, usize::MAX) } else { (spacing, MOST_AT_ONE) };
    let margin = 2.0 * a.cell;
    let may_lie = |pose: &ScoredPose| window.is_none_or(|window| window.contains(&pose.transform_a_b, margin, step));
    let (known_a, known_b) = (KnownCells::new(a), KnownCells::new(b));
    let size_b = angles.iter().fold(Vector2::zeros(), |most, angle| known_b.box_turned(*angle).1.sup(&most));
    let correlator = Correlator::new(&known_a, size_b, penalty);
    let places_at = |workspace: &mut Workspace, angle: &f64| {
        correlator.correlate(&known_b, *angle, workspace);
        let shifts = correlator.best_of_blocks(workspace, spacing, most_at_one);
        let both = [*angle, angle + PI].into_iter().zip(shifts).flat_map(|(angle, shifts)| {
            shifts.into_iter().map(move |ScoredShift { translation, score }| ScoredPose {
                transform_a_b: pose(translation.x, translation.y, angle),
                score,
            })
        });
        both.filter(may_lie).collect::<Vec<_>>()
    };
    let poses: Vec<Vec<ScoredPose>> = angles.par_iter().map_init(|| correlator.workspace(), places_at).collect();
    let mut poses = poses.concat();
    poses.sort_by(ScoredPose::best_first);
    poses.truncate(most);
    poses
}

#[cfg(test)]
mod tests {
    use super::*;

    fn poses(angles: &[f64]) -> Vec<ScoredPose> {
        angles.iter().map(|angle| ScoredPose { transform_a_b: pose(0.0, 0.0, *angle), score: 1.0 }).collect()
    }

    #[test]
    fn rotations_are_spread_over_half_a_turn() {
        let all = Rotations::all(0.03);
        let angles: Vec<f64> = all.angles().collect();
        assert_eq!(angles.len(), 105);
        assert!(all.step() <= 0.03 && angles[0] == 0.0 && angles[104] + all.step() > PI - 1e-9);
    }

    #[test]
    fn narrow_rotations_are_around_the_best_poses_of_wide_ones() {
        let wide = Rotations::all(PI / 90.0);
        // Half a turn on, a pose has the same rotation but for a half turn.
        let near = wide.nearest_to(&poses(&[PI / 2.0, -PI / 2.0, 1e-9, 1.0]), PI / 360.0, 9);
        let angles: Vec<f64> = near.angles().collect();
        assert_eq!(angles.len(), 8, "the fourth pose would be one too many: {angles:?}");
        let is_near = |angle: &f64| [0.0, PI / 2.0, PI].iter().any(|of| (angle - of).abs() <= PI / 180.0 + 1e-9);
        assert!(angles.iter().all(is_near), "{angles:?}");
        assert_eq!(near.step(), PI / 360.0);
        assert_eq!(wide.nearest_to(&[], PI / 360.0, 9).angles().count(), 0);
    }
}
