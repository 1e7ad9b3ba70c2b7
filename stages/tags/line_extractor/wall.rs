//! A wall under construction: a stretch of a line and its points.

use super::line::{Line, Stretch};
use super::parameters::Fit;
use crate::shared::geometry::Point2;

/// A stretch of a line and its members.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Wall {
    /// The line between its two farthest members.
    pub(super) stretch: Stretch,
    /// Indices of its points.
    pub(super) members: Vec<usize>,
}

impl Wall {
    /// The wall of some members near `line`. `None` if they do not determine a direction.
    pub(super) fn of_members(points: &[Point2], members: Vec<usize>, line: &Line, fit: Fit) -> Option<Self> {
        let stretch = fit_stretch(fit, line, members.iter().map(|&id| points[id]))?;
        Some(Self { stretch, members })
    }
}

/// The stretch of the line through points near `line`.
pub(super) fn fit_stretch(fit: Fit, line: &Line, points: impl Iterator<Item = Point2> + Clone) -> Option<Stretch> {
    let line = match fit {
        // Faces are separated once the wall is complete.
        Fit::Faces | Fit::LeastSquares => Line::least_squares(points.clone())?,
        Fit::Ends => {
            let along = |a: &Point2, b: &Point2| line.along(a).total_cmp(&line.along(b));
            let first = points.clone().min_by(along)?;
            let last = points.clone().max_by(along)?;
            Line::through(&first, &last)?
        }
    };
    Stretch::between_farthest(line, points)
}

/// Breaks a line where neighbouring members are more than `max_gap` apart: the breakdown of section 4.1.1.
///
/// Members are sorted by their distance from one end. Each part is a list of members in that order.
pub(super) fn break_down(points: &[Point2], members: &[usize], line: &Line, max_gap: f64) -> Vec<Vec<usize>> {
    let mut sorted: Vec<(f64, usize)> = members.iter().map(|&id| (line.along(&points[id]), id)).collect();
    sorted.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    sorted.chunk_by(|a, b| b.0 - a.0 <= max_gap).map(|part| part.iter().map(|&(_, id)| id).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(places: &[f64]) -> Vec<Point2> {
        places.iter().map(|&x| Point2::new(x, 2.0)).collect()
    }

    #[test]
    fn a_line_is_broken_at_gaps_larger_than_the_limit() {
        let points = row(&[9.0, 0.0, 1.0, 2.0, 7.0, 8.0, 40.0]);
        let line = Line::through(&points[1], &points[0]).unwrap();
        let members: Vec<usize> = (0..points.len()).collect();
        let parts = break_down(&points, &members, &line, 5.0);
        assert_eq!(parts, [vec![1, 2, 3, 4, 5, 0], vec![6]], "a gap equal to the limit is none");
        assert_eq!(break_down(&points, &members, &line, 4.9).len(), 3);
        assert!(break_down(&points, &[], &line, 5.0).is_empty());
    }

    #[test]
    fn the_ends_are_the_farthest_members() {
        let points: Vec<Point2> = [[0.0, 0.0], [5.0, 0.4], [10.0, 1.0], [5.0, 0.6]].map(Point2::from).to_vec();
        let line = Line::through(&points[1], &points[3]).unwrap();
        assert!(Wall::of_members(&points, vec![], &line, Fit::Ends).is_none());
        let line = Line::through(&points[0], &points[1]).unwrap();
        let wall = Wall::of_members(&points, vec![0, 1, 2, 3], &line, Fit::Ends).unwrap();
        let [first, last] = wall.stretch.ends();
        assert!((first - points[0]).norm() < 1e-12 && (last - points[2]).norm() < 1e-12);
        let fitted = Wall::of_members(&points, vec![0, 1, 2, 3], &line, Fit::LeastSquares).unwrap();
        assert!(fitted.stretch.line.direction().perp(&wall.stretch.line.direction()).abs() < 0.01);
    }
}
