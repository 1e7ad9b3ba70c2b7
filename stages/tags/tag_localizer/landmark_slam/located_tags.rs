//! Tags as they were located with the drive: in which frame, and how certain.

use super::super::far_tags::FarTag;
use super::super::{TagLocalizerParameters, TagMode};
use super::graph::LandmarkGraph;
use super::keyframes::Keyframes;
use super::search::{readings_by_tag, search};
use super::step::OdometryDrift;
use crate::shared::geometry::{Point2, PointPair, Pose2, fit_rigid, quarter_turn};
use gridweave_runtime::message::LogTime;
use nalgebra::{DMatrix, Matrix2, Matrix3, SMatrix};

/// Squared distance between two estimates of one tag that differ, in variances.
const DISTINCT: f64 = 16.0;
/// A difference between two estimates that is as small as this is none, metres.
const SAME: f64 = 1.0;
/// A random walk stays within this share of its last standard deviation with a probability of one in a hundred: poses
/// that do are corrected by something, such as the loop closures of a SLAM.
const BOUNDED: f64 = 0.5;

/// Tags that were located together with the drive.
#[derive(Clone, Debug)]
pub(in super::super) struct LocatedTags {
    /// By id; `None` where the readings determine no position.
    pub(in super::super) modes: Vec<(String, Option<TagMode>)>,
    /// The keyframes with their times, if the odometry drifts.
    pub(in super::super) poses: Vec<(LogTime, Pose2)>,
}

/// The tags by an estimate, with the covariance that another one of the same tags gives them. A tag that a search at
/// the estimated poses finds elsewhere is not located.
pub(super) fn located(
    drive: &Keyframes,
    parameters: &TagLocalizerParameters,
    graph: &LandmarkGraph<'_>,
    uncertain: &LandmarkGraph<'_>,
) -> Option<LocatedTags> {
    let covariance = uncertain.covariance_of_tags()?;
    let places: Vec<Point2> = graph.tags.iter().flatten().copied().collect();
    let widened = covariance.clone() * common_error(&places, &covariance);
    let frame = frame(drive, graph);
    let read = readings_by_tag(graph, parameters);
    let searched: Vec<FarTag> = read.into_iter().map(|(tag, _)| tag).collect();
    let searched = search(&searched, parameters);
    let mut modes: Vec<Option<TagMode>> = Vec::with_capacity(graph.tags.len());
    let mut row = 0;
    for (tag, searched) in graph.tags.iter().zip(searched) {
        let Some(position) = *tag else {
            modes.push(None);
            continue;
        };
        let block: Matrix2<f64> = widened.fixed_view::<2, 2>(2 * row, 2 * row).into_owned();
        row += 1;
        modes.push(searched.and_then(|found| {
            let off = found.position - position;
            let squared = off.dot(&((block + found.covariance).try_inverse()? * off));
            let is_same = off.norm() < SAME || squared < DISTINCT;
            let turn = frame.rotation.to_rotation_matrix();
            let (position, covariance) = (frame * position, turn * block * turn.inverse().matrix());
            is_same.then_some(TagMode { position, covariance, window: position, ..found })
        }));
    }
    let ids = drive.tags.iter().map(|(id, &tag)| (id.clone(), modes[tag].take()));
    let poses = drive.keyframes.iter().map(|keyframe| keyframe.time).zip(graph.poses.iter().map(|pose| frame * pose));
    let poses = if graph.drift == OdometryDrift::NONE { Vec::new() } else { poses.collect() };
    Some(LocatedTags { modes: ids.collect(), poses })
}

/// The frame of the estimate in that of the poses: that of the first pose where these drift away from it. Where they
/// drift and do not get away, it is the one in which they are right on the whole.
fn frame(drive: &Keyframes, graph: &LandmarkGraph<'_>) -> Pose2 {
    let corrections = drive
        .keyframes
        .iter()
        .zip(&graph.poses)
        .map(|(keyframe, pose)| keyframe.odometry.rotation.angle_to(&pose.rotation).abs());
    let length: f64 = drive.keyframes.iter().map(|keyframe| keyframe.step.way + keyframe.step.turned).sum();
    if corrections.fold(0.0, f64::max) >= BOUNDED * graph.drift.yaw * length.sqrt() {
        return Pose2::identity();
    }
    let pairs = drive.keyframes.iter().zip(&graph.poses).map(|(keyframe, pose)| PointPair {
        a: keyframe.odometry.translation.vector.into(),
        b: pose.translation.vector.into(),
        weight: 1.0,
    });
    fit_rigid(&pairs.collect::<Vec<_>>()).map_or_else(Pose2::identity, |fit| fit.transform_a_b)
}

/// The factor by which the covariances of tags are to be widened, so that a frame that is fitted to them as if they
/// were independent is no more certain than it is: the errors of tags have the drift of the robot before it saw them in
/// common.
fn common_error(places: &[Point2], covariance: &DMatrix<f64>) -> f64 {
    let centre = places.iter().fold(Point2::origin(), |sum, place| sum + place.coords / places.len().max(1) as f64);
    // The fit of a frame: x, y, yaw about the centre, by weights of the tags alone.
    let mut information = Matrix3::zeros();
    let mut by_tag: Vec<SMatrix<f64, 3, 2>> = Vec::with_capacity(places.len());
    for (tag, place) in places.iter().enumerate() {
        let own: Matrix2<f64> = covariance.fixed_view::<2, 2>(2 * tag, 2 * tag).into_owned();
        let Some(weight) = own.try_inverse() else { return 1.0 };
        let turn = quarter_turn(&(place - centre));
        let derivative = SMatrix::<f64, 2, 3>::new(1.0, 0.0, turn.x, 0.0, 1.0, turn.y);
        information += derivative.transpose() * weight * derivative;
        by_tag.push(derivative.transpose() * weight);
    }
    let mut common = Matrix3::zeros();
    for (row, a) in by_tag.iter().enumerate() {
        for (column, b) in by_tag.iter().enumerate() {
            let block: Matrix2<f64> = covariance.fixed_view::<2, 2>(2 * row, 2 * column).into_owned();
            common += a * block * b.transpose();
        }
    }
    // Largest ratio of the true variance of a frame's part, J^-1 C J^-1, to that which independent tags claim, J^-1.
    let Some(root) = information.cholesky() else { return 1.0 };
    let Some(inverse) = root.l().try_inverse() else { return 1.0 };
    let ratio = (inverse * common * inverse.transpose()).symmetric_eigenvalues().max();
    if ratio.is_finite() { ratio.max(1.0) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLACES: [Point2; 4] =
        [Point2::new(0.0, 0.0), Point2::new(4.0, 0.0), Point2::new(4.0, 3.0), Point2::new(0.0, 3.0)];

    #[test]
    fn independent_tags_are_as_certain_as_they_are_and_a_common_error_does_not_average_out() {
        let independent = DMatrix::identity(8, 8) * 0.01;
        assert!((common_error(&PLACES, &independent) - 1.0).abs() < 1e-9);
        // All of them are moved by the same error: four tags know the frame no better than one.
        let common = DMatrix::from_fn(8, 8, |row, column| if row % 2 == column % 2 { 0.01 } else { 0.0 });
        assert!((common_error(&PLACES, &common) - 4.0).abs() < 1e-9);
    }
}
