//! Reliability of a segment: its mean occupancy.

use super::line::Stretch;
use crate::shared::geometry::{Cell, Grid, Point2};
use nalgebra::Vector2;

/// Mean occupancy along a stretch, 0 to 1; the stretch is in cells of the grid.
///
/// For every cell's length along the stretch the greatest occupancy within `reach` across it counts, so a wall that
/// is thicker or thinner than a cell, or wavers by less than `reach`, is as reliable as a perfect one. Unknown cells
/// and those off the grid count as 0.
pub(super) fn reliability(grid: &Grid<'_>, stretch: &Stretch, reach: f64) -> f64 {
    let steps = (stretch.length().ceil() as usize).max(1);
    let across = Vector2::new(-stretch.line.direction().y, stretch.line.direction().x);
    let half = reach.min(grid.geometry.cell_count() as f64).ceil();
    // Samples at most a cell apart, up to the reach on both sides.
    let spacing = reach / half;
    let half = half as i64;
    let mut sum = 0.0;
    for step in 0..=steps {
        let middle = stretch.line.at(stretch.start + stretch.length() * step as f64 / steps as f64);
        let greatest = (-half..=half)
            .map(|offset| value_at(grid, &(middle + across * (offset as f64 * spacing))))
            .max()
            .unwrap_or(0);
        sum += f64::from(greatest.clamp(0, 100)) / 100.0;
    }
    sum / (steps + 1) as f64
}

fn value_at(grid: &Grid<'_>, point: &Point2) -> i8 {
    if !(point.x >= 0.0 && point.y >= 0.0) {
        return 0;
    }
    grid.value(Cell { column: point.x as usize, row: point.y as usize })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::{GridGeometry, pose};
    use crate::tags::line_extractor::line::Line;

    fn reliability_of(cells: impl Fn(usize, usize) -> i8, from: [f64; 2], to: [f64; 2]) -> f64 {
        let geometry = GridGeometry { width: 40, height: 20, resolution: 0.05, origin: pose(0.0, 0.0, 0.0) };
        let cells: Vec<i8> = (0..800).map(|index| cells(index % 40, index / 40)).collect();
        let (from, to) = (Point2::from(from), Point2::from(to));
        let line = Line::through(&from, &to).unwrap();
        let stretch = Stretch { line, start: 0.0, end: (to - from).norm() };
        reliability(&Grid::new(geometry, &cells).unwrap(), &stretch, 1.6)
    }

    #[test]
    fn a_wall_is_reliable_whether_it_is_thick_or_thin() {
        let ends = ([2.5, 10.5], [37.5, 10.5]);
        assert_eq!(reliability_of(|_, row| if row == 10 { 100 } else { 0 }, ends.0, ends.1), 1.0);
        assert_eq!(reliability_of(|_, row| if row == 11 { 100 } else { -1 }, ends.0, ends.1), 1.0);
        assert_eq!(reliability_of(|_, row| if (8..13).contains(&row) { 100 } else { 0 }, ends.0, ends.1), 1.0);
        assert!((reliability_of(|_, row| if row == 10 { 80 } else { 0 }, ends.0, ends.1) - 0.8).abs() < 1e-12);
    }

    #[test]
    fn free_and_unknown_cells_and_those_off_the_grid_count_nothing() {
        let half = |other: i8| move |column: usize, row: usize| if row == 10 && column < 20 { 100 } else { other };
        for other in [0, -1, i8::MIN] {
            let share = reliability_of(half(other), [0.5, 10.5], [39.5, 10.5]);
            assert!((share - 0.5).abs() < 0.03, "{share}");
        }
        assert!(reliability_of(half(0), [-40.0, 10.5], [20.0, 10.5]) < 0.4);
        assert_eq!(reliability_of(|_, _| 100, [-40.0, -30.0], [-20.0, -90.0]), 0.0);
    }
}
