//! The search over all places.

use super::MapAlignerParameters;
use super::correlation::{BestShift, Correlator, Workspace};
use super::raster::{Content, Raster};
use crate::geometry::{Point2, Pose2, pose, turn_difference};
use nalgebra::Vector2;
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_4, TAU};

/// The length of wall in a cell that holds some, in sides of the cell: the mean over all directions in which a straight
/// wall may run (Cauchy and Crofton).
const WALL_PER_CELL: f64 = FRAC_PI_4;

/// A place of map b on map a.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// `T_a_b`.
    pub transform_a_b: Pose2,
    /// The number of cells of dilated wall that meet, less those that contradict each other.
    pub score: f64,
}

/// What the search has found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchResult {
    /// The best place.
    pub best: Peak,
    /// The best place elsewhere.
    pub runner_up: Peak,
    /// The middle of the walls in common at the best place, in frame a, metres.
    pub centre: Point2,
    /// About the length of the walls of map b that meet walls of map a there, metres.
    pub wall_in_common: f64,
    /// The share of these in the walls of map b that meet anything known, 0 to 1.
    pub wall_agreement: f64,
}

impl SearchResult {
    /// What the runner-up scores of the best, 0 to 1.
    pub fn runner_up_share(&self) -> f64 {
        (self.runner_up.score / self.best.score).clamp(0.0, 1.0)
    }

    /// How far the middle of the walls in common lies at the runner-up from where it lies at the best place, metres, and
    /// by how much map b is turned, radians.
    pub fn runner_up_change(&self) -> (f64, f64) {
        let change = self.runner_up.transform_a_b * self.best.transform_a_b.inverse();
        ((change * self.centre - self.centre).norm(), change.rotation.angle())
    }
}

/// Tries every place of map `b` on map `a`. `None` where walls of both maps meet nowhere without being contradicted by
/// as much.
pub fn search(a: &Raster, b: &Raster, parameters: &MapAlignerParameters) -> Option<SearchResult> {
    let count = parameters.rotations();
    let angles: Vec<f64> = (0..count).map(|number| TAU * number as f64 / count as f64).collect();
    let (width, height) = b.size_turned(&angles);
    let correlator = Correlator::new(a, width, height, parameters.free_space_penalty);
    let scored =
        |workspace: &mut Workspace, angle: f64, excluded: &dyn Fn(Vector2<f64>) -> Option<(Vector2<f64>, f64)>| {
            let turned = b.turned(angle);
            correlator.correlate(&turned, workspace);
            let offset = a.corner - turned.corner;
            let BestShift { shift, score } = correlator.best(workspace, excluded(offset));
            let translation = offset + shift * a.cell;
            Peak { transform_a_b: pose(translation.x, translation.y, angle), score }
        };
    let workspace = || correlator.workspace();
    let peaks: Vec<Peak> =
        angles.par_iter().map_init(workspace, |workspace, angle| scored(workspace, *angle, &|_| None)).collect();

    let best = best_of(&peaks).filter(|best| best.score > 0.0)?;
    let CommonWalls { centre, length, agreement } = common_walls(a, b, &best.transform_a_b)?;

    // At a rotation near the best one the place itself is left out.
    let centre_b = best.transform_a_b.inverse() * centre;
    let turn =
        |peak: &Peak| turn_difference(peak.transform_a_b.rotation.angle(), best.transform_a_b.rotation.angle(), TAU);
    let is_elsewhere = |peak: &Peak| turn(peak).abs() > parameters.apart_yaw;
    let others = peaks.par_iter().zip(&angles).map_init(workspace, |workspace, (peak, angle)| {
        if is_elsewhere(peak) {
            return *peak;
        }
        scored(workspace, *angle, &|offset| {
            let place = centre - peak.transform_a_b.rotation * centre_b - offset;
            Some((place / a.cell, parameters.apart / a.cell))
        })
    });
    let others: Vec<Peak> = others.collect();
    let runner_up = best_of(&others)?;
    Some(SearchResult { best, runner_up, centre, wall_in_common: length, wall_agreement: agreement })
}

/// The highest of some peaks; of equals the first.
fn best_of(peaks: &[Peak]) -> Option<Peak> {
    peaks.iter().copied().reduce(|best, peak| if peak.score > best.score { peak } else { best })
}

/// The walls of map b that meet walls of map a, to within a cell.
struct CommonWalls {
    /// Their middle, in frame a.
    centre: Point2,
    /// About their length, metres.
    length: f64,
    /// Their share in the walls of map b that meet anything known, 0 to 1.
    agreement: f64,
}

fn common_walls(a: &Raster, b: &Raster, transform_a_b: &Pose2) -> Option<CommonWalls> {
    let (mut sum, mut on_wall, mut on_free) = (Vector2::zeros(), 0.0, 0.0);
    for wall in b.wall_cells().map(|wall| transform_a_b * wall) {
        match a.at(&wall) {
            Content::Wall | Content::BesideWall => {
                sum += wall.coords;
                on_wall += 1.0;
            }
            Content::Free => on_free += 1.0,
            Content::Unknown => {}
        }
    }
    (on_wall > 0.0).then(|| CommonWalls {
        centre: Point2::from(sum / on_wall),
        length: on_wall * a.cell * WALL_PER_CELL,
        agreement: on_wall / (on_wall + on_free),
    })
}
