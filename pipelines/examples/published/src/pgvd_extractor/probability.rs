//! Probability that a point is on the skeleton, given the cells that define it.

use gridweave_stages::shared::geometry::{Cell, Grid, is_free, is_known};
use nalgebra::Vector2;

/// Largest distance of the defining cells beyond the nearest one, in cells: on a grid no two distances are equal.
const AS_NEAR: f64 = 1.5;

/// Probability that the cell of a skeleton is on it, 0 to 1: that it is free, and that two cells on either side,
/// about `clearance` metres away, are occupied. Cells beyond the grid count as unknown.
pub fn point_probability(grid: &Grid<'_>, cell: Cell, clearance: f64) -> f64 {
    let most = grid.geometry.width.max(grid.geometry.height) as f64;
    let radius = (clearance / grid.geometry.resolution).clamp(0.0, most);
    // All cells of the ring that are not free, row by row.
    let (inner, outer) = ((radius - 1.0).max(0.0), radius + AS_NEAR);
    let reach = outer.floor() as isize;
    let mut ring: Vec<(Vector2<f64>, f64)> = Vec::new();
    for row in -reach..=reach {
        let along = row as f64;
        let half = |radius: f64| (radius * radius - along * along).max(0.0).sqrt();
        let (far, near) = (half(outer).floor() as isize, half(inner).ceil() as isize);
        for column in (-far..=-near).chain(near.max(1)..=far) {
            let at = |place: usize, off: isize| place.checked_add_signed(off).unwrap_or(usize::MAX);
            let value = grid.value(Cell { column: at(cell.column, column), row: at(cell.row, row) });
            if !is_free(value) && (row, column) != (0, 0) {
                ring.push((Vector2::new(column as f64, along), probability_of_occupied(value)));
            }
        }
    }
    let free = 1.0 - probability_of_occupied(grid.value(cell));
    let nearest = ring.iter().min_by(|one, other| one.0.norm_squared().total_cmp(&other.0.norm_squared()));
    let Some((nearest, first)) = nearest else { return free * 0.25 };
    let direction = nearest.normalize();
    let away = |off: &Vector2<f64>| off.normalize().dot(&direction);
    let other = ring.iter().min_by(|one, other| away(&one.0).total_cmp(&away(&other.0)));
    free * first * other.map_or(0.5, |(_, occupied)| *occupied)
}

/// Probability of a cell's value; one half where it is unknown.
fn probability_of_occupied(value: i8) -> f64 {
    if is_known(value) { f64::from(value) / 100.0 } else { 0.5 }
}
