//! How well two maps agree where both know something.

use super::ComparisonParameters;
use super::Details;
use super::regions::{ComparedWall, Finding, Found, Region, RegionComparison};
use super::straight_walls::{StraightWalls, conflicting_walls};
use crate::shared::deformation::Deformation;
use crate::shared::geometry::{Grid, Point2, Pose2, is_known};
use crate::shared::walls::WallMap;
use nalgebra::Vector2;

/// Two walls within this many cells of the coarser map may be the same one, drawn in other cells.
const LEAST_TOLERANCE: f64 = 1.5;
/// Inlier ratio expected of two maps of one place, with moved furniture, open doors and deformation. Low, so that one
/// poor map does not lose against its correct pose.
const INLIER_RATIO_OF_ONE_PLACE: f64 = 0.75;
/// Bounds of the inlier ratio expected of a random pose. What is measured on a map of a few walls is not known
/// better.
const CHANCE_RANGE: (f64, f64) = (0.02, 0.5);

/// A map as it is compared: its cells, its walls, and its deformation.
#[derive(Clone, Copy, Debug)]
pub struct MapView<'a> {
    /// Its cells.
    pub grid: Grid<'a>,
    /// Its walls and the samples of its known space, deformed.
    pub walls: &'a WallMap,
    /// Its deformation; none if it is rigid.
    pub deformation: Option<&'a Deformation>,
}

impl<'a> MapView<'a> {
    /// A map without deformation.
    pub fn rigid(grid: Grid<'a>, walls: &'a WallMap) -> Self {
        Self { grid, walls, deformation: None }
    }

    /// Value of the cell at a point of the deformed map.
    pub(super) fn value_at(&self, place: &Point2) -> i8 {
        match self.deformation {
            Some(deformation) => self.grid.value_at(&deformation.inverse(place)),
            None => self.grid.value_at(place),
        }
    }
}

/// How far two maps agree at one relative pose.
///
/// Lengths are the mean of both directions: walls of b looked up in a, and walls of a looked up in b.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Agreement {
    /// Area that both maps know, square metres.
    pub overlap: f64,
    /// Inlier length: wall of one map on a parallel wall of the other that is seen from the same side, metres.
    pub inlier_length: f64,
    /// Conflict length: wall of one map on known free space of the other, farther from any wall than the tolerance,
    /// metres.
    pub conflict_length: f64,
    /// Number of straight walls on free space of the other map, of the map that has fewer, at most eight. Where only
    /// one map has walls that the other has not, things were moved or one is drawn more roughly; where each has, it is
    /// another place.
    pub conflicting_walls: usize,
    /// Log-likelihood ratio of the walls: of the inliers and conflicts at this pose to those of a random pose.
    /// Regions are independent, and none counts for more than walls as long as its side.
    pub evidence: f64,
    /// Share of the inliers, 0 to 1, outside the two straight walls with the most inliers. Two walls fix a pose, as
    /// any corner fits any other; only further walls confirm it.
    pub independent_share: f64,
    /// Number of independent constraints in the weaker of two directions: straight walls with inliers along the
    /// longest one and across it, the fewer of both, at most eight. 0 is degenerate: the position along the walls is
    /// open.
    pub constraints: usize,
    /// Local residual: by how much regions of map b are shifted to align with map a, root mean square over the
    /// inliers, metres. Where maps fit by chance, the walls of every room are a little off in another direction.
    pub residual: f64,
    /// Centroid of the inliers of map b, frame a; the origin if there are none.
    pub centre: Point2,
    /// Agreement of the details, a part of the lengths.
    pub details: Details,
}

impl Agreement {
    /// Inlier ratio: the share of the compared walls that are inliers, 0 to 1; 0 if there are none.
    pub fn inlier_ratio(&self) -> f64 {
        let seen = self.compared_length();
        if seen > 0.0 { self.inlier_length / seen } else { 0.0 }
    }

    /// Length of wall of one map at which the other map is known, metres.
    pub fn compared_length(&self) -> f64 {
        self.inlier_length + self.conflict_length
    }
}

