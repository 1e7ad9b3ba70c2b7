//! How well two maps agree where both know something.

use super::ComparisonParameters;
use super::conflicts::points_of_walls;
use super::regions::{ComparedWall, Finding, Found, Region, RegionComparison};
use super::straight_walls::StraightWalls;
use crate::shared::deformation::Deformation;
use crate::shared::geometry::{Grid, Point2, Pose2, is_known};
use crate::shared::walls::WallMap;
use nalgebra::Vector2;

/// Two walls that lie within this many cells of the coarser map of each other may be the same one, drawn in other
/// cells.
const LEAST_TOLERANCE: f64 = 1.5;
/// The share of the walls that two maps of one place agree on, moved furniture, open doors and bends included: low, so that
/// one poor map does not lose against its good place.
const AGREEMENT_OF_ONE_PLACE: f64 = 0.75;
/// The share of the walls that agree where a map is laid anywhere, least and most. What is measured on a map of a few walls
/// is not known better.
const CHANCE_RANGE: (f64, f64) = (0.02, 0.5);

/// A map: its cells, and what was made of them.
#[derive(Clone, Copy, Debug)]
pub struct MapView<'a> {
    /// Its cells.
    pub grid: Grid<'a>,
    /// Its walls and the samples of its known space, as they are bent.
    pub walls: &'a WallMap,
    /// How it is bent; none if it is rigid.
    pub bend: Option<&'a Deformation>,
}

impl<'a> MapView<'a> {
    /// A map as it came, with its walls.
    pub fn rigid(grid: Grid<'a>, walls: &'a WallMap) -> Self {
        Self { grid, walls, bend: None }
    }

    /// The value of the cell at a place of the bent map.
    pub(super) fn value_at(&self, place: &Point2) -> i8 {
        match self.bend {
            Some(bend) => self.grid.value_at(&bend.inverse(place)),
            None => self.grid.value_at(place),
        }
    }
}

/// What two maps say of each other at one place.
///
/// Lengths are the mean of both ways: walls of b looked up in a, and walls of a looked up in b.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Agreement {
    /// Area that both maps know, square metres.
    pub overlap: f64,
    /// Length of wall of one map that lies on wall of the other, runs alike and is seen from the same side, metres.
    pub inlier_length: f64,
    /// Length of wall of one map that lies where the other knows free space, farther from any wall than the tolerance,
    /// metres.
    pub conflict_length: f64,
    /// Of that, what crosses free space: pieces as long as a door is wide, with no wall that runs alike within 0.4 m beyond the
    /// tolerance, metres.
    pub crossing_length: f64,
    /// The log-likelihood ratio of the walls: how much likelier they are to meet as they do if this is the place than if map b lay
    /// anywhere. Every region counts by itself, and no region more than walls as long as its side.
    pub evidence: f64,
    /// The share of the inliers, 0 to 1, that do not belong to the two straight walls of which most agrees: two walls fix a place, as
    /// any corner fits any other, and only what agrees beside them confirms it.
    pub independent_share: f64,
    /// The number of independent constraints in the weaker of two directions: straight walls that agree along the longest one and
    /// across it, the fewer of both, four at the most. With none, the place along the walls is open.
    pub constraints: usize,
    /// How far regions of map b are moved to lie on map a, the root of the mean square over the inliers, metres: at places that
    /// fit by chance, the walls of every room are a little beside those of the other map in another direction.
    pub residual: f64,
    /// The middle of the inliers of map b, frame a; the origin if there are none.
    pub centre: Point2,
}

impl Agreement {
    /// The share of the walls that both maps have seen on which they agree, 0 to 1; 0 if there are none.
    pub fn inlier_ratio(&self) -> f64 {
        let seen = self.compared_length();
        if seen > 0.0 { self.inlier_length / seen } else { 0.0 }
    }

