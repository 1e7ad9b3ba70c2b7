//! The whole of it: search, judge, refine.

use super::lead::{OTHERS, lead};
use super::peaks::{change, is_near, overlay};
use super::prepared_map::JUDGED;
use super::{CommonWalls, MapAlignerParameters, Peaks, Place, PreparedMap, SearchRefusal, covariance, refine_peak};
use crate::registration::place_window::PlaceWindow;
use crate::shared::geometry::{Grid, Pose2};
use nalgebra::Matrix3;
use rayon::prelude::*;

/// More peaks than hypotheses are refined, as some lead to the same place.
const SPARE: usize = 2;
/// As many places are taken at which a map lies on itself: a shift comes with the one back.
const SELF_SIMILAR: usize = 5;

/// A first guess of how two maps lie to each other.
#[derive(Clone, Debug, PartialEq)]
pub struct MapAlignment {
    /// `T_a_b`.
    pub transform_a_b: Pose2,
    /// Covariance of (x, y, yaw), metres and radians.
    pub covariance: Matrix3<f64>,
    /// The length of wall on wall less that of wall on free space, weighted, metres.
    pub score: f64,
    /// The score as a share of that of the best guess, 0 to 1.
    pub share: f64,
    /// How far the score lies above that of the best place elsewhere, in units of the spread of all others; below 0 if it
    /// does not. By chance it is more than `t` with the probability `exp(-t)`.
    pub lead: f64,
    /// About the length of wall on which the maps agree, metres.
    pub wall_in_common: f64,
    /// The share of the walls of map b that meet walls, and not free space, of map a, 0 to 1.
    pub wall_agreement: f64,
}

/// What is known of how two maps lie to each other.
#[derive(Clone, Debug, PartialEq)]
pub struct MapAlignments {
    /// At least one, the best first, each away from the others.
    pub hypotheses: Vec<MapAlignment>,
    /// What the best place elsewhere scores of the best, 0 to 1. It need not be a hypothesis: it may lie on the slope
    /// of a wide peak, as along a corridor.
    pub runner_up_share: f64,
    /// How far that place is, metres, and how much the map is turned there, radians.
    pub runner_up_change: (f64, f64),
}

impl MapAlignments {
    /// What speaks for a guess, in plain words.
    pub fn reason(&self, rank: usize) -> String {
        let Some(found) = self.hypotheses.get(rank) else { return String::new() };
        let common = format!("the maps alone: {:.0} m of walls in common", found.wall_in_common);
        if rank > 0 {
            return format!("{common}, and they fit {:.0} % as well as at the best place", 100.0 * found.share);
        }
        let (shift, turn) = self.runner_up_change;
        let (turn, share) = (turn.to_degrees(), 100.0 * self.runner_up_share);
        format!(
            "{common}, and at the best of all other places, {shift:.1} m and {turn:.0} degrees away, they fit {share:.0} \
             % as well"
        )
    }
}

/// A robot's map, as it takes part.
#[derive(Clone, Copy, Debug)]
pub struct NamedMap<'a> {
    /// Whose it is.
    pub robot: &'a str,
    /// Its cells.
    pub grid: Grid<'a>,
}

/// Finds how map b may lie on map a.
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

/// Finds how map b may lie on map a, of two maps in cells of the same size, anywhere or in a window.
pub fn align_prepared(
    a: &PreparedMap,
    b: &PreparedMap,
    window: Option<&PlaceWindow>,
    parameters: &MapAlignerParameters,
) -> Result<MapAlignments, SearchRefusal> {
    let peaks = Peaks::find(a, b, window, parameters);
    let no_fit = || if window.is_some() { SearchRefusal::NoFitInWindow } else { SearchRefusal::NoFit };
    let best = peaks.all().first().ok_or_else(no_fit)?;
    let hypotheses = hypotheses(&peaks, best.score, a, b, parameters);
    let best_found = hypotheses.first().ok_or_else(no_fit)?;
    let (length, least) = (best_found.alignment.wall_in_common, parameters.min_wall_length);
    if length < least {
        return Err(SearchRefusal::TooLittleInCommon { length, least });
    }
    let centre = &best_found.common.centre;
    let elsewhere = peaks.best_elsewhere(&best.transform_a_b, centre, parameters);
    Ok(MapAlignments {
        runner_up_share: elsewhere.map_or(0.0, |place| (place.score / best.score).min(1.0)),
        runner_up_change: elsewhere
            .map_or((0.0, 0.0), |place| change(&best.transform_a_b, &place.transform_a_b, centre)),
        hypotheses: hypotheses.into_iter().map(|found| found.alignment).collect(),
    })
}

