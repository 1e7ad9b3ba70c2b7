//! The drive and the tags from the readings, and how far the odometry drifts.

use super::super::TagLocalizerParameters;
use super::super::far_tags::FarTag;
use super::graph::LandmarkGraph;
use super::keyframes::Keyframes;
use super::located_tags::{LocatedTags, located};
use super::search::{readings_by_tag, search};
use super::step::OdometryDrift;
use rayon::prelude::*;
use std::cmp::Ordering;

/// Drifts that are assumed while the estimate grows along the drive: that of a robot with a good gyroscope, of one with
/// encoders, and of one whose wheels slip.
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
/// A tag that was not certain is searched again when there are so many times as many readings.
const MORE_READINGS: f64 = 1.4;

/// Locates the tags of a drive, and the drive with them if its odometry drifts. `None` if no tag is located.
pub(in super::super) fn locate(keyframes: &Keyframes, parameters: &TagLocalizerParameters) -> Option<LocatedTags> {
    let grown = FIRST_DRIFTS.par_iter().map(|&drift| along_the_drive(keyframes, parameters, drift));
    let best = grown.collect::<Vec<_>>().into_iter().flatten().reduce(|best, next| {
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

/// Which of two estimates explains the readings better. The noise is that of the second, which drifts more: it cannot
/// take drift for noise.
fn more_probable<'a>(first: LandmarkGraph<'a>, second: LandmarkGraph<'a>) -> LandmarkGraph<'a> {
    let mut alike = first.with_noise_of(&second);
    if is_more_probable(&mut alike, &second, 0.0) { first } else { second }
}

/// Whether an estimate, after it is settled, is more probable than another one by the readings, with the same noise.
/// `prior` is the logarithm of how much more probable it is before them.
fn is_more_probable(graph: &mut LandmarkGraph<'_>, than: &LandmarkGraph<'_>, prior: f64) -> bool {
    let found = graph.optimize().then(|| graph.evidence()).flatten();
    found.is_some_and(|found| than.evidence().is_none_or(|other| found + prior > other))
}

/// Whether a drift is one of those that are compared.
fn is_considered(drift: &OdometryDrift) -> bool {
    (LEAST_DRIFT.position..=MOST_DRIFT.position).contains(&drift.position)
        && (LEAST_DRIFT.yaw..=MOST_DRIFT.yaw).contains(&drift.yaw)
}

/// Number of drifts that are compared. That poses do not drift is as probable beforehand as that they drift in any of
/// these ways: so it is that many times as probable as each.
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
        if graph.tags.iter().any(Option::is_some) && !graph.optimize() {
            return None;
        }
    }
    for _ in 0..2 {
        graph.estimate_noise();
        graph.optimize().then_some(())?;
    }
    graph.tags.iter().any(Option::is_some).then_some(graph)
}

/// Gives those tags a position that are certain by the drive so far. `searched_with` is the number of readings with
/// which each was searched the last time.
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
    graph.optimize();
    graph
}
