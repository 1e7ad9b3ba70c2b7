//! Searches the relative poses of two maps, and refines the peaks to hypotheses.

use super::chance::{chance_score, margin};
use super::peaks::{change, is_near, overlay};
use super::prepared_map::JUDGED;
use super::significance::{OTHERS, significance};
use super::{
    CommonWalls, Extent, MapAlignerParameters, Overlay, Peaks, PreparedMap, ScoredPose, SearchRefusal, covariance,
    refine_peak,
};
use crate::registration::pose_window::PoseWindow;
use crate::shared::geometry::{Grid, Pose2};
use nalgebra::Matrix3;
use rayon::prelude::*;

/// Number of peaks that are refined beyond the number of hypotheses, as several may converge to one pose.
const SPARE: usize = 2;
/// Number of self-similar poses: each comes with its inverse.
const SELF_SIMILAR: usize = 5;

/// A hypothesis of the relative pose of two maps.
#[derive(Clone, Debug, PartialEq)]
pub struct MapAlignment {
    /// Pose of map b in map a.
    pub transform_a_b: Pose2,
    /// Covariance of (x, y, yaw), metres and radians.
    pub covariance: Matrix3<f64>,
    /// Weighted length of wall on wall, less that of wall on free space, metres.
    pub score: f64,
    /// Score as a share of the best one, 0 to 1.
    pub share: f64,
    /// Peak significance: how much the score exceeds the second-best one elsewhere, in units of the spread of all
    /// others; below 0 if it does not. By chance it is more than `t` with probability `exp(-t)`.
    pub significance: f64,
    /// By how much the score exceeds what chance reaches with these maps, as a share of it, 0 to 1.
    pub margin: f64,
    /// Approximate inlier length, metres.
    pub wall_in_common: f64,
    /// Share of the walls of map b that meet walls, and not free space, of map a, 0 to 1.
    pub wall_agreement: f64,
}

/// Hypotheses of the relative pose of two maps.
#[derive(Clone, Debug, PartialEq)]
pub struct MapAlignments {
    /// At least one, the best first, each apart from the others.
    pub hypotheses: Vec<MapAlignment>,
    /// Score of the second-best pose as a share of the best, 0 to 1. It need not be a hypothesis: it may be on the
    /// slope of a wide peak, as along a corridor.
    pub second_best_share: f64,
    /// Distance of the second-best pose, metres, and the rotation of the map to it, radians.
    pub second_best_change: (f64, f64),
}

impl MapAlignments {
    /// Evidence for a hypothesis, for the user.
    pub fn reason(&self, rank: usize) -> String {
        let Some(found) = self.hypotheses.get(rank) else { return String::new() };
        let common = format!("the maps alone: {:.0} m of walls in common", found.wall_in_common);
        if rank > 0 {
            return format!("{common}, and they fit {:.0} % as well as at the best pose", 100.0 * found.share);
        }
        let (shift, turn) = self.second_best_change;
        let (turn, share) = (turn.to_degrees(), 100.0 * self.second_best_share);
        format!(
            "{common}, and at the second-best pose, {shift:.1} m and {turn:.0} degrees away, they fit {share:.0} \
             % as well"
        )
    }
}

/// A robot's map with its name.
#[derive(Clone, Copy, Debug)]
pub struct NamedMap<'a> {
    /// Name of the robot.
    pub robot: &'a str,
    /// Cells of the map.
    pub grid: Grid<'a>,
}

/// Searches the pose of map b in map a.
pub fn align_maps(
    a: &NamedMap<'_>,
    b: &NamedMap<'_>,
    parameters: &MapAlignerParameters,
) -> Result<MapAlignments, SearchRefusal> {
    let least = PreparedMap::least_cell(&a.grid).max(PreparedMap::least_cell(&b.grid));
    let cell = least.max(0.5 * parameters.cell);
    let prepare = |map: &NamedMap<'_>| PreparedMap::new(map.robot, &map.grid, cell, parameters.max_extent);
    let (a, b) = rayon::join(|| prepare(a), || prepare(b));
    align_prepared(&a?, &b?, None, parameters)
}

