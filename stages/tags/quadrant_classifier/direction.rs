//! Direction of a map's walls.

use super::circular_mean::{circular_mean, scatter};
use super::grouping::{bisector, group_directions};
use super::parameters::{Mean, QuadrantClassifierParameters};
use super::walls::{WallDirection, wall_directions};
use crate::shared::geometry::turn_difference;
use gridweave_runtime::ros::Segment;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

/// The common direction of the walls of a map.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Direction {
    /// Radians, in `(-pi / 4, pi / 4]`, known up to quarter turns.
    pub angle: f64,
    /// Standard deviation of the angle, radians.
    pub deviation: f64,
    /// Directions of the two groups of walls, radians.
    pub groups: [f64; 2],
    /// Share of the wall length along the direction or across it, 0 to 1.
    pub agreement: f64,
    /// Whether enough walls agree.
    pub valid: bool,
}

/// Direction of the walls of a map. Without walls it is not valid, and zero.
pub fn map_direction(segments: &[Segment], parameters: &QuadrantClassifierParameters) -> Direction {
    let walls = wall_directions(segments, parameters);
    let Some((angle, members)) = (match parameters.mean {
        Mean::Circular => circular_mean(&walls, parameters.tolerance),
        Mean::Groups => mean_of_groups(&walls),
    }) else {
        return Direction::default();
    };
    let Some(groups) = group_directions(&members) else { return Direction::default() };

    let length: f64 = walls.iter().map(|wall| wall.length).sum();
    let agreeing: f64 = walls
        .iter()
        .filter(|wall| turn_difference(wall.angle, angle, FRAC_PI_2).abs() <= parameters.tolerance)
        .map(|wall| wall.length)
        .sum();
    let agreement = agreeing / length;
    Direction {
        angle: turn_difference(angle, 0.0, FRAC_PI_2),
        deviation: deviation(&members, angle, scatter(&walls, angle, parameters.tolerance), parameters.min_deviation),
        groups,
        agreement,
        valid: agreement >= parameters.min_agreement && agreeing >= parameters.min_wall_length,
    }
}

/// The paper's direction, turned from the bisector of the groups to the walls.
fn mean_of_groups(walls: &[WallDirection]) -> Option<(f64, Vec<WallDirection>)> {
    let groups = group_directions(walls)?;
    Some((bisector(groups) - FRAC_PI_4, walls.to_vec()))
}

