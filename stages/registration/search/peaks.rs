//! The places at which two maps fit best, each away from the others.

use super::climb::{Steps, climb};
use super::overlay::Overlay;
use super::places::Place;
use super::prepared_map::JUDGED;
use super::scales::{Scale, search_scales};
use super::{MapAlignerParameters, PreparedMap};
use crate::registration::place_window::PlaceWindow;
use crate::shared::geometry::{Point2, Pose2, turn_difference};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Less than this share of the walls in common is seen from the same side where two buildings lie back to back.
const FACED: f64 = 0.5;
/// As many places of those found in cells of one size, each away from the others, are looked at closely.
const CANDIDATES: usize = 64;

/// Places that were judged in the same way, the best first.
#[derive(Clone, Debug, PartialEq)]
pub struct Peaks {
    /// Where the search and the way up from there came by: the best place, then all that are elsewhere.
    visited: Vec<Place>,
    /// The peaks that it led to.
    peaks: Vec<Place>,
}

impl Peaks {
    /// Searches for all places of map b on map a, or all in a window.
    pub fn find(
        a: &PreparedMap,
        b: &PreparedMap,
        window: Option<&PlaceWindow>,
        parameters: &MapAlignerParameters,
    ) -> Self {
        let penalty = parameters.free_space_penalty;
        let candidates: Vec<(usize, f64, (Pose2, Point2))> = search_scales(a, b, window, parameters)
            .into_iter()
            .flat_map(|Scale { level, step, places }| {
                let overlay = overlay(a, b, level, penalty);
                let apart = apart_from_better(&overlay, &places, parameters, 2.0 * step);
                apart.into_iter().map(move |candidate| (level, step, candidate))
            })
            .collect();
        let ways = candidates.par_iter().map(|(level, step, (start, centre))| {
            let mut place = *start;
            for number in (JUDGED..=*level).rev() {
                let walls = (a.few_walls(), b.few_walls());
                let overlay = Overlay { walls_a: walls.0, walls_b: walls.1, ..overlay(a, b, number, penalty) };
                let radians = 0.5 * step / (1 << (level - number)) as f64;
                let steps = Steps { metres: overlay.a.cell, radians, halvings: 1 };
                place = climb(|place| overlay.score(place), &place, centre, steps).transform_a_b;
            }
            let overlay = overlay(a, b, JUDGED, penalty);
            let judged = |transform_a_b: Pose2| Place { transform_a_b, score: overlay.faced_score(&transform_a_b) };
            (judged(*start), judged(place))
        });
        let (starts, mut peaks): (Vec<Place>, Vec<Place>) = ways.collect::<Vec<_>>().into_iter().unzip();
        let is_possible = |place: &Place| window.is_none_or(|window| window.contains(&place.transform_a_b, 0.0, 0.0));
        peaks.retain(|place| place.score > 0.0 && is_possible(place));
        peaks.sort_by(Place::best_first);
        let mut visited = [starts, peaks.clone()].concat();
        visited.retain(is_possible);
        visited.sort_by(Place::best_first);
        Self { visited, peaks }
    }

    /// The peaks, the best first.
    pub fn all(&self) -> &[Place] {
        &self.peaks
    }

    /// The best place that is apart from a given one, of whose walls in common `centre` is the middle, if it scores at
    /// all. It may lie on the slope of a peak that is wide.
    pub fn best_elsewhere(&self, place: &Pose2, centre: &Point2, parameters: &MapAlignerParameters) -> Option<&Place> {
        let mut elsewhere = self.visited.iter().filter(|other| {
            let (metres, radians) = change(place, &other.transform_a_b, centre);
            other.score > 0.0 && (metres > parameters.apart || radians.abs() > parameters.apart_yaw)
        });
        elsewhere.next()
    }
}

/// The first of some places within `apart` and `radians` at which most walls in common are seen from the same side, each with the
/// middle of its walls in common.
fn apart_from_better(
    overlay: &Overlay<'_>,
    places: &[Place],
    parameters: &MapAlignerParameters,
    radians: f64,
) -> Vec<(Pose2, Point2)> {
    let mut kept: Vec<(Pose2, Point2)> = Vec::new();
    for Place { transform_a_b, .. } in places {
        let is_apart = |(other, centre): &(Pose2, Point2)| {
            let (shift, turn) = change(other, transform_a_b, centre);
            shift > parameters.apart || turn.abs() > radians
        };
        if kept.iter().all(is_apart) {
            let common = overlay.common_walls(transform_a_b);
            let common = common.filter(|common| common.faced_length >= FACED * common.length);
            kept.extend(common.map(|common| (*transform_a_b, common.centre)));
        }
        if kept.len() == CANDIDATES {
            break;
        }
    }
    kept
}

/// Two maps on each other, in the cells of a level.
pub(crate) fn overlay<'a>(a: &'a PreparedMap, b: &'a PreparedMap, level: usize, penalty: f64) -> Overlay<'a> {
    Overlay { a: a.level(level), b: b.level(level), walls_a: a.walls(), walls_b: b.walls(), penalty }
}

/// How far a point of map b that lies at `centre` in frame a is moved from one transform to another, metres, and by how
/// much the map is turned, radians.
pub(super) fn change(one: &Pose2, other: &Pose2, centre: &Point2) -> (f64, f64) {
    let moved = other * (one.inverse() * centre);
    let turn = turn_difference(other.rotation.angle(), one.rotation.angle(), TAU);
    ((moved - centre).norm(), turn)
}

/// Whether two places are one, `centre` being the middle of the walls in common at the first.
pub(crate) fn is_near(one: &Pose2, other: &Pose2, centre: &Point2, parameters: &MapAlignerParameters) -> bool {
    let (metres, radians) = change(one, other, centre);
    metres <= parameters.apart && radians.abs() <= parameters.apart_yaw
}
