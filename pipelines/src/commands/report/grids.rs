//! Maps for the page: reduced in size, as PNG.

use super::model::MapImage;
use anyhow::{Context, Result};
use base64::prelude::{BASE64_STANDARD, Engine};
use gridweave_runtime::ros::MapMetaData;
use gridweave_runtime::ros::cell::{is_known, is_occupied};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

/// The shade of an unknown cell.
const UNKNOWN: u8 = 255;

/// Encodes a map with at most `side` cells along a side; a larger map gets larger cells.
pub(super) fn grid(info: &MapMetaData, cells: &[i8], side: usize) -> Result<Option<MapImage>> {
    let (width, height) = (info.width as usize, info.height as usize);
    let resolution = f64::from(info.resolution);
    let is_sound = width.checked_mul(height) == Some(cells.len()) && resolution.is_finite() && resolution > 0.0;
    let origin = info.origin.planar();
    let numbers = [origin.translation.x, origin.translation.y, origin.rotation.angle()];
    if cells.is_empty() || !is_sound || numbers.iter().any(|value| !value.is_finite()) {
        return Ok(None);
    }
    let factor = width.max(height).div_ceil(side.max(1));
    let (columns, rows) = (width.div_ceil(factor), height.div_ceil(factor));
    let mut shades = vec![UNKNOWN; columns * rows];
    for (row, cells) in cells.chunks_exact(width).enumerate() {
        let line = &mut shades[(rows - 1 - row / factor) * columns..][..columns];
        for (column, &cell) in cells.iter().enumerate() {
            let shade = &mut line[column / factor];
            // An occupied cell takes precedence, then a known one.
            if is_known(cell) && (*shade == UNKNOWN || is_occupied(cell) && cell.cast_unsigned() > *shade) {
                *shade = cell.cast_unsigned();
            }
        }
    }
    let mut png = Vec::new();
    let encoder = PngEncoder::new_with_quality(&mut png, CompressionType::Best, FilterType::NoFilter);
    let written = encoder.write_image(&shades, columns as u32, rows as u32, ExtendedColorType::L8);
    written.context("cannot encode a map as PNG")?;
    let [x, y, yaw] = numbers;
    Ok(Some(MapImage {
        width: columns as u32,
        height: rows as u32,
        resolution: resolution * factor as f64,
        x,
        y,
        yaw,
        png: BASE64_STANDARD.encode(png),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shades(width: u32, cells: &[i8], side: usize) -> (Vec<u8>, f64) {
        let info = MapMetaData { width, height: cells.len() as u32 / width, resolution: 0.5, ..Default::default() };
        let grid = grid(&info, cells, side).unwrap().unwrap();
        let png = BASE64_STANDARD.decode(&grid.png).unwrap();
        (image::load_from_memory(&png).unwrap().to_luma8().into_raw(), grid.resolution)
    }

    #[test]
    fn cells_keep_their_values_and_the_last_row_comes_first() {
        assert_eq!(shades(2, &[0, 100, -1, 37], 10), (vec![255, 37, 0, 100], 0.5));
    }

    #[test]
    fn a_large_map_gets_larger_cells_that_keep_its_walls() {
        assert_eq!(shades(4, &[0, 100, -1, -1, 3, 0, -1, 0], 2), (vec![100, 0], 1.0));
    }

    #[test]
    fn an_invalid_map_is_left_out() {
        let info = MapMetaData { width: 2, height: 2, resolution: 0.5, ..Default::default() };
        assert!(grid(&info, &[0], 10).unwrap().is_none());
        assert!(grid(&MapMetaData { resolution: f32::NAN, ..info }, &[0; 4], 10).unwrap().is_none());
        assert!(grid(&MapMetaData::default(), &[], 10).unwrap().is_none());
    }
}