/// Searches the pose of map b in map a, of two maps in cells of the same size, everywhere or in a window.
pub fn align_prepared(
    a: &PreparedMap,
    b: &PreparedMap,
    window: Option<&PoseWindow>,
    parameters: &MapAlignerParameters,
) -> Result<MapAlignments, SearchRefusal> {
    let peaks = Peaks::find(a, b, Extent::of(window), parameters);
    let no_fit = || if window.is_some() { SearchRefusal::NoFitInWindow } else { SearchRefusal::NoFit };
    let best = peaks.all().first().ok_or_else(no_fit)?;
    let mut hypotheses = hypotheses(&peaks, best.score, a, b, parameters);
    let best_found = hypotheses.first().ok_or_else(no_fit)?;
    let (length, least) = (best_found.alignment.wall_in_common, parameters.min_wall_length);
    if length < least {
        return Err(SearchRefusal::TooLittleInCommon { length, least });
    }
    let centre = &best_found.common.centre;
    let elsewhere = peaks.best_elsewhere(&best.transform_a_b, centre, parameters);
    let second_best_change =
        elsewhere.map_or((0.0, 0.0), |pose| change(&best.transform_a_b, &pose.transform_a_b, centre));
    let by_chance = chance_score(a, b, best, elsewhere, parameters);
    hypotheses.iter_mut().for_each(|found| found.alignment.margin = margin(found.alignment.score, by_chance));
    Ok(MapAlignments {
        second_best_share: elsewhere.map_or(0.0, |pose| (pose.score / best.score).min(1.0)),
        second_best_change,
        hypotheses: hypotheses.into_iter().map(|found| found.alignment).collect(),
    })
}

/// Peak significance of the best pose of map b in map a, of two maps in cells of the same size; 0 where they fit
/// nowhere.
pub fn peak_significance(a: &PreparedMap, b: &PreparedMap, parameters: &MapAlignerParameters) -> f64 {
    let peaks = Peaks::find(a, b, Extent::All, parameters);
    let Some(best) = peaks.all().first() else { return 0.0 };
    let best = hypotheses(&peaks, best.score, a, b, parameters).into_iter().next();
    let is_enough = |found: &RefinedPeak| found.alignment.wall_in_common >= parameters.min_wall_length;
    best.filter(is_enough).map_or(0.0, |found| found.alignment.significance)
}

/// The best poses of a map on itself, other than the identity: `T_map_map` of poses at which the building may be
/// self-similar, the best first. Only those with at least so much common wall are searched, metres, and only those
/// refined whose common walls are `is_enough`.
pub fn self_similar_poses(
    map: &PreparedMap,
    parameters: &MapAlignerParameters,
    least_wall: f64,
    is_enough: impl Fn(&Pose2, &CommonWalls) -> bool,
) -> Vec<Pose2> {
    let here = Pose2::identity();
    let peaks = Peaks::find(map, map, Extent::Itself { least_wall }, parameters);
    let judged = overlay(map, map, JUDGED, parameters.free_space_penalty);
    let (Some(best), Some(itself)) = (peaks.all().first(), judged.common_walls(&here)) else { return Vec::new() };
    let is_elsewhere = |pose: &Pose2| !is_near(&here, pose, &itself.centre, parameters);
    let mut apart = distinct(&peaks, 1 + SELF_SIMILAR + SPARE, &judged, parameters);
    apart.retain(|(peak, common)| is_elsewhere(&peak.transform_a_b) && is_enough(&peak.transform_a_b, common));
    let all = MapAlignerParameters { max_hypotheses: SELF_SIMILAR, least_share: 0.0, ..parameters.clone() };
    let found = refined(&apart, best.score, map, map, &all).into_iter();
    found.map(|found| found.alignment.transform_a_b).filter(is_elsewhere).collect()
}

/// Hypothesis at the peak near a given pose, without a search. `None` if the walls of the maps do not meet there, or
/// contradict each other as much. `found` is what its peak significance and its margin were when it was found.
pub fn align_near(
    a: &PreparedMap,
    b: &PreparedMap,
    transform_a_b: &Pose2,
    found: &MapAlignment,
    parameters: &MapAlignerParameters,
) -> Option<MapAlignment> {
    let judged = overlay(a, b, JUDGED, parameters.free_space_penalty);
    let common = judged.common_walls(transform_a_b)?;
    let peak = ScoredPose { transform_a_b: *transform_a_b, score: judged.faced_score(transform_a_b) };
    let mut near = RefinedPeak::at(&peak, 1.0, &common, a, b, parameters)?.alignment;
    near.score = judged.faced_score(&near.transform_a_b);
    near.share = 1.0;
    (near.significance, near.margin) = (found.significance, found.margin);
    (near.score > 0.0).then_some(near)
}

