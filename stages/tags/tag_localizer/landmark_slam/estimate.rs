//! The drive and the tags from the readings, and how far the odometry drifts.

use super::super::far_tags::{self, FarTag};
use super::super::measured::Measured;
use super::super::{Ray, Ring, TagLocalizerParameters, TagMode};
use super::graph::LandmarkGraph;
use super::keyframes::{Keyframes, yaw};
use super::step::OdometryDrift;
use crate::shared::geometry::{Point2, PointPair, Pose2, fit_rigid, quarter_turn};
use gridweave_runtime::message::LogTime;
use nalgebra::{DMatrix, Matrix2, Matrix3, SMatrix};
use std::cmp::Ordering;

/// Drifts that are assumed while the estimate grows along the drive: that of a robot with a good gyroscope, of one with encoders,
/// and of one whose wheels slip.
const FIRST_DRIFTS: [OdometryDrift; 3] = [
    OdometryDrift { position: 0.01, yaw: 0.001 },
    OdometryDrift { position: 0.03, yaw: 0.01 },
    OdometryDrift { position: 0.1, yaw: 0.05 },
];
/// Factor between two drifts that are compared.
const DRIFT_FACTOR: f64 = 1.5;
/// Largest number of rounds in which the drift is changed.
const MOST_ROUNDS: usize = 12;
/// The drift is no less than this, after a metre.
const LEAST_DRIFT: OdometryDrift = OdometryDrift { position: 1e-3, yaw: 1e-4 };
/// And no more.
const MOST_DRIFT: OdometryDrift = OdometryDrift { position: 0.5, yaw: 0.5 };
/// Parts of the drive, one after the other added to the estimate.
const PARTS: usize = 24;
/// Least certainty of a tag's position, for it to become part of the estimate.
const CERTAIN: f64 = 0.9;
/// Largest number of ranges, and of bearings, with which a tag is searched; they are evenly spaced along the drive.
const MOST_SEARCHED: usize = 100;
/// Cells along a side of the grid on which a tag is searched: its position is refined in any case.
const SEARCH_CELLS: f64 = 100.0;
/// A tag that was not certain is searched again when there are so many times as many readings.
const MORE_READINGS: f64 = 1.4;
/// Squared distance between two estimates of one tag that differ, in variances.
const DISTINCT: f64 = 16.0;
/// A difference between two estimates that is as small as this is none, metres.
const SAME: f64 = 1.0;
/// A random walk stays within this share of its last standard deviation with a probability of one in a hundred: poses that do are
/// corrected by something, such as the loop closures of a SLAM.
const BOUNDED: f64 = 0.5;

/// Tags that were located together with the drive.
#[derive(Clone, Debug)]
pub(in super::super) struct LocatedTags {
    /// By id; `None` where the readings determine no position.
    pub(in super::super) modes: Vec<(String, Option<TagMode>)>,
    /// The keyframes with their times, if the odometry drifts.
    pub(in super::super) poses: Vec<(LogTime, Pose2)>,
}

/// Locates the tags of a drive, and the drive with them if its odometry drifts. `None` if no tag is located.
pub(in super::super) fn locate(keyframes: &Keyframes, parameters: &TagLocalizerParameters) -> Option<LocatedTags> {
    let grown = FIRST_DRIFTS.iter().filter_map(|&drift| along_the_drive(keyframes, parameters, drift));
    let best = grown.reduce(|best, next| {
        // Those with more tags explain more readings.
        let located = |graph: &LandmarkGraph<'_>| graph.tags.iter().flatten().count();
        match located(&next).cmp(&located(&best)) {
            Ordering::Less => best,
            Ordering::Greater => next,
            Ordering::Equal => more_probable(best, next),
        }
    })?;
    let drifting = with_best_drift(best);
    let mut rigid = drifting.without_drift();
    let prior = number_of_drifts().ln();
    match (is_more_probable(&mut rigid, &drifting, 0.0), is_more_probable(&mut rigid, &drifting, prior)) {
        (true, _) => located(keyframes, parameters, &rigid, &rigid),
        // There may be drift: the positions are those without it, and as uncertain as with it.
        (false, true) => located(keyframes, parameters, &rigid, &drifting),
        (false, false) => located(keyframes, parameters, &drifting, &drifting),
    }
}

/// Which of two estimates explains the readings better. The noise is that of the second, which drifts more: it cannot take drift
/// for noise.
fn more_probable<'a>(first: LandmarkGraph<'a>, second: LandmarkGraph<'a>) -> LandmarkGraph<'a> {
    let mut alike = first.with_noise_of(&second);
    if is_more_probable(&mut alike, &second, 0.0) { first } else { second }
}

/// Whether an estimate, after it is settled, is more probable than another one by the readings, with the same noise. `prior` is the
/// logarithm of how much more probable it is before them.
fn is_more_probable(graph: &mut LandmarkGraph<'_>, than: &LandmarkGraph<'_>, prior: f64) -> bool {
    let found = graph.settle().then(|| graph.evidence()).flatten();
    found.is_some_and(|found| than.evidence().is_none_or(|other| found + prior > other))
}

/// Whether a drift is one of those that are compared.
fn is_considered(drift: &OdometryDrift) -> bool {
    (LEAST_DRIFT.position..=MOST_DRIFT.position).contains(&drift.position)
        && (LEAST_DRIFT.yaw..=MOST_DRIFT.yaw).contains(&drift.yaw)
}

/// Number of drifts that are compared. That poses do not drift is as probable beforehand as that they drift in any of these ways:
/// so it is that many times as probable as each.
fn number_of_drifts() -> f64 {
    let steps = |least: f64, most: f64| (most / least).ln() / DRIFT_FACTOR.ln();
    steps(LEAST_DRIFT.position, MOST_DRIFT.position) * steps(LEAST_DRIFT.yaw, MOST_DRIFT.yaw)
}

