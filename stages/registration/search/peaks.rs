//! The relative poses at which two maps fit best, each apart from the others.

use super::coordinate_ascent::{Steps, coordinate_ascent};
use super::exhaustive::ScoredPose;
use super::overlay::Overlay;
use super::prepared_map::JUDGED;
use super::scales::{PosesAtScale, search_scales};
use super::{MapAlignerParameters, PreparedMap};
use crate::registration::pose_window::PoseWindow;
use crate::shared::geometry::{Point2, Pose2, turn_difference};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Least share of the common walls that both maps see from the same side: less shows two adjacent buildings.
const FACED: f64 = 0.5;
/// Number of distinct poses of the search in cells of one size that are refined.
const CANDIDATES: usize = 64;

/// Distinct poses that were scored in the same way, the best first.
#[derive(Clone, Debug, PartialEq)]
pub struct Peaks {
    /// Poses of the search and of the ascent from there: the best one, then all that are elsewhere.
    visited: Vec<ScoredPose>,
    /// The peaks that they converge to.
    peaks: Vec<ScoredPose>,
}

/// Which relative poses are searched.
#[derive(Clone, Copy, Debug)]
pub enum Extent<'a> {
    /// All.
    All,
    /// Those in a window.
    Window(&'a PoseWindow),
    /// All of a map on itself with at least so much common wall, approximately, metres.
    Itself {
        /// The length.
        least_wall: f64,
    },
}

impl<'a> Extent<'a> {
    /// All, or those in a window.
    pub fn of(window: Option<&'a PoseWindow>) -> Self {
        window.map_or(Self::All, Self::Window)
    }

    /// The window; none if there is none.
    pub fn window(self) -> Option<&'a PoseWindow> {
        if let Self::Window(window) = self { Some(window) } else { None }
    }
}

impl Peaks {
    /// Searches the poses of map b in map a, to an extent.
    pub fn find(a: &PreparedMap, b: &PreparedMap, extent: Extent<'_>, parameters: &MapAlignerParameters) -> Self {
        let penalty = parameters.free_space_penalty;
        let least_wall = if let Extent::Itself { least_wall } = extent { least_wall } else { 0.0 };
        let candidates: Vec<(usize, f64, (Pose2, Point2))> = search_scales(a, b, extent, parameters)
            .into_iter()
            .flat_map(|PosesAtScale { level, step, poses }| {
                let overlay = overlay(a, b, level, penalty);
                let apart = apart_from_better(&overlay, &poses, parameters, 2.0 * step, least_wall);
                apart.into_iter().map(move |candidate| (level, step, candidate))
            })
            .collect();
        let ways = candidates.par_iter().map(|(level, step, (start, centre))| {
            let mut pose = *start;
            for number in (JUDGED..=*level).rev() {
                let walls = (a.few_walls(), b.few_walls());
                let overlay = Overlay { walls_a: walls.0, walls_b: walls.1, ..overlay(a, b, number, penalty) };
                let radians = 0.5 * step / (1 << (level - number)) as f64;
                let steps = Steps { metres: overlay.a.cell, radians, halvings: 1 };
                pose = coordinate_ascent(|pose| overlay.score(pose), &pose, centre, steps).transform_a_b;
            }
            let overlay = overlay(a, b, JUDGED, penalty);
            let judged =
                |transform_a_b: Pose2| ScoredPose { transform_a_b, score: overlay.faced_score(&transform_a_b) };
            (judged(*start), judged(pose))
        });
        let (starts, mut peaks): (Vec<ScoredPose>, Vec<ScoredPose>) = ways.collect::<Vec<_>>().into_iter().unzip();
        if matches!(extent, Extent::Itself { .. }) {
            let inverse = |pose: &ScoredPose| ScoredPose { transform_a_b: pose.transform_a_b.inverse(), ..*pose };
            peaks.extend(peaks.iter().map(inverse).collect::<Vec<_>>());
        }
        let is_possible =
            |pose: &ScoredPose| extent.window().is_none_or(|window| window.contains(&pose.transform_a_b, 0.0, 0.0));
        peaks.retain(|pose| pose.score > 0.0 && is_possible(pose));
        peaks.sort_by(ScoredPose::best_first);
        let mut visited = [starts, peaks.clone()].concat();
        visited.retain(is_possible);
        visited.sort_by(ScoredPose::best_first);
        Self { visited, peaks }
    }