/// Hypotheses at the peaks, each apart from the others, the best first.
fn hypotheses(
    peaks: &Peaks,
    best_score: f64,
    a: &PreparedMap,
    b: &PreparedMap,
    parameters: &MapAlignerParameters,
) -> Vec<RefinedPeak> {
    let judged = overlay(a, b, JUDGED, parameters.free_space_penalty);
    let looked_at = parameters.max_hypotheses.saturating_add(SPARE);
    let apart = distinct(peaks, OTHERS.max(looked_at) + 1, &judged, parameters);
    let looked_at = &apart[..apart.len().min(looked_at)];
    let mut hypotheses = refined(looked_at, best_score, a, b, parameters);
    for found in &mut hypotheses {
        let others = apart.iter().filter(|(peak, _)| !found.is_near(&peak.transform_a_b, parameters));
        let others: Vec<f64> = others.map(|(peak, _)| peak.score).collect();
        found.alignment.significance = significance(found.alignment.score, &others);
    }
    hypotheses
}

/// At most `most` peaks, each apart from the better ones, with their common walls.
fn distinct(
    peaks: &Peaks,
    most: usize,
    judged: &Overlay<'_>,
    parameters: &MapAlignerParameters,
) -> Vec<(ScoredPose, CommonWalls)> {
    let mut apart: Vec<(ScoredPose, CommonWalls)> = Vec::new();
    for peak in peaks.all() {
        let is_same = |(known, common): &(ScoredPose, CommonWalls)| {
            is_near(&known.transform_a_b, &peak.transform_a_b, &common.centre, parameters)
        };
        if apart.len() < most && !apart.iter().any(is_same) {
            apart.extend(judged.common_walls(&peak.transform_a_b).map(|common| (*peak, common)));
        }
    }
    apart
}

/// Hypotheses at some peaks, each apart from the better ones.
fn refined(
    peaks: &[(ScoredPose, CommonWalls)],
    best_score: f64,
    a: &PreparedMap,
    b: &PreparedMap,
    parameters: &MapAlignerParameters,
) -> Vec<RefinedPeak> {
    let refined =
        peaks.par_iter().filter_map(|(peak, common)| RefinedPeak::at(peak, best_score, common, a, b, parameters));
    let mut hypotheses: Vec<RefinedPeak> = Vec::new();
    for found in refined.collect::<Vec<_>>() {
        // Poses on the slope of a peak converge to its top.
        let is_same = hypotheses.iter().any(|known| known.is_near(&found.alignment.transform_a_b, parameters));
        let is_wanted = hypotheses.len() < 2 || found.alignment.share >= parameters.least_share;
        if is_wanted && !is_same {
            hypotheses.push(found);
        }
    }
    hypotheses.truncate(parameters.max_hypotheses);
    hypotheses
}

/// A hypothesis with its common walls, by which it is distinguished from others.
struct RefinedPeak {
    alignment: MapAlignment,
    common: CommonWalls,
}

impl RefinedPeak {
    /// Refines a peak.
    fn at(
        peak: &ScoredPose,
        best_score: f64,
        common: &CommonWalls,
        a: &PreparedMap,
        b: &PreparedMap,
        parameters: &MapAlignerParameters,
    ) -> Option<Self> {
        let overlay = |level| overlay(a, b, level, parameters.free_space_penalty);
        let radians = 0.5 * parameters.rotation_step;
        let transform_a_b = refine_peak(&overlay(0), &peak.transform_a_b, &common.centre, radians);
        let common = overlay(JUDGED).common_walls(&transform_a_b)?;
        let alignment = MapAlignment {
            transform_a_b,
            covariance: covariance(&overlay(JUDGED), &transform_a_b, &common),
            score: peak.score,
            share: peak.score / best_score,
            significance: 0.0,
            margin: 0.0,
            wall_in_common: common.length,
            wall_agreement: common.agreement,
        };
        Some(Self { alignment, common })
    }

    fn is_near(&self, pose: &Pose2, parameters: &MapAlignerParameters) -> bool {
        is_near(&self.alignment.transform_a_b, pose, &self.common.centre, parameters)
    }
}
