//! The search in cells of several sizes, at rotations of a spacing that suits each.
//!
//! Large maps are searched in wide cells first, which tolerate deformation, and then in narrow ones, which still
//! resolve rooms: of a building that is much longer than its rooms, wide cells show hardly anything but walls.

use super::Extent;
use super::exhaustive::{Rotations, ScoredPose, search};
use super::prepared_map::JUDGED;
use super::{Content, MapAlignerParameters, PreparedMap, Raster};

/// Maps that are longer, in cells of the search, are searched in wider ones.
const MOST_CELLS: usize = 320;
/// Number of cell sizes in which maps are searched at all rotations, each twice as wide as the one before: the narrow
/// ones for small maps with little in common, and the wide ones for deformed maps.
const SCALES: usize = 2;
/// Number of rotations in the narrowest cells where these need a spacing too small to try all. Those nearest to the
/// best poses in wider cells are tried: as walls are at right angles, poses that fit at all have few rotations.
const NARROW_ROTATIONS: usize = 90;
/// Bound of the penalty: cells as wide as the space between walls are useless with any.
const MOST_PENALTY: f64 = 100.0;
/// Number of poses from the search in cells of one size.
const MOST_POSES: usize = 1024;

/// Poses of the search in cells of one size.
pub(super) struct PosesAtScale {
    /// Level of the prepared maps.
    pub(super) level: usize,
    /// Spacing of the rotations, radians.
    pub(super) step: f64,
    /// The poses, the best first.
    pub(super) poses: Vec<ScoredPose>,
}

/// Searches the poses of map b in map a, to an extent; the scales from narrow cells to wide ones.
pub(super) fn search_scales(
    a: &PreparedMap,
    b: &PreparedMap,
    extent: Extent<'_>,
    parameters: &MapAlignerParameters,
) -> Vec<PosesAtScale> {
    let step = 2.0 * parameters.rotation_step;
    let close_step = |level: usize| close_step(a, b, level);
    let narrowest = a.level_of_size(2 * MOST_CELLS).max(b.level_of_size(2 * MOST_CELLS)).max(JUDGED);
    let search_at = |level: usize, rotations: &Rotations| {
        let (coarse_a, coarse_b) = (a.level(level), b.level(level));
        let MapAlignerParameters { free_space_penalty, apart, .. } = *parameters;
        // Wide cells are for deformed maps, which contradict each other at the right pose, too.
        let penalty = match level == narrowest {
            true => free_space_penalty.max(chance_penalty(coarse_a, coarse_b)),
            false => free_space_penalty,
        };
        let poses = search(coarse_a, coarse_b, extent.window(), rotations, penalty, apart, MOST_POSES);
        PosesAtScale { level, step: rotations.step(), poses }
    };
    let all_rotations = |level: usize| {
        let all = Rotations::all(step.min(close_step(level)));
        // The inverses of the others are within a quarter of a turn, or half a turn more.
        if matches!(extent, Extent::Itself { .. }) { all.within_quarter_turn() } else { all }
    };
    // A window holds few poses, so the narrowest cells find the right one.
    if extent.window().is_some() {
        return vec![search_at(narrowest, &all_rotations(narrowest))];
    }
    let is_close = |level: &usize| step <= close_step(*level);
    let first = (narrowest..narrowest + SCALES).find(is_close).unwrap_or(narrowest + SCALES - 1);
    let rotations = all_rotations(first);
    let found = search_at(first, &rotations);
    let narrow = (first > narrowest)
        .then(|| search_at(narrowest, &rotations.nearest_to(&found.poses, close_step(narrowest), NARROW_ROTATIONS)));
    let wider = (first + 1..first + SCALES).map(|level| search_at(level, &all_rotations(level)));
    narrow.into_iter().chain([found]).chain(wider).collect()
}

/// Spacing of rotations, radians, at which the ends of the shorter map move by less than one cell of a level (which
/// are twice as wide in the search) by half of it. With a wider spacing the right pose could be missed between two
/// rotations.
fn close_step(a: &PreparedMap, b: &PreparedMap, level: usize) -> f64 {
    4.0 * a.level(level).cell / a.radius().min(b.radius())
}

/// Penalty at which a random relative pose scores 0 in the mean. With less of a penalty, maps with little free space
/// would score by their overlap, wherever that is.
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
    fn a_random_pose_scores_nothing_in_the_mean() {
        let (a, b) = (raster(6, 2, 5), raster(9, 3, 0));
        // Of 8 times 12 pairs of known cells.
        let (on_walls, on_free) = (6.0 * 9.0, 6.0 * 3.0 + 2.0 * 9.0);
        assert!((on_walls - chance_penalty(&a, &b) * on_free).abs() < 1e-9);
        assert!(chance_penalty(&raster(1, 9, 0), &raster(1, 9, 0)) < 0.1);
        assert_eq!(chance_penalty(&raster(9, 0, 0), &raster(9, 0, 0)), MOST_PENALTY);
        assert_eq!(chance_penalty(&raster(0, 0, 9), &a), 0.0);
    }
}
