//! What chance reaches: how well maps with walls like these fit where they do not belong.
//!
//! The mirror image of a map has the same walls, rooms and clutter, and fits nowhere, but by chance. So its best pose
//! in a search like that of the map itself shows what the best pose of such maps reaches by chance: it is a decoy, as
//! in Elias and Gygi, "Target-decoy search strategy" (Nature Methods 2007). It is searched in full, also where the
//! initial poses leave few poses of the map itself, as the best of fewer poses would reach less. Where the second-best
//! pose of the map itself comes near the best one, that shows it already.

use super::{Extent, MapAlignerParameters, Peaks, PreparedMap, ScoredPose};

/// Share of the best score from which on the second-best pose shows what chance reaches.
const NEARLY_AS_GOOD: f64 = 0.75;
/// Score that is added to that of a pose, metres of wall: a large margin over chance on little wall is little evidence.
const MORE_SCORE: f64 = 6.0;

/// The best score that maps like a and b reach by chance, metres of wall, where `second` is the second-best pose.
pub(super) fn chance_score(
    a: &PreparedMap,
    b: &PreparedMap,
    best: &ScoredPose,
    second: Option<&ScoredPose>,
    parameters: &MapAlignerParameters,
) -> f64 {
    let second = second.map_or(0.0, |second| second.score);
    if second >= NEARLY_AS_GOOD * best.score {
        return second;
    }
    let decoys = Peaks::find(a, &b.mirrored(), Extent::All, parameters);
    decoys.all().first().map_or(0.0, |decoy| decoy.score)
}

/// Margin of a score over what chance reaches, as a share of it: 0, if it is no more, to 1.
pub(super) fn margin(score: f64, by_chance: f64) -> f64 {
    ((score - by_chance) / (score + MORE_SCORE)).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::super::{NamedMap, align_maps};
    use super::*;
    use crate::shared::test_world::floor_plan::{DrawnMap, FloorPlan, drawing, seen};

    #[test]
    fn the_margin_is_large_on_much_wall_that_chance_does_not_reach() {
        assert_eq!((margin(20.0, 20.0), margin(20.0, 30.0), margin(0.0, 0.0)), (0.0, 0.0, 0.0));
        assert!(margin(100.0, 20.0) > 0.7 && margin(5.0, 1.0) < 0.4 && margin(1e9, 0.0) <= 1.0);
    }

    #[test]
    fn parts_of_one_building_fit_better_than_a_mirror_image_and_those_of_two_do_not() {
        let a = FloorPlan::office().draw(seen(-1.0, -1.0, 15.0, 13.0), drawing(3.0, 2.0, 0.4));
        let margin_of = |plan: FloorPlan| {
            let b = plan.draw(seen(4.0, -1.0, 21.0, 13.0), drawing(12.0, 6.0, -2.1));
            let [a, b] =
                [("a", &a), ("b", &b)].map(|(robot, map): (_, &DrawnMap)| NamedMap { robot, grid: map.view().grid });
            let found = align_maps(&a, &b, &MapAlignerParameters::default()).unwrap();
            found.hypotheses[0].margin
        };
        let (same, other) = (margin_of(FloorPlan::office()), margin_of(FloorPlan::another_office()));
        assert!(same > 0.3 && other < 0.15, "{same} {other}");
    }
}
