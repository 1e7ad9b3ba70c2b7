//! Agreement of the details of a building: of furniture, pillars, niches and the pieces of wall between doors.
//!
//! The long walls of two wings of a building are alike, and so are those of rooms in a row. What stands in them is not:
//! at the wrong one of two places that are alike, long walls agree and details contradict each other. So agreement
//! is measured for details alone, too.
//!
//! A thing in the middle of a room shows most: a wall that is drawn roughly, or is a little off as its map is deformed,
//! looks like a short piece of wall in conflict, but is near a wall of the other map.

use super::MapView;
use super::regions::{ComparedWall, Finding};
use crate::shared::geometry::Pose2;
use crate::shared::walls::WallExtent;

// All three were chosen by cross-validation, with the weights of the judgement.
/// A connected component of less extent is a thing in a room, metres.
const SMALL_COMPONENT: f64 = 3.0;
/// A straight segment of less extent is a detail of a wall, metres.
const SHORT_SEGMENT: f64 = 1.5;
/// A thing is on open floor where the other map has no wall within this, metres.
const OPEN_FLOOR: f64 = 1.0;
/// Added to both lengths before taking their ratio, metres: a thing or two that were moved are little evidence.
const MORE_WALL: f64 = 5.0;

/// Lengths of wall of one map at which the other map is known, metres; the mean of both directions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WallLengths {
    /// Inlier length.
    pub inlier: f64,
    /// Conflict length.
    pub conflict: f64,
}

impl WallLengths {
    /// Logarithm of the ratio of inliers to conflicts.
    pub fn log_ratio(&self) -> f64 {
        ((self.inlier + MORE_WALL) / (self.conflict + MORE_WALL)).ln()
    }
}

/// Agreement of the details of two maps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Details {
    /// Small connected components, as furniture and pillars are.
    pub components: WallLengths,
    /// Short straight segments of walls, and of small components.
    pub segments: WallLengths,
    /// Length of the outlines of small connected components that stand on open floor of the other map, of both maps,
    /// metres.
    pub on_open_floor: f64,
}

impl Details {
    /// Whether less of the short segments agrees than not.
    pub fn contradict(&self) -> bool {
        self.segments.inlier < self.segments.conflict
    }

    /// The details among the walls that were compared with map b at `transform_a_b`.
    pub(super) fn of(a: &MapView<'_>, b: &MapView<'_>, transform_a_b: &Pose2, compared: &[ComparedWall]) -> Self {
        let transform_b_a = transform_a_b.inverse();
        let mut details = Self::default();
        for wall in compared {
            let (map, other) = if wall.of_b { (b.walls, a.walls) } else { (a.walls, b.walls) };
            let WallExtent { component, segment } = map.extents[wall.index];
            // Both directions are summed, so each counts one half.
            let length = 0.5 * map.spacing;
            for (lengths, is_meant) in [
                (&mut details.components, component < SMALL_COMPONENT),
                (&mut details.segments, segment < SHORT_SEGMENT),
            ] {
                match wall.finding {
                    Finding::Inlier if is_meant => lengths.inlier += length,
                    Finding::Beside | Finding::Conflict if is_meant => lengths.conflict += length,
                    _ => {}
                }
            }
            if wall.finding == Finding::Conflict && component < SMALL_COMPONENT {
                let in_other = if wall.of_b { wall.point } else { transform_b_a * wall.point };
                if other.walls.nearest(&in_other, OPEN_FLOOR).is_none() {
                    details.on_open_floor += map.spacing;
                }
            }
        }
        details
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::comparison::compare;
    use crate::registration::judgement::JudgementParameters;
    use crate::shared::geometry::pose;
    use crate::shared::test_world::floor_plan::{DrawnMap, FloorPlan, drawing, seen};
    use std::f64::consts::PI;

    /// A table of 1.2 m x 0.8 m.
    fn table(x: f64, y: f64) -> [[f64; 4]; 4] {
        [[x, y, x + 1.2, y], [x + 1.2, y, x + 1.2, y + 0.8], [x, y + 0.8, x + 1.2, y + 0.8], [x, y, x, y + 0.8]]
    }

    /// A building of 20 m x 12 m that is symmetric but for its furniture.
    fn furnished() -> DrawnMap {
        let tables = [(2.0, 2.0), (7.0, 1.5), (12.5, 2.2), (3.0, 9.5), (9.0, 9.0), (16.0, 8.8)];
        let tables: Vec<[f64; 4]> = tables.iter().flat_map(|&(x, y)| table(x, y)).collect();
        FloorPlan::nearly_symmetric().with(&tables).draw(seen(-1.0, -1.0, 21.0, 13.0), drawing(0.0, 0.0, 0.0))
    }

    fn details(transform_a_b: &Pose2) -> (f64, Details) {
        let map = furnished();
        let agreement = compare(&map.view(), &map.view(), transform_a_b, &JudgementParameters::default().comparison());
        (agreement.inlier_ratio(), agreement.details)
    }

    #[test]
    fn the_furniture_shows_which_half_of_a_symmetric_building_it_is() {
        let (ratio_here, here) = details(&Pose2::identity());
        let (ratio_there, there) = details(&pose(20.0, 12.0, PI));
        assert!(ratio_here > 0.99 && ratio_there > 0.75, "{ratio_here} {ratio_there}: the walls agree at both");
        assert!(here.components.log_ratio() > 2.0 && here.segments.log_ratio() > 2.0, "{here:?}");
        assert!(there.components.log_ratio() < -1.0, "{there:?}");
        assert!(there.segments.log_ratio() < here.segments.log_ratio() - 2.0, "{there:?}");
        assert!(!here.contradict());
        assert!(here.on_open_floor == 0.0 && there.on_open_floor > 5.0, "{there:?}");
    }

    #[test]
    fn without_details_there_is_no_evidence() {
        assert_eq!(Details::default().components.log_ratio(), 0.0);
        assert!(!Details::default().contradict());
    }
}