/// Standard deviation of the weighted mean of the walls' directions: from their scatter, from the deviation of each,
/// and from the common error of all walls of a map.
///
/// Walls that scatter by more than their deviations are those of a deformed map. The errors of neighbours are then
/// correlated, and the error of their mean shrinks with their number by far less than that of independent walls; so
/// it is multiplied by the ratio of the two once more, up to the scatter of the walls.
fn deviation(walls: &[WallDirection], mean: f64, scatter: f64, min_deviation: f64) -> f64 {
    let weight: f64 = walls.iter().map(|wall| wall.weight).sum();
    let (mut of_mean, mut of_one) = (0.0, 0.0);
    for wall in walls {
        let offset = turn_difference(wall.angle, mean, FRAC_PI_2);
        let (share, square) = (wall.weight / weight, offset.powi(2) + wall.deviation.powi(2));
        of_mean += share.powi(2) * square;
        of_one += share * square;
    }
    ((of_mean * scatter.powi(2)).min(of_one) + min_deviation.powi(2)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::{Grid, GridGeometry, Point2, pose};
    use crate::tags::line_extractor::{LineExtractorParameters, extract_segments};
    use crate::tags::quadrant_classifier::Weighting;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    fn wall(degrees: f64, length: f64) -> Segment {
        let angle = degrees.to_radians();
        let (x2, y2) = (1.0 + length * angle.cos(), 2.0 + length * angle.sin());
        Segment { x1: 1.0, y1: 2.0, x2, y2, reliability: 0.9, inliers: 10 }
    }

    /// Circular mean and mean of the groups, each with the three weightings.
    fn modes() -> Vec<QuadrantClassifierParameters> {
        let modes = [Weighting::Length, Weighting::Precision, Weighting::Equation4].map(|weighting| {
            [Mean::Circular, Mean::Groups].map(|mean| QuadrantClassifierParameters {
                mean,
                weighting,
                ..Default::default()
            })
        });
        modes.concat()
    }

    fn error(direction: &Direction, degrees: f64) -> f64 {
        turn_difference(direction.angle, degrees.to_radians(), FRAC_PI_2).to_degrees().abs()
    }

    #[test]
    fn every_mode_finds_the_direction_of_a_room_at_any_angle() {
        for degrees in 0..180 {
            let degrees = f64::from(degrees);
            let room =
                [wall(degrees, 5.0), wall(degrees + 90.0, 4.0), wall(degrees + 180.0, 5.0), wall(degrees - 90.0, 4.0)];
            for parameters in modes() {
                let direction = map_direction(&room, &parameters);
                assert!(error(&direction, degrees) < 1e-9, "{degrees} {direction:?}");
                assert!(direction.valid && (direction.agreement - 1.0).abs() < 1e-12);
                assert!(direction.angle > -FRAC_PI_4 && direction.angle <= FRAC_PI_4);
            }
        }
    }

    #[test]
    fn the_direction_of_a_deformed_map_is_less_certain_than_its_scatter_but_no_less_than_one_wall() {
        let deformed = |degrees: f64, count: i32| -> Direction {
            let angle = |i: i32| 90.0 * f64::from(i % 4) + degrees * f64::from(i - count / 2) / f64::from(count);
            let walls: Vec<Segment> = (0..count).map(|i| wall(angle(i), 5.0)).collect();
            map_direction(&walls, &QuadrantClassifierParameters::default())
        };
        let (straight, scattered) =
            (deformed(0.2, 40).deviation.to_degrees(), deformed(4.0, 40).deviation.to_degrees());
        assert!(straight < 0.15, "{straight}");
        // The walls are within 2 degrees to either side: 1.2 degrees in the mean.
        assert!(scattered > 0.4 && scattered < 1.3, "{scattered}");
        let few = deformed(4.0, 4).deviation.to_degrees();
        assert!(few > scattered && few < 1.8, "{few}");
    }

    #[test]
    fn one_wall_is_as_certain_as_its_ends() {
        let direction = map_direction(&[wall(3.0, 10.0)], &QuadrantClassifierParameters::default());
        assert!(direction.deviation > 0.002 && direction.deviation < 0.01);
    }

    /// A floor plan drawn in 700 x 600 cells of 0.02 m, the paper's size, and turned by `angle`.
    fn drawn_segments(angle: f64) -> Vec<Segment> {
        let (width, height) = (700, 600);
        let geometry = GridGeometry { width, height, resolution: 0.02, origin: pose(0.0, 0.0, 0.0) };
        let mut cells = vec![0; width * height];
        let outer = [[-4.5, -3.0, 4.5, -3.0], [-4.5, 3.0, 4.5, 3.0], [-4.5, -3.0, -4.5, 3.0], [4.5, -3.0, 4.5, 3.0]];
        let inner = [[-4.5, 0.7, 0.4, 0.7], [1.3, 0.7, 4.5, 0.7], [-1.5, 0.7, -1.5, 3.0], [-3.5, -2.2, -2.9, -2.7]];
        for [x1, y1, x2, y2] in outer.into_iter().chain(inner) {
            let (from, to) = (Point2::new(x1, y1), Point2::new(x2, y2));
            for step in 0..2000 {
                let point = Point2::from(from.coords.lerp(&to.coords, f64::from(step) / 2000.0));
                let cell = geometry.cell(&(pose(7.0, 6.0, angle) * point)).unwrap();
                cells[geometry.index(cell)] = 100;
            }
        }
        extract_segments(&Grid::new(geometry, &cells).unwrap(), &LineExtractorParameters::default(), 1)
    }

    #[test]
    fn the_direction_of_a_drawn_map_is_known_to_a_tenth_of_a_degree() {
        for degrees in [-45.0, -12.3, 0.0, 1.0, 17.0, 30.0, 44.9, 61.5, 89.0] {
            let direction = map_direction(&drawn_segments(f64::to_radians(degrees)), &modes()[0]);
            assert!(direction.valid && error(&direction, degrees) < 0.1, "{degrees} {direction:?}");
        }
    }

    proptest! {
        #[test]
        fn turning_the_map_turns_the_direction(
            turn in -PI..PI, noise in prop::collection::vec(-2.0..2.0f64, 8..40),
        ) {
            let walls = |turn: f64| -> Vec<Segment> {
                let walls = noise.iter().enumerate();
                walls.map(|(i, noise)| wall(turn.to_degrees() + 90.0 * (i % 4) as f64 + noise, 1.0 + i as f64)).collect()
            };
            let parameters = QuadrantClassifierParameters::default();
            let (still, turned) = (map_direction(&walls(0.0), &parameters), map_direction(&walls(turn), &parameters));
            prop_assert!(turn_difference(turned.angle, still.angle + turn, FRAC_PI_2).abs() < 1e-6);
            prop_assert!((turned.deviation - still.deviation).abs() < 1e-6);
        }

        #[test]
        fn the_direction_is_always_finite(
            segments in prop::collection::vec(prop::array::uniform5(prop::num::f64::ANY), 0..20),
        ) {
            let segments: Vec<Segment> = segments
                .iter()
                .map(|v| Segment { x1: v[0], y1: v[1], x2: v[2], y2: v[3], reliability: v[4], inliers: 1 })
                .collect();
            for parameters in modes() {
                let direction = map_direction(&segments, &parameters);
                let values = [direction.angle, direction.deviation, direction.agreement, direction.groups[0], direction.groups[1]];
                prop_assert!(values.iter().all(|value| value.is_finite()), "{:?}", direction);
            }
        }
    }
}
