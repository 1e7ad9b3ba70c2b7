//! The search over all places.

use super::correlation::{Correlator, ScoredShift, Workspace};
use super::raster::Raster;
use crate::geometry::{Pose2, pose};
use crate::place_window::PlaceWindow;
use nalgebra::Vector2;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::f64::consts::PI;

/// As many places are taken from one rotation.
const MOST_AT_ONE: usize = 64;

/// A place of map b on map a.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// `T_a_b`.
    pub transform_a_b: Pose2,
    /// How well the maps fit there. Only scores that were made in the same way can be compared.
    pub score: f64,
}

impl Place {
    /// The better of two places comes first.
    pub(super) fn best_first(&self, other: &Self) -> Ordering {
        other.score.total_cmp(&self.score)
    }
}

/// Tries every place of map `b` on map `a`, to a cell of twice the width of those of the rasters, at twice `half_turns`
/// rotations that are evenly spread over a full turn. Gives the best `most` of the places that are the best at
/// their rotation within some square of `spacing` metres, the best first. Where there is a `window`, every place in it is
/// taken, and none outside.
pub fn search(
    a: &Raster,
    b: &Raster,
    window: Option<&PlaceWindow>,
    half_turns: usize,
    penalty: f64,
    spacing: f64,
    most: usize,
) -> Vec<Place> {
    let step = PI / half_turns as f64;
    let may_turn = |angle: f64| window.is_none_or(|window| window.contains_yaw(angle, step));
    let angles = (0..half_turns).map(|number| PI * number as f64 / half_turns as f64);
    let angles: Vec<f64> = angles.filter(|angle| may_turn(*angle) || may_turn(angle + PI)).collect();
    let (spacing, most_at_one) = if window.is_some() { (0.0, usize::MAX) } else { (spacing, MOST_AT_ONE) };
    let margin = 2.0 * a.cell;
    let may_lie = |place: &Place| window.is_none_or(|window| window.contains(&place.transform_a_b, margin, step));
    let size_b = angles.iter().fold(Vector2::zeros(), |most, angle| b.box_turned(*angle).1.sup(&most));
    let correlator = Correlator::new(a, size_b, penalty);
    let places_at = |workspace: &mut Workspace, angle: &f64| {
        correlator.correlate(b, *angle, workspace);
        let shifts = correlator.best_of_blocks(workspace, spacing, most_at_one);
        let both = [*angle, angle + PI].into_iter().zip(shifts).flat_map(|(angle, shifts)| {
            shifts.into_iter().map(move |ScoredShift { translation, score }| Place {
                transform_a_b: pose(translation.x, translation.y, angle),
                score,
            })
        });
        both.filter(may_lie).collect::<Vec<_>>()
    };
    let places: Vec<Vec<Place>> = angles.par_iter().map_init(|| correlator.workspace(), places_at).collect();
    let mut places = places.concat();
    places.sort_by(Place::best_first);
    places.truncate(most);
    places
}
