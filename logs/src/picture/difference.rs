//! The difference of two grids with the same size.

use super::PictureError;
use super::colour::{FREE, OCCUPIED, UNKNOWN, mix};
use gridweave_runtime::ros::cell::{is_free, is_known, is_occupied};
use image::{Rgb, RgbImage};

/// Occupied in the first grid only: orange.
const ONLY_FIRST: Rgb<u8> = Rgb([213, 94, 0]);
/// Occupied in the second grid only: blue.
const ONLY_SECOND: Rgb<u8> = Rgb([0, 114, 178]);
/// Another difference: purple.
const OTHERWISE: Rgb<u8> = Rgb([204, 121, 167]);
/// The paleness of equal cells.
const PALENESS: f64 = 0.6;
/// Small grids are enlarged, up to this side, pixels.
const PREFERRED_SIDE: usize = 1000;
const MOST_PIXELS_A_CELL: usize = 16;
/// The maximum side of a grid, cells.
const LONGEST_SIDE: usize = 20_000;

/// Renders the difference of two grids of `width` columns, row 0 at the bottom. Equal cells are pale (unknown grey,
/// free white, occupied dark); a cell that is occupied in the first grid only is orange, in the second only blue, and
/// any other difference is purple.
pub fn render_difference(width: usize, first: &[i8], second: &[i8]) -> Result<RgbImage, PictureError> {
    let height = first.len().checked_div(width).unwrap_or_default();
    if width.checked_mul(height) != Some(first.len()) || first.len() != second.len() {
        return Err(PictureError::Map { index: 1, problem: "differs in size from the other" });
    }
    if first.is_empty() {
        return Err(PictureError::Empty);
    }
    if width.max(height) > LONGEST_SIDE {
        return Err(PictureError::Map { index: 0, problem: "is too large to be drawn" });
    }
    let pixels = (PREFERRED_SIDE / width.max(height)).clamp(1, MOST_PIXELS_A_CELL);
    Ok(RgbImage::from_fn((width * pixels) as u32, (height * pixels) as u32, |u, v| {
        let (column, row) = (u as usize / pixels, height - 1 - v as usize / pixels);
        let at = row * width + column;
        match (first.get(at), second.get(at)) {
            (Some(&first), Some(&second)) => colour(first, second),
            _ => UNKNOWN,
        }
    }))
}

fn colour(first: i8, second: i8) -> Rgb<u8> {
    if first == second {
        let own = match first {
            cell if is_occupied(cell) => OCCUPIED,
            cell if is_free(cell) => FREE,
            cell if is_known(cell) => mix(FREE, OCCUPIED, f64::from(cell) / 100.0),
            _ => UNKNOWN,
        };
        return mix(own, FREE, PALENESS);
    }
    match (is_occupied(first), is_occupied(second)) {
        (true, false) => ONLY_FIRST,
        (false, true) => ONLY_SECOND,
        _ => OTHERWISE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cell_that_differs_has_the_colour_of_its_change() {
        let image = render_difference(2, &[100, 0, -1, 0], &[0, 100, 0, 0]).unwrap();
        assert_eq!(image.dimensions(), (32, 32));
        let cell = |column: u32, row: u32| *image.get_pixel(column * 16 + 8, (1 - row) * 16 + 8);
        assert_eq!([cell(0, 0), cell(1, 0), cell(0, 1)], [ONLY_FIRST, ONLY_SECOND, OTHERWISE]);
        assert_eq!(cell(1, 1), FREE);
    }

    #[test]
    fn grids_of_different_sizes_and_empty_ones_are_refused() {
        assert!(render_difference(2, &[0, 0], &[0]).is_err());
        assert!(render_difference(2, &[0, 0, 0], &[0, 0, 0]).is_err());
        assert!(render_difference(0, &[], &[]).is_err());
        assert!(render_difference(100_000, &vec![0; 100_000], &vec![1; 100_000]).is_err());
    }
}
