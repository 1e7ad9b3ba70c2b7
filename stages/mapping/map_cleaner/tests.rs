//! Cleaning of small maps that are drawn by hand.

use super::passages::wide_known_space;
use super::{MapCleanerParameters, clean};
use crate::shared::geometry::{CellBox, Grid, GridGeometry, UNKNOWN, is_known, pose};
use gridweave_runtime::stage::Parameters;
use proptest::prelude::*;

const WIDTH: usize = 60;
const HEIGHT: usize = 40;
const RESOLUTION: f64 = 0.05;

/// A map of 3 x 2 m in which `value` says what is in a cell, and the same cleaned.
fn cleaned(value: impl Fn(usize, usize) -> i8) -> (Vec<i8>, Vec<i8>) {
    let geometry = GridGeometry { width: WIDTH, height: HEIGHT, resolution: RESOLUTION, origin: pose(1.0, 2.0, 0.3) };
    let cells: Vec<i8> = (0..WIDTH * HEIGHT).map(|index| value(index % WIDTH, index / WIDTH)).collect();
    let mut after = cells.clone();
    clean(&Grid::new(geometry, &cells).unwrap(), &MapCleanerParameters::default(), &mut after);
    (cells, after)
}

/// A room with a wall from column 10 to 50 in row 20, which is known all round.
fn room(column: usize, row: usize) -> i8 {
    if row == 20 && (10..50).contains(&column) { 100 } else { 0 }
}

#[test]
fn walls_and_the_space_between_them_stay_as_they_are() {
    let (before, after) = cleaned(room);
    assert_eq!(before, after);
}

#[test]
fn single_cells_and_small_objects_become_unknown() {
    let legs = [(15, 5), (16, 5), (30, 30), (45, 8), (46, 9)];
    let (before, after) = cleaned(|column, row| if legs.contains(&(column, row)) { 100 } else { room(column, row) });
    for (index, (before, after)) in before.into_iter().zip(after).enumerate() {
        let is_leg = legs.contains(&(index % WIDTH, index / WIDTH));
        assert_eq!(after, if is_leg { UNKNOWN } else { before }, "{index}");
    }
}

#[test]
fn a_wall_that_lacks_cells_stays_whole() {
    let (before, after) = cleaned(|column, row| if column % 4 == 0 { 0 } else { room(column, row) });
    assert_eq!(before, after);
}

#[test]
fn a_ray_through_a_window_is_removed_and_a_door_is_not() {
    // Below row 20 a room; above it a ray of two cells and a corridor of a metre, seen through gaps of the wall.
    let is_ray = |column: usize, row: usize| row > 20 && (14..16).contains(&column);
    let is_corridor = |column: usize, row: usize| row > 20 && (25..45).contains(&column);
    let (before, after) = cleaned(|column, row| match row {
        0..20 => 0,
        _ if is_ray(column, row) || is_corridor(column, row) => 0,
        20 if !is_ray(column, row + 1) && !is_corridor(column, row + 1) => 100,
        _ => UNKNOWN,
    });
    let value = |cells: &[i8], column: usize, row: usize| cells[row * WIDTH + column];
    assert_eq!((value(&before, 14, 30), value(&after, 14, 30)), (0, UNKNOWN));
    assert_eq!((value(&after, 35, 30), value(&after, 26, 22)), (0, 0));
    assert_eq!((value(&after, 5, 20), value(&after, 5, 5)), (100, 0));
}

proptest! {
    #[test]
    fn what_is_cleaned_is_only_what_was_known_and_cleaning_twice_finds_no_more_objects(
        values in prop::collection::vec(prop::sample::select(vec![-1_i8, 0, 0, 0, 100]), WIDTH * HEIGHT),
    ) {
        let (before, after) = cleaned(|column, row| values[row * WIDTH + column]);
        prop_assert!(before.iter().zip(&after).all(|(before, after)| after == before || *after == UNKNOWN));
        let (_, again) = cleaned(|column, row| after[row * WIDTH + column]);
        let walls = |cells: &[i8]| cells.iter().filter(|cell| **cell == 100).count();
        prop_assert_eq!(walls(&again), walls(&after));
    }
}

proptest! {
    #[test]
    fn space_is_wide_inside_a_square_of_known_cells(
        width in 1usize..14, height in 1usize..14, radius in 1usize..4,
        values in prop::collection::vec(prop::sample::select(vec![-1_i8, 0, 0, 0, 0, 100]), 14 * 14),
        inner in 0usize..6,
    ) {
        // Nothing is known near the left and the lower border if the inner part begins later.
        let value = |index: usize| {
            if index % width < inner || index / width < inner { UNKNOWN } else { values[index] }
        };
        let cells: Vec<i8> = (0..width * height).map(value).collect();
        let geometry = GridGeometry { width, height, resolution: 0.05, origin: pose(0.0, 0.0, 0.0) };
        let grid = Grid::new(geometry, &cells).unwrap();
        let is_on_grid = |column: i32, row: i32| (0..width as i32).contains(&column) && (0..height as i32).contains(&row);
        let reach = radius as i32;
        let around = |column: i32, row: i32| (row - reach..=row + reach).flat_map(move |row| (column - reach..=column + reach).map(move |column| (column, row)));
        let is_eroded = |column: i32, row: i32| !around(column, row)
            .any(|(column, row)| is_on_grid(column, row) && cells[row as usize * width + column as usize] == UNKNOWN);
        let Some(known_box) = CellBox::holding(&grid, is_known) else { return Ok(()) };
        let wide = wide_known_space(&grid, &known_box, radius);
        for (index, is_wide) in wide.into_iter().enumerate() {
            let column = (known_box.columns.start + index % known_box.columns.len()) as i32;
            let row = (known_box.rows.start + index / known_box.columns.len()) as i32;
            let expected = around(column, row).any(|(column, row)| is_on_grid(column, row) && is_eroded(column, row));
            prop_assert_eq!(is_wide, expected, "{} {}", column, row);
        }
        let is_in_box = |index: usize| known_box.rows.contains(&(index / width)) && known_box.columns.contains(&(index % width));
        prop_assert!(cells.iter().enumerate().all(|(index, value)| *value == UNKNOWN || is_in_box(index)));
    }
}

#[test]
fn no_cells_are_no_trouble() {
    let geometry = GridGeometry { width: 0, height: 0, resolution: RESOLUTION, origin: pose(0.0, 0.0, 0.0) };
    clean(&Grid::new(geometry, &[]).unwrap(), &MapCleanerParameters::default(), &mut []);
}

#[test]
fn the_defaults_are_in_range_and_nonsense_is_not() {
    assert!(MapCleanerParameters::default().check().is_empty());
    let nonsense = MapCleanerParameters { link: -1.0, min_wall_length: f64::NAN, min_fill: 2.0, min_passage: 1e9 };
    assert_eq!(nonsense.check().len(), 4);
}