/// Where a map lies on itself best, but for where it is: `T_map_map` of places at which the building may look alike, the best first.
pub fn self_similar_places(map: &PreparedMap, parameters: &MapAlignerParameters) -> Vec<Pose2> {
    let (peaks, here) = (Peaks::find(map, map, None, parameters), Pose2::identity());
    let itself = overlay(map, map, JUDGED, parameters.free_space_penalty).common_walls(&here);
    let (Some(best), Some(itself)) = (peaks.all().first(), itself) else { return Vec::new() };
    let all = MapAlignerParameters { max_hypotheses: 1 + SELF_SIMILAR, least_share: 0.0, ..parameters.clone() };
    let found = hypotheses(&peaks, best.score, map, map, &all).into_iter().map(|found| found.alignment.transform_a_b);
    found.filter(|place| !is_near(&here, place, &itself.centre, parameters)).collect()
}

/// The guess at the peak near a place that is known from elsewhere, without a search. `None` if the walls of the maps do
/// not meet there, or contradict each other as much. `lead` is that of the search in which it was found.
pub fn align_near(
    a: &PreparedMap,
    b: &PreparedMap,
    transform_a_b: &Pose2,
    lead: f64,
    parameters: &MapAlignerParameters,
) -> Option<MapAlignment> {
    let judged = overlay(a, b, JUDGED, parameters.free_space_penalty);
    let common = judged.common_walls(transform_a_b)?;
    let peak = Place { transform_a_b: *transform_a_b, score: judged.faced_score(transform_a_b) };
    let mut found = Hypothesis::at(&peak, 1.0, &common, a, b, parameters)?.alignment;
    found.score = judged.faced_score(&found.transform_a_b);
    found.share = 1.0;
    found.lead = lead;
    (found.score > 0.0).then_some(found)
}

/// The guesses that peaks lead to, each away from the others, the best first.
fn hypotheses(
    peaks: &Peaks,
    best_score: f64,
    a: &PreparedMap,
    b: &PreparedMap,
    parameters: &MapAlignerParameters,
) -> Vec<Hypothesis> {
    let judged = overlay(a, b, JUDGED, parameters.free_space_penalty);
    let looked_at = parameters.max_hypotheses.saturating_add(SPARE);
    let mut apart: Vec<(Place, CommonWalls)> = Vec::new();
    for peak in peaks.all() {
        let is_same = |(known, common): &(Place, CommonWalls)| {
            is_near(&known.transform_a_b, &peak.transform_a_b, &common.centre, parameters)
        };
        if apart.len() <= OTHERS.max(looked_at) && !apart.iter().any(is_same) {
            apart.extend(judged.common_walls(&peak.transform_a_b).map(|common| (*peak, common)));
        }
    }
    let refined = apart[..apart.len().min(looked_at)]
        .par_iter()
        .filter_map(|(peak, common)| Hypothesis::at(peak, best_score, common, a, b, parameters));
    let mut hypotheses: Vec<Hypothesis> = Vec::new();
    for found in refined.collect::<Vec<_>>() {
        // Places on the slope of a peak lead to its top.
        let is_same = hypotheses.iter().any(|known| known.is_near(&found.alignment.transform_a_b, parameters));
        let is_wanted = hypotheses.len() < 2 || found.alignment.share >= parameters.least_share;
        if is_wanted && !is_same {
            hypotheses.push(found);
        }
    }
    hypotheses.truncate(parameters.max_hypotheses);
    for found in &mut hypotheses {
        let others = apart.iter().filter(|(peak, _)| !found.is_near(&peak.transform_a_b, parameters));
        let others: Vec<f64> = others.map(|(peak, _)| peak.score).collect();
        found.alignment.lead = lead(found.alignment.score, &others);
    }
    hypotheses
}

/// A guess, with what it takes to tell others from it.
struct Hypothesis {
    alignment: MapAlignment,
    common: CommonWalls,
}

impl Hypothesis {
    /// The guess that a peak leads to.
    fn at(
        peak: &Place,
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
            lead: 0.0,
            wall_in_common: common.length,
            wall_agreement: common.agreement,
        };
        Some(Self { alignment, common })
    }

    fn is_near(&self, place: &Pose2, parameters: &MapAlignerParameters) -> bool {
        is_near(&self.alignment.transform_a_b, place, &self.common.centre, parameters)
    }
}