    /// The peaks, the best first.
    pub fn all(&self) -> &[ScoredPose] {
        &self.peaks
    }

    /// The best pose that is apart from a given one, whose common walls have the centroid `centre`, if its score is
    /// positive. It may be on the slope of a wide peak.
    pub fn best_elsewhere(
        &self,
        pose: &Pose2,
        centre: &Point2,
        parameters: &MapAlignerParameters,
    ) -> Option<&ScoredPose> {
        let place = Place::new(pose, centre);
        let mut elsewhere = self.visited.iter().filter(|other| {
            other.score > 0.0 && place.is_apart(&other.transform_a_b, parameters.apart, parameters.apart_yaw)
        });
        elsewhere.next()
    }
}

/// The first of some poses within `apart` and `radians` at which there is at least so much common wall, metres, most of
/// it seen from the same side, each with the centroid of its common walls.
fn apart_from_better(
    overlay: &Overlay<'_>,
    poses: &[ScoredPose],
    parameters: &MapAlignerParameters,
    radians: f64,
    least_wall: f64,
) -> Vec<(Pose2, Point2)> {
    let mut kept: Vec<(Pose2, Point2)> = Vec::new();
    let mut places: Vec<Place> = Vec::new();
    for ScoredPose { transform_a_b, .. } in poses {
        if places.iter().all(|place| place.is_apart(transform_a_b, parameters.apart, radians)) {
            let common = overlay.common_walls(transform_a_b);
            let common = common.filter(|common| common.length >= least_wall);
            let common = common.filter(|common| common.faced_length >= FACED * common.length);
            if let Some(common) = common {
                kept.push((*transform_a_b, common.centre));
                places.push(Place::new(transform_a_b, &common.centre));
            }
        }
        if kept.len() == CANDIDATES {
            break;
        }
    }
    kept
}

/// Overlay of two maps, in the cells of a level.
pub(crate) fn overlay<'a>(a: &'a PreparedMap, b: &'a PreparedMap, level: usize, penalty: f64) -> Overlay<'a> {
    Overlay { a: a.level(level), b: b.level(level), walls_a: a.walls(), walls_b: b.walls(), penalty }
}

/// A pose, and a point of map b there, with which many poses are compared.
struct Place {
    yaw: f64,
    /// The point in frame a and in frame b.
    centre_a: Point2,
    centre_b: Point2,
}

impl Place {
    fn new(transform_a_b: &Pose2, centre: &Point2) -> Self {
        let centre_b = transform_a_b.inverse() * centre;
        Self { yaw: transform_a_b.rotation.angle(), centre_a: *centre, centre_b }
    }

    /// Whether the point is more than `apart` away at another pose, or that is turned by more than `radians`.
    fn is_apart(&self, other: &Pose2, apart: f64, radians: f64) -> bool {
        self.shift(other) > apart || self.turn(other).abs() > radians
    }

    fn shift(&self, other: &Pose2) -> f64 {
        (other * self.centre_b - self.centre_a).norm()
    }

    fn turn(&self, other: &Pose2) -> f64 {
        turn_difference(other.rotation.angle(), self.yaw, TAU)
    }
}

/// Distance of a point of map b, at `centre` in frame a, from one transform to another, metres, and the rotation,
/// radians.
pub(super) fn change(one: &Pose2, other: &Pose2, centre: &Point2) -> (f64, f64) {
    let place = Place::new(one, centre);
    (place.shift(other), place.turn(other))
}

/// Whether two poses are the same, where `centre` is the centroid of the common walls at the first.
pub(crate) fn is_near(one: &Pose2, other: &Pose2, centre: &Point2, parameters: &MapAlignerParameters) -> bool {
    let (metres, radians) = change(one, other, centre);
    metres <= parameters.apart && radians.abs() <= parameters.apart_yaw
}
