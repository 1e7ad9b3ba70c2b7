//! Pictures of maps: one map in grey, or an overlay of the maps of several robots in different colours, with further
//! marks on them.
//!
//! The y axis of the world points up. A picture shows the axes of the world at its origin (x red, y green) and, below
//! the map, a labelled scale bar and a legend of the colours. It is written as PNG, SVG or PDF.

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
use crate::file::replace_or_leave;
use colour::{FREE, OCCUPIED, UNKNOWN};
use image::RgbImage;
use layer::{Coverage, PixelSamples, PlacedLayer};
use rayon::prelude::*;
use std::path::Path;
use view::View;

/// The contents of a picture.
#[derive(Clone, Copy, Debug, Default)]
pub struct Scene<'a> {
    /// The maps.
    pub maps: &'a [MapLayer<'a>],
    /// How cells are coloured.
    pub cells: Cells,
    /// The marks on the maps, in drawing order.
    pub marks: &'a [Marks],
    /// The distance between grid lines, metres.
    pub grid: Option<f64>,
}

/// How the cells of maps are coloured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Cells {
    /// Unknown grey, free white, occupied black; shows the first map only.
    #[default]
    Grey,
    /// Walls in the colour of their map, free space in a light tint of it. Walls of several maps at one place are
    /// darker.
    Coloured,
}

/// A picture and its scale.
#[derive(Clone, Debug)]
pub struct Picture {
    /// The maps with everything on them and beside them. No side of the maps is longer than 2400 pixels.
    pub drawing: Drawing,
    /// Metres per pixel.
    pub metres_per_pixel: f64,
    /// The length of the scale bar, metres.
    pub scale_bar: f64,
}

/// The supported formats, as file extensions.
pub const FORMATS: [&str; 3] = ["png", "svg", "pdf"];

impl Picture {
    /// Draws a scene.
    ///
    /// # Errors
    /// A map is invalid, nothing is known, or there would be too many grid lines.
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

    /// Encodes the picture in the format of the file's extension; see [`FORMATS`].
    ///
    /// # Errors
    /// The extension is not supported, or the picture is too large.
    pub fn encode(&self, path: &Path) -> Result<Vec<u8>, PictureError> {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
        Ok(match ending.as_str() {
            "png" => self.drawing.png()?,
            "svg" => self.drawing.svg()?.into_bytes(),
            "pdf" => self.drawing.pdf()?,
            _ => return Err(PictureError::Format(path.to_owned())),
        })
    }

    /// Writes the picture to a file in the format of its extension; see [`FORMATS`].
    ///
    /// # Errors
    /// The extension is not supported, the picture is too large, or the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), PictureError> {
        self.save_or_leave(path, false)
    }

    /// Writes the picture as [`save`](Self::save) does, or leaves it as a part.
    fn save_or_leave(&self, path: &Path, leave_part: bool) -> Result<(), PictureError> {
        Ok(replace_or_leave(&[(path, &self.encode(path)?)], leave_part)?)
    }
}

/// Renders the maps; `paint` gives the colour of a pixel from the coverage by each map.
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
    let samples: Vec<PixelSamples<'_>> = layers.iter().map(|layer| layer.samples(&view)).collect();
    image.par_chunks_exact_mut(row.max(1)).enumerate().for_each(|(v, pixels)| {
        let mut shares = vec![Coverage::default(); layers.len()];
        for (u, pixel) in pixels.chunks_exact_mut(3).enumerate() {
            for (share, samples) in shares.iter_mut().zip(&samples) {
                *share = samples.coverage(u, v);
            }
            pixel.copy_from_slice(&paint(&shares).0);
        }
    });
    Ok((image, view))
}

#[cfg(test)]
mod tests;