/// An estimate that grows along the drive: so no part of it is far off when it is added. `None` if no tag is located.
fn along_the_drive<'a>(
    drive: &'a Keyframes,
    parameters: &'a TagLocalizerParameters,
    drift: OdometryDrift,
) -> Option<LandmarkGraph<'a>> {
    let mut graph = LandmarkGraph::new(drive, parameters, drift);
    let keyframes = drive.keyframes.len();
    let mut searched_with = vec![0; drive.tags.len()];
    for part in 1..=PARTS {
        graph.extend((keyframes * part).div_ceil(PARTS));
        place_tags(&mut graph, parameters, &mut searched_with);
        if graph.tags.iter().any(Option::is_some) && !graph.settle() {
            return None;
        }
    }
    for _ in 0..2 {
        graph.estimate_noise();
        graph.settle().then_some(())?;
    }
    graph.tags.iter().any(Option::is_some).then_some(graph)
}

/// Gives those tags a position that are certain by the drive so far. `searched_with` is the number of readings with which each was
/// searched the last time.
fn place_tags(graph: &mut LandmarkGraph<'_>, parameters: &TagLocalizerParameters, searched_with: &mut [usize]) {
    let read = readings_by_tag(graph, parameters);
    let is_due = |tag: &usize| {
        let (readings, before) = (read[*tag].1, searched_with[*tag]);
        readings >= parameters.min_readings as usize && readings as f64 >= MORE_READINGS * before as f64
    };
    let open: Vec<usize> = (0..read.len()).filter(|tag| graph.tags[*tag].is_none()).filter(is_due).collect();
    let tags: Vec<FarTag> = open.iter().map(|&tag| read[tag].0.clone()).collect();
    for (tag, mode) in open.into_iter().zip(search(&tags, parameters)) {
        searched_with[tag] = read[tag].1;
        graph.tags[tag] = mode.filter(|mode| mode.certainty > CERTAIN).map(|mode| mode.position);
    }
}

/// Searches tags by their readings alone.
fn search(tags: &[FarTag], parameters: &TagLocalizerParameters) -> Vec<Option<TagMode>> {
    let coarse = TagLocalizerParameters { resolution: parameters.grid_size / SEARCH_CELLS, ..parameters.clone() };
    far_tags::locate(tags, &coarse)
}

/// The readings of each tag at the estimated poses, not more than a search needs, and the number of all. Ranges are corrected by
/// the calibration so far.
fn readings_by_tag(graph: &LandmarkGraph<'_>, parameters: &TagLocalizerParameters) -> Vec<(FarTag, usize)> {
    let mut tags = vec![(FarTag::default(), 0); graph.tags.len()];
    for reading in graph.readings() {
        let here = graph.poses[reading.keyframe] * reading.offset;
        let (tag, count) = &mut tags[reading.tag];
        *count += 1;
        let variance = reading.stddev.powi(2) + parameters.pose_stddev.powi(2);
        match reading.measured {
            Measured::Range(range) => {
                let radius = (range - graph.calibration[0]) / (1.0 + graph.calibration[1]);
                tag.ranges.push(Ring { centre: here.translation.vector.into(), radius, variance });
            }
            Measured::Place(place) => {
                tag.seen.push(Ring { centre: here * Point2::from(place), radius: 0.0, variance });
            }
            Measured::Bearing { sensor, bearing, stddev } => tag.rays.push(Ray {
                origin: here * Point2::from(sensor),
                bearing: yaw(&here) + bearing,
                variance: stddev * stddev,
                origin_variance: parameters.pose_stddev.powi(2),
            }),
        }
    }
    for (tag, _) in &mut tags {
        thin_out(&mut tag.ranges);
        thin_out(&mut tag.seen);
        thin_out(&mut tag.rays);
    }
    tags
}

/// Keeps readings that are evenly spaced.
fn thin_out<T>(readings: &mut Vec<T>) {
    let step = readings.len().div_ceil(MOST_SEARCHED).max(1);
    let mut number = 0;
    readings.retain(|_| {
        number += 1;
        (number - 1) % step == 0
    });
}

/// Changes the drift as long as that makes the readings more probable.
fn with_best_drift(mut graph: LandmarkGraph<'_>) -> LandmarkGraph<'_> {
    for _ in 0..MOST_ROUNDS {
        let OdometryDrift { position, yaw } = graph.drift;
        let others = [
            OdometryDrift { position: position / DRIFT_FACTOR, yaw },
            OdometryDrift { position: position * DRIFT_FACTOR, yaw },
            OdometryDrift { position, yaw: yaw / DRIFT_FACTOR },
            OdometryDrift { position, yaw: yaw * DRIFT_FACTOR },
        ];
        let allowed = others.into_iter().filter(is_considered);
        let better = allowed
            .map(|drift| graph.with_drift(drift))
            .find_map(|mut other| is_more_probable(&mut other, &graph, 0.0).then_some(other));
        let Some(mut better) = better else { break };
        better.estimate_noise();
        graph = better;
    }
    graph.settle();
    graph
}

/// The tags by an estimate, with the covariance that another one of the same tags gives them. A tag that a search at the estimated
/// poses finds elsewhere is not located.
fn located(
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

/// The frame of the estimate in that of the poses: that of the first pose where these drift away from it. Where they drift and do not
/// get away, it is the one in which they are right on the whole.
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

/// The factor by which the covariances of tags are to be widened, so that a frame that is fitted to them as if they were
/// independent is no more certain than it is: the errors of tags have the drift of the robot before it saw them in common.
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
