//! The search over all places.

use super::correlation::{Correlator, ScoredShift, Workspace};
use super::raster::Raster;
use crate::registration::place_window::PlaceWindow;
use crate::shared::geometry::{Pose2, pose};
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

/// Rotations within half a turn: some or all of those that are spread evenly over it.
#[derive(Clone, Debug, PartialEq)]
pub struct Rotations {
    /// How many there are in half a turn.
    count: usize,
    /// The numbers of those that are meant.
    numbers: Vec<usize>,
}

impl Rotations {
    /// All of those that lie `step` radians apart, or a little less.
    pub fn all(step: f64) -> Self {
        let count = (PI / step - 1e-9).ceil() as usize;
        Self { count, numbers: (0..count).collect() }
    }

    /// Of those that lie `step` apart the ones that are nearest to rotations at which places were found, to those of the first places
    /// first, and `most` at the most. The places were found at rotations of `self`.
    pub fn nearest_to(&self, places: &[Place], step: f64, most: usize) -> Self {
        let Self { count, mut numbers } = Self::all(step);
        let nearest = |angle: f64| (angle / self.step()).round().rem_euclid(self.count as f64) as usize;
        let mut of_each = vec![Vec::new(); self.count];
        for number in numbers.drain(..) {
            of_each[nearest(PI * number as f64 / count as f64)].push(number);
        }
        for place in places {
            let near = std::mem::take(&mut of_each[nearest(place.transform_a_b.rotation.angle())]);
            if numbers.len() + near.len() > most {
                break;
            }
            numbers.extend(near);
        }
        numbers.sort_unstable();
        Self { count, numbers }
    }

    /// How far they lie apart, radians.
    pub fn step(&self) -> f64 {
        PI / self.count as f64
    }

    fn angles(&self) -> impl Iterator<Item = f64> {
        self.numbers.iter().map(|number| PI * *number as f64 / self.count as f64)
    }
}

/// Tries every place of map `b` on map `a`, to a cell of twice the width of those of the rasters, at the given `rotations` and at half
/// a turn more. Gives the best `most` of the places that are the best at their rotation within some square of `spacing` metres, the
/// best first. Where there is a `window`, every place in it is taken, and none outside.
pub fn search(
    a: &Raster,
    b: &Raster,
    window: Option<&PlaceWindow>,
    rotations: &Rotations,
    penalty: f64,
    spacing: f64,
    most: usize,
) -> Vec<Place> {
    let step = rotations.step();
    let may_turn = |angle: f64| window.is_none_or(|window| window.contains_yaw(angle, step));
    let angles: Vec<f64> = rotations.angles().filter(|angle| may_turn(*angle) || may_turn(angle + PI)).collect();
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

#[cfg(test)]
mod tests {
    use super::*;

    fn places(angles: &[f64]) -> Vec<Place> {
        angles.iter().map(|angle| Place { transform_a_b: pose(0.0, 0.0, *angle), score: 1.0 }).collect()
    }

    #[test]
    fn rotations_are_spread_over_half_a_turn() {
        let all = Rotations::all(0.03);
        let angles: Vec<f64> = all.angles().collect();
        assert_eq!(angles.len(), 105);
        assert!(all.step() <= 0.03 && angles[0] == 0.0 && angles[104] + all.step() > PI - 1e-9);
    }

    #[test]
    fn narrow_rotations_lie_about_the_best_places_of_wide_ones() {
        let wide = Rotations::all(PI / 90.0);
        // Half a turn on, a map lies at the same rotation but for a half turn.
        let near = wide.nearest_to(&places(&[PI / 2.0, -PI / 2.0, 1e-9, 1.0]), PI / 360.0, 9);
        let angles: Vec<f64> = near.angles().collect();
        assert_eq!(angles.len(), 8, "the fourth place would be one too many: {angles:?}");
        let is_near = |angle: &f64| [0.0, PI / 2.0, PI].iter().any(|of| (angle - of).abs() <= PI / 180.0 + 1e-9);
        assert!(angles.iter().all(is_near), "{angles:?}");
        assert_eq!(near.step(), PI / 360.0);
        assert_eq!(wide.nearest_to(&[], PI / 360.0, 9).angles().count(), 0);
    }
}
