//! Pictures of maps for people: one map in grey, or the maps of several robots laid over each other, each in a colour
//! of its own.
//!
//! North of a picture is the y axis of the world. A picture shows the axes of the world at its origin (x red, y green)
//! and, below the map, a scale bar of a round length.

mod colour;
mod decoration;
mod difference;
mod error;
mod layer;
mod sink;
mod view;
mod ways;

pub use colour::robot_colour;
pub use difference::render_difference;
pub use error::PictureError;
pub use layer::MapLayer;
pub use sink::kind;
pub use ways::Ways;

use crate::file::replace;
use colour::{FREE, OCCUPIED, UNKNOWN};
use image::{ImageFormat, Rgb, RgbImage};
use layer::{Coverage, PlacedLayer};
use rayon::prelude::*;
use std::io::Cursor;
use std::path::Path;
use view::View;

/// A picture, and what it takes to read it.
#[derive(Clone, Debug)]
pub struct Picture {
    /// The pixels. No side is longer than 2400 but for the margin.
    pub image: RgbImage,
    /// Metres a pixel.
    pub metres_per_pixel: f64,
    /// The length of the scale bar, metres.
    pub scale_bar: f64,
}

impl Picture {
    /// The picture as a PNG file.
    pub fn png(&self) -> Result<Vec<u8>, PictureError> {
        let mut bytes = Cursor::new(Vec::new());
        self.image.write_to(&mut bytes, ImageFormat::Png).map_err(|error| PictureError::Png(error.to_string()))?;
        Ok(bytes.into_inner())
    }

    /// Writes the picture as a PNG file.
    pub fn save_png(&self, path: &Path) -> Result<(), PictureError> {
        let png = self.png()?;
        Ok(replace(&[(path, &png)])?)
    }
}

/// One map: unknown cells grey, free ones white, occupied ones black.
pub fn render_map(map: &MapLayer<'_>) -> Result<Picture, PictureError> {
    render(std::slice::from_ref(map), &[], |shares| {
        let Coverage { wall, free } = shares.first().copied().unwrap_or_default();
        colour::mix(colour::mix(UNKNOWN, FREE, free), OCCUPIED, wall)
    })
}

/// The maps of several robots, each where its pose puts it: walls in the colour that [`robot_colour`] gives the map by
/// its place in the list, free space in a light tint of it. Where walls of two maps meet, the colour is darker.
/// Topological maps are drawn on top.
pub fn render_overlay(maps: &[MapLayer<'_>], ways: &[Ways<'_>]) -> Result<Picture, PictureError> {
    render(maps, ways, colour::overlay)
}

/// Draws the maps; `paint` gives the colour of a pixel from the share of walls and free space that each map has in it.
fn render(
    maps: &[MapLayer<'_>],
    ways: &[Ways<'_>],
    paint: impl Fn(&[Coverage]) -> Rgb<u8> + Sync,
) -> Result<Picture, PictureError> {
    let layers: Vec<PlacedLayer<'_>> = maps
        .iter()
        .enumerate()
        .map(|(index, map)| PlacedLayer::new(map).map_err(|problem| PictureError::Map { index, problem }))
        .collect::<Result<_, _>>()?;
    let finest = layers.iter().map(|layer| layer.resolution).fold(f64::INFINITY, f64::min);
    let outlines = layers.iter().flat_map(PlacedLayer::outline);
    let view = View::of(outlines, layers.len(), finest).ok_or(PictureError::Empty)?;

    let mut image = RgbImage::from_pixel(view.width, view.height, UNKNOWN);
    let row = view.width as usize * 3;
    image.par_chunks_exact_mut(row.max(1)).enumerate().for_each(|(v, pixels)| {
        let mut shares = vec![Coverage::default(); layers.len()];
        for (u, pixel) in pixels.chunks_exact_mut(3).enumerate() {
            for (share, layer) in shares.iter_mut().zip(&layers) {
                *share = layer.coverage(&view, u, v);
            }
            pixel.copy_from_slice(&paint(&shares).0);
        }
    });
    ways.iter().for_each(|ways| ways.draw(&mut image, &view));
    decoration::draw_axes(&mut image, &view);
    let (image, scale_bar) = decoration::frame_with_scale_bar(&image, &view);
    Ok(Picture { image, metres_per_pixel: view.metres_per_pixel, scale_bar })
}

#[cfg(test)]
mod tests;
