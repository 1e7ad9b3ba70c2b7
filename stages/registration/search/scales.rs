//! The search in cells of several sizes, at rotations that lie close enough for each.
//!
//! Large maps are searched in wide cells first, which bear with bends, and then in narrow ones, in which rooms can still be told from each
//! other: of a building that is much longer than its rooms, wide cells show hardly anything but walls.

use super::places::{Place, Rotations, search};
use super::prepared_map::JUDGED;
use super::{Content, MapAlignerParameters, PreparedMap, Raster};
use crate::registration::place_window::PlaceWindow;

/// Maps that are longer, in cells of the search, are searched in wider ones.
const MOST_CELLS: usize = 320;
/// Maps are searched at all rotations in cells of so many sizes, each twice as wide as the one before: the narrow ones for small maps, of
/// which little is in common, and the wide ones for those that are bent.
const SCALES: usize = 2;
/// In the narrowest cells that do not make the maps too long, rotations may have to lie too close to try them all. These are tried, those
/// nearest to the best places in wider cells: as walls stand at right angles, places that fit at all have few rotations.
const NARROW_ROTATIONS: usize = 90;
/// Cells as wide as the spaces between walls tell nothing, with any penalty.
const MOST_PENALTY: f64 = 100.0;
/// As many places are taken from the search in cells of one size.
const PLACES: usize = 1024;

/// What was found in cells of one size.
pub(super) struct Scale {
    /// The level of the prepared maps.
    pub(super) level: usize,
    /// How far the rotations lay apart, radians.
    pub(super) step: f64,
    /// The places, the best first.
    pub(super) places: Vec<Place>,
}

/// Searches for all places of map b on map a, or all in a window; the scales from narrow cells to wide ones.
pub(super) fn search_scales(
    a: &PreparedMap,
    b: &PreparedMap,
    window: Option<&PlaceWindow>,
    parameters: &MapAlignerParameters,
) -> Vec<Scale> {
    let step = 2.0 * parameters.rotation_step;
    let close_step = |level: usize| close_step(a, b, level);
    let narrowest = a.level_of_size(2 * MOST_CELLS).max(b.level_of_size(2 * MOST_CELLS)).max(JUDGED);
    let search_at = |level: usize, rotations: &Rotations| {
        let (coarse_a, coarse_b) = (a.level(level), b.level(level));
        let MapAlignerParameters { free_space_penalty, apart, .. } = *parameters;
        // Wide cells are for maps that are bent, which contradict each other at the right place, too.
        let penalty = match level == narrowest {
            true => free_space_penalty.max(chance_penalty(coarse_a, coarse_b)),
            false => free_space_penalty,
        };
        let places = search(coarse_a, coarse_b, window, rotations, penalty, apart, PLACES);
        Scale { level, step: rotations.step(), places }
    };
    let all_rotations = |level: usize| Rotations::all(step.min(close_step(level)));
    // A window holds few places, and the narrowest cells come by the right one.
    if window.is_some() {
        return vec![search_at(narrowest, &all_rotations(narrowest))];
    }
    let is_close = |level: &usize| step <= close_step(*level);
    let first = (narrowest..narrowest + SCALES).find(is_close).unwrap_or(narrowest + SCALES - 1);
    let rotations = all_rotations(first);
    let found = search_at(first, &rotations);
    let narrow = (first > narrowest)
        .then(|| search_at(narrowest, &rotations.nearest_to(&found.places, close_step(narrowest), NARROW_ROTATIONS)));
    let wider = (first + 1..first + SCALES).map(|level| search_at(level, &all_rotations(level)));
    narrow.into_iter().chain([found]).chain(wider).collect()
}

/// How far rotations may lie apart, radians, so that maps that are turned by half of that lie less than one cell of a level, which are
/// twice as wide in the search, beside their place at the ends of the shorter of them: or else the right place lies between two rotations.
fn close_step(a: &PreparedMap, b: &PreparedMap, level: usize) -> f64 {
    let radius = |map: &PreparedMap| {
        let raster = map.level(JUDGED);
        0.5 * raster.cell * (raster.width as f64).hypot(raster.height as f64)
    };
    4.0 * a.level(level).cell / radius(a).min(radius(b))
}

/// The penalty with which the score of two maps that are laid on each other by chance is 0 in the mean. Where most of what is known lies
/// beside walls, maps would score the more with less of a penalty, the more of them lies on each other, wherever that is.
fn chance_penalty(a: &Raster, b: &Raster) -> f64 {
    let share_of_walls = |raster: &Raster| {
        let count = |is: fn(&Content) -> bool| raster.cells.iter().filter(|content| is(content)).count() as f64;
        let (walls, free) = (count(|content| content.is_near_wall()), count(|content| *content == Content::Free));
        walls / (walls + free).max(1.0)
    };
    let (wall_a, wall_b) = (share_of_walls(a), share_of_walls(b));
    let one_is_free = wall_a * (1.0 - wall_b) + wall_b * (1.0 - wall_a);
    (wall_a * wall_b / one_is_free.max(f64::MIN_POSITIVE)).min(MOST_PENALTY)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    fn raster(walls: usize, free: usize, unknown: usize) -> Raster {
        let cells =
            [vec![Content::BesideWall; walls], vec![Content::Free; free], vec![Content::Unknown; unknown]].concat();
        Raster { corner: Vector2::zeros(), cell: 0.5, width: cells.len(), height: 1, cells }
    }

    #[test]
    fn what_lies_on_each_other_by_chance_scores_nothing_in_the_mean() {
        let (a, b) = (raster(6, 2, 5), raster(9, 3, 0));
        // Of 8 times 12 pairs of known cells.
        let (on_walls, on_free) = (6.0 * 9.0, 6.0 * 3.0 + 2.0 * 9.0);
        assert!((on_walls - chance_penalty(&a, &b) * on_free).abs() < 1e-9);
        assert!(chance_penalty(&raster(1, 9, 0), &raster(1, 9, 0)) < 0.1);
        assert_eq!(chance_penalty(&raster(9, 0, 0), &raster(9, 0, 0)), MOST_PENALTY);
        assert_eq!(chance_penalty(&raster(0, 0, 9), &a), 0.0);
    }
}
