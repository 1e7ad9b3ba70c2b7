//! Merging of segments of one wall (section 4.1.1).

use super::line::Line;
use super::parameters::LineExtractorParameters;
use super::scale::CellLengths;
use super::wall::Wall;
use crate::shared::geometry::Point2;

/// Merges any two walls that are nearly parallel, have ends near each other, and fit one line.
///
/// The first of the two grows, until no two can be merged.
pub(super) fn merge_walls(
    points: &[Point2],
    mut walls: Vec<Wall>,
    parameters: &LineExtractorParameters,
    scale: &CellLengths,
) -> Vec<Wall> {
    loop {
        let before = walls.len();
        let mut first = 0;
        while first < walls.len() {
            let merged = (first + 1..walls.len()).find_map(|second| {
                let wall = merge(points, &walls[first], &walls[second], parameters, scale)?;
                Some((second, wall))
            });
            match merged {
                Some((second, wall)) => {
                    walls[first] = wall;
                    walls.remove(second);
                }
                None => first += 1,
            }
        }
        // A wall that has grown may be near one before it.
        if walls.len() == before {
            return walls;
        }
    }
}

fn merge(
    points: &[Point2],
    a: &Wall,
    b: &Wall,
    parameters: &LineExtractorParameters,
    scale: &CellLengths,
) -> Option<Wall> {
    let (direction_a, direction_b) = (a.stretch.line.direction(), b.stretch.line.direction());
    if direction_a.perp(&direction_b).abs() >= parameters.merge_angle.sin() {
        return None;
    }
    let between = |a: &Wall, b: &Wall| {
        let [first, last] = b.stretch.ends();
        a.stretch.distance(&first).min(a.stretch.distance(&last))
    };
    if between(a, b).min(between(b, a)) >= scale.merge_distance {
        return None;
    }
    let members: Vec<usize> = a.members.iter().chain(&b.members).copied().collect();
    let longer = if a.stretch.length() >= b.stretch.length() { a } else { b };
    let merged = Wall::of_members(points, members, &longer.stretch.line, parameters.fit)?;
    let fits = |wall: &Wall, line: &Line| wall.stretch.ends().iter().all(|end| line.distance(end) <= scale.reach);
    let line = &merged.stretch.line;
    (fits(a, line) && fits(b, line)).then_some(merged)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tags::line_extractor::Fit;

    /// Walls along the given stretches of x at the given y, merged under the default parameters at 0.05 m a cell.
    fn merged(stretches: &[(std::ops::Range<i32>, f64)]) -> Vec<Wall> {
        let parameters = LineExtractorParameters::default();
        let mut points = Vec::new();
        let mut walls = Vec::new();
        for (range, y) in stretches {
            let first = points.len();
            points.extend(range.clone().map(|x| Point2::new(f64::from(x), *y)));
            let line = Line::through(&points[first], &points[first + 1]).unwrap();
            walls.push(Wall::of_members(&points, (first..points.len()).collect(), &line, Fit::LeastSquares).unwrap());
        }
        merge_walls(&points, walls, &parameters, &CellLengths::new(&parameters, 0.05))
    }

    #[test]
    fn walls_that_are_far_apart_or_side_by_side_or_at_an_angle_stay_two() {
        assert_eq!(merged(&[(0..20, 5.0), (40..60, 5.0)]).len(), 2);
        assert_eq!(merged(&[(0..20, 5.0), (0..20, 9.0)]).len(), 2);
        assert_eq!(merged(&[]).len(), 0);
        let points: Vec<Point2> =
            (0..40).map(|i| Point2::new(f64::from(i), 0.1 * f64::from((i - 20).max(0)))).collect();
        let parameters = LineExtractorParameters::default();
        let wall = |range: std::ops::Range<usize>| {
            let line = Line::through(&points[range.start], &points[range.start + 1]).unwrap();
            Wall::of_members(&points, range.collect(), &line, Fit::LeastSquares).unwrap()
        };
        let scale = CellLengths::new(&parameters, 0.05);
        assert_eq!(merge_walls(&points, vec![wall(0..20), wall(20..40)], &parameters, &scale).len(), 2);
    }
}