    /// Length of wall of one map of which the other knows what is there, metres.
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
    let points = |walls: Vec<ComparedWall>| walls.iter().map(|wall| wall.point).collect::<Vec<_>>();
    let [apart_of_a, apart_of_b] = [false, true].map(|of_b| points(found(of_b, Finding::Conflict)));
    let across = |apart: &[Point2], walls: &WallMap| {
        let spacing = walls.spacing;
        points_of_walls(apart, spacing) as f64 * spacing
    };
    let chance = (chance(a, tolerance) + chance(b, tolerance)) / 2.0;
    let (for_it, against_it) =
        ((AGREEMENT_OF_ONE_PLACE / chance).ln(), ((1.0 - AGREEMENT_OF_ONE_PLACE) / (1.0 - chance)).ln());
    let StraightWalls { confirming, either_way } = StraightWalls::of(&on_wall, b.walls.spacing);
    let mut agreement = Agreement {
        overlap: overlap(a, b, transform_a_b),
        crossing_length: 0.5 * (across(&apart_of_a, a.walls) + across(&apart_of_b, b.walls)),
        independent_share: confirming,
        constraints: either_way,
        residual: residual(&regions),
        centre: middle(&on_wall),
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

/// How far regions were moved, the root of the mean square over the inliers; 0 without any.
fn residual(regions: &[Region]) -> f64 {
    let agree: f64 = regions.iter().map(|region| region.inlier_length).sum();
    let squares: f64 = regions.iter().map(|region| region.inlier_length * region.shift.powi(2)).sum();
    if agree > 0.0 { (squares / agree).sqrt() } else { 0.0 }
}

/// The middle of some walls; the origin if there are none.
fn middle(walls: &[ComparedWall]) -> Point2 {
    let sum: Vector2<f64> = walls.iter().map(|wall| wall.point.coords).sum();
    Point2::from(sum / walls.len().max(1) as f64)
}

/// The probability that a piece of wall that is laid anywhere in the known space of a map lies on a wall that runs alike:
/// the share of that space within the tolerance of walls, halved for the direction.
fn chance(map: &MapView<'_>, tolerance: f64) -> f64 {
    let known = map.walls.samples.len() as f64 * map.walls.sample_area;
    let length = map.walls.walls.points().len() as f64 * map.walls.spacing;
    (0.5 * 2.0 * tolerance * length / known.max(1.0)).clamp(CHANCE_RANGE.0, CHANCE_RANGE.1)
}

/// The area that both maps know, square metres.
fn overlap(a: &MapView<'_>, b: &MapView<'_>, transform_a_b: &Pose2) -> f64 {
    let samples = b.walls.samples.iter();
    let known = samples.filter(|sample| is_known(a.value_at(&(transform_a_b * sample.point)))).count();
    known as f64 * b.walls.sample_area
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::judgement::JudgementParameters;
    use crate::shared::geometry::pose;
    use crate::shared::test_world::floor_plan::{Drawing, DrawnMap, FloorPlan, drawing, seen};

    #[test]
    fn walls_that_cross_rooms_are_told_from_those_drawn_beside_in_cells_of_any_size() {
        for resolution in [0.05, 0.4] {
            let fine = drawing(0.0, 0.0, 0.0);
            let seen = seen(-1.0, -1.0, 21.0, 13.0);
            let draw = |plan: FloorPlan| plan.draw(seen, Drawing { resolution, ..fine });
            let (a, another) = (draw(FloorPlan::office()), draw(FloorPlan::another_office()));
            let compared = |b: &DrawnMap, shift: f64| {
                compare(&a.view(), &b.view(), &pose(shift, shift, 0.0), &JudgementParameters::default().comparison())
            };
            let tolerance = (1.5 * resolution).max(JudgementParameters::default().wall_tolerance);
            let beside = compared(&a, tolerance + 0.2);
            let other = compared(&another, 0.0);
            assert!(beside.conflict_length > 5.0 && other.conflict_length > 5.0, "{beside:?} {other:?}");
            let crossing = |agreement: &Agreement| agreement.crossing_length / agreement.conflict_length;
            assert!(crossing(&beside) + 0.2 < crossing(&other), "{resolution}: {beside:?} {other:?}");
        }
    }
}