/// Compares two maps with map b at `transform_a_b`.
pub fn compare(
    a: &MapView<'_>,
    b: &MapView<'_>,
    transform_a_b: &Pose2,
    parameters: &ComparisonParameters,
) -> Agreement {
    let coarser = a.grid.geometry.resolution.max(b.grid.geometry.resolution);
    let tolerance = parameters.wall_tolerance.max(LEAST_TOLERANCE * coarser);
    let comparison =
        RegionComparison { side: parameters.region, region_deviation: parameters.region_deviation, tolerance };
    let Found { regions, walls: compared } = comparison.compare(a, b, transform_a_b);
    let found = |of_b: bool, finding: Finding| -> Vec<ComparedWall> {
        compared.iter().filter(|wall| wall.of_b == of_b && wall.finding == finding).copied().collect()
    };
    let on_wall = found(true, Finding::Inlier);
    let conflicting =
        |of_b: bool, map: &MapView<'_>| conflicting_walls(&found(of_b, Finding::Conflict), map.walls.spacing);
    let chance = (chance(a, tolerance) + chance(b, tolerance)) / 2.0;
    let (for_it, against_it) =
        ((INLIER_RATIO_OF_ONE_PLACE / chance).ln(), ((1.0 - INLIER_RATIO_OF_ONE_PLACE) / (1.0 - chance)).ln());
    let StraightWalls { independent_share, constraints } = StraightWalls::of(&on_wall, b.walls.spacing);
    let mut agreement = Agreement {
        overlap: overlap(a, b, transform_a_b),
        conflicting_walls: conflicting(false, a).min(conflicting(true, b)),
        independent_share,
        constraints,
        residual: residual(&regions),
        centre: centroid(&on_wall),
        details: Details::of(a, b, transform_a_b, &compared),
        ..Default::default()
    };
    for region in &regions {
        agreement.inlier_length += region.inlier_length;
        agreement.conflict_length += region.conflict_length;
        let share = (parameters.region / (region.inlier_length + region.conflict_length).max(1e-9)).min(1.0);
        agreement.evidence += share * (for_it * region.inlier_length + against_it * region.conflict_length);
    }
    agreement
}

/// Root mean square over the inliers of the shifts of the regions, metres; 0 without inliers.
fn residual(regions: &[Region]) -> f64 {
    let agree: f64 = regions.iter().map(|region| region.inlier_length).sum();
    let squares: f64 = regions.iter().map(|region| region.inlier_length * region.shift.powi(2)).sum();
    if agree > 0.0 { (squares / agree).sqrt() } else { 0.0 }
}

/// Centroid of some walls; the origin if there are none.
fn centroid(walls: &[ComparedWall]) -> Point2 {
    let sum: Vector2<f64> = walls.iter().map(|wall| wall.point.coords).sum();
    Point2::from(sum / walls.len().max(1) as f64)
}

/// Probability that a piece of wall at a random pose in the known space of a map is an inlier: the share of that
/// space within the tolerance of walls, halved for the direction.
fn chance(map: &MapView<'_>, tolerance: f64) -> f64 {
    let known = map.walls.samples.len() as f64 * map.walls.sample_area;
    let length = map.walls.walls.points().len() as f64 * map.walls.spacing;
    (0.5 * 2.0 * tolerance * length / known.max(1.0)).clamp(CHANCE_RANGE.0, CHANCE_RANGE.1)
}

/// Area that both maps know with map b at `transform_a_b`, square metres.
pub fn overlap(a: &MapView<'_>, b: &MapView<'_>, transform_a_b: &Pose2) -> f64 {
    let samples = b.walls.samples.iter();
    let known = samples.filter(|sample| is_known(a.value_at(&(transform_a_b * sample.point)))).count();
    known as f64 * b.walls.sample_area
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::judgement::JudgementParameters;
    use crate::shared::test_world::floor_plan::{DrawnMap, FloorPlan, drawing, seen};

    #[test]
    fn walls_that_one_map_has_and_the_other_has_not_are_no_walls_in_conflict() {
        let draw = |plan: FloorPlan| plan.draw(seen(-1.0, -1.0, 21.0, 13.0), drawing(0.0, 0.0, 0.0));
        let partitions = [[3.0, 3.2, 5.0, 3.2], [9.0, 8.8, 11.5, 8.8], [15.0, 2.9, 17.0, 2.9]];
        let (plain, divided) = (draw(FloorPlan::office()), draw(FloorPlan::office().with(&partitions)));
        let another = draw(FloorPlan::another_office());
        let compared = |a: &DrawnMap, b: &DrawnMap| {
            compare(&a.view(), &b.view(), &Pose2::identity(), &JudgementParameters::default().comparison())
        };
        for agreement in [compared(&plain, &divided), compared(&divided, &plain)] {
            assert!(agreement.conflict_length > 2.0 && agreement.conflicting_walls == 0, "{agreement:?}");
        }
        let agreement = compared(&plain, &another);
        assert!(agreement.conflicting_walls > 1, "{agreement:?}");
    }
}
