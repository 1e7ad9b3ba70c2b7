//! Pictures of maps for people: one map in grey, or the maps of several robots laid over each other, each in a colour
//! of its own, with whatever else there is to show on them.
//!
//! North of a picture is the y axis of the world. A picture shows the axes of the world at its origin (x red, y green)
//! and, below the map, a scale bar of a round length with that length, and what the colours stand for. It is written as PNG, SVG
//! or PDF.

mod colour;
mod decoration;
mod difference;
mod error;
mod grid_lines;
mod layer;
mod legend;
mod marks;
mod sink;
mod view;
mod ways;

pub use difference::render_difference;
pub use error::PictureError;
pub use gridweave_runtime::robot_colour::robot_colour;
pub use layer::MapLayer;
pub use marks::{Mark, Marks, Shape};
pub use sink::{check_format, kind};
pub use ways::ways;

use crate::drawing::Drawing;
use crate::file::replace;
use colour::{FREE, OCCUPIED, UNKNOWN};
use image::RgbImage;
use layer::{Coverage, PlacedLayer};
use rayon::prelude::*;
use std::path::Path;
use view::View;

/// What a picture shows.
#[derive(Clone, Copy, Debug, Default)]
pub struct Scene<'a> {
    /// The maps.
    pub maps: &'a [MapLayer<'a>],
    /// How their cells are drawn.
    pub cells: Cells,
    /// What is drawn on them, one upon the other.
    pub marks: &'a [Marks],
    /// Draws a line every so many metres.
    pub grid: Option<f64>,
}

/// How the cells of maps are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Cells {
    /// Unknown cells grey, free ones white, occupied ones black; of the first map only.
    #[default]
    Grey,
    /// Walls in the colour of their map, free space in a light tint of it. Where walls of two maps meet, the colour is darker.
    Coloured,
}

/// A picture, and what it takes to read it.
#[derive(Clone, Debug)]
pub struct Picture {
    /// The maps, and all that is drawn on them and beside them. No side of the maps is longer than 2400 pixels.
    pub drawing: Drawing,
    /// Metres a pixel.
    pub metres_per_pixel: f64,
    /// The length of the scale bar, metres.
    pub scale_bar: f64,
}

/// The formats of a picture, by the endings of file names.
pub const FORMATS: [&str; 3] = ["png", "svg", "pdf"];

impl Picture {
    /// Draws a scene.
    ///
    /// # Errors
    /// A map is none, nothing is known, or the lines of the grid would be too many.
    pub fn of(scene: &Scene<'_>) -> Result<Self, PictureError> {
        let colours: Vec<_> = scene.maps.iter().map(|map| map.colour).collect();
        let (image, view) = match scene.cells {
            Cells::Grey => render(&scene.maps[..scene.maps.len().min(1)], |shares| {
                let Coverage { wall, free } = shares.first().copied().unwrap_or_default();
                colour::mix(colour::mix(UNKNOWN, FREE, free), OCCUPIED, wall)
            })?,
            Cells::Coloured => render(scene.maps, |shares| colour::overlay(shares, &colours))?,
        };
        decoration::decorate(image, &view, scene)
    }

    /// The picture as a file, in the format that the ending of its name says: see [`FORMATS`].
    ///
    /// # Errors
    /// The ending is none of these, or the picture is too large.
    pub fn encode(&self, path: &Path) -> Result<Vec<u8>, PictureError> {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
        Ok(match ending.as_str() {
            "png" => self.drawing.png()?,
            "svg" => self.drawing.svg()?.into_bytes(),
            "pdf" => self.drawing.pdf()?,
            _ => return Err(PictureError::Format(path.to_owned())),
        })
    }

    /// Writes the picture to a file, in the format that the ending of its name says: see [`FORMATS`].
    ///
    /// # Errors
    /// The ending is none of these, the picture is too large, or the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), PictureError> {
        Ok(replace(&[(path, &self.encode(path)?)])?)
    }
}

/// Draws the maps; `paint` gives the colour of a pixel from the share of walls and free space that each map has in it.
fn render(
    maps: &[MapLayer<'_>],
    paint: impl Fn(&[Coverage]) -> image::Rgb<u8> + Sync,
) -> Result<(RgbImage, View), PictureError> {
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
    Ok((image, view))
}

#[cfg(test)]
mod tests;
