//! A map in a picture.

use super::view::View;
use crate::drawing::Colour;
use gridweave_runtime::ros::MapMetaData;
use gridweave_runtime::ros::cell::{UNKNOWN, is_free, is_known, is_occupied};
use nalgebra::{Isometry2, Point2, Vector2};

/// A map, and its pose in the picture.
#[derive(Clone, Copy, Debug)]
pub struct MapLayer<'a> {
    /// The name in the legend, if any: that of the robot.
    pub name: &'a str,
    /// The colour of its walls in an overlay; see [`robot_colour`](super::robot_colour).
    pub colour: Colour,
    /// Size, resolution and origin.
    pub info: MapMetaData,
    /// The cells row by row, row 0 at the origin: -1 unknown, 0 free to 100 occupied.
    pub cells: &'a [i8],
    /// The pose of the map's frame in the world of the picture.
    pub transform_world_map: Isometry2<f64>,
}

/// The fractions of a pixel that are occupied and free, 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Coverage {
    pub(super) wall: f64,
    pub(super) free: f64,
}

/// A validated map.
pub(super) struct PlacedLayer<'a> {
    cells: &'a [i8],
    width: usize,
    pub(super) resolution: f64,
    /// The pose of the outer corner of cell (0, 0) in the world.
    transform_world_grid: Isometry2<f64>,
}

impl<'a> PlacedLayer<'a> {
    /// Validates a map.
    pub(super) fn new(map: &MapLayer<'a>) -> Result<Self, &'static str> {
        let (width, height) = (map.info.width as usize, map.info.height as usize);
        if width.checked_mul(height) != Some(map.cells.len()) {
            return Err("does not have width x height cells");
        }
        let resolution = f64::from(map.info.resolution);
        if !(resolution.is_finite() && resolution > 0.0) {
            return Err("has a resolution that is not a positive number");
        }
        let transform_world_grid = map.transform_world_map * map.info.origin.planar();
        let pose = transform_world_grid.translation.vector;
        if !(pose.iter().all(|value| value.is_finite()) && transform_world_grid.rotation.angle().is_finite()) {
            return Err("has a pose that is not finite");
        }
        Ok(Self { cells: map.cells, width, resolution, transform_world_grid })
    }

    /// The outer corners of the known cells of each row, in the world.
    pub(super) fn outline(&self) -> impl Iterator<Item = Point2<f64>> + '_ {
        let rows = self.cells.chunks_exact(self.width.max(1)).enumerate();
        rows.flat_map(move |(row, cells)| {
            let first = cells.iter().position(|&cell| is_known(cell));
            let last = cells.iter().rposition(|&cell| is_known(cell));
            first.zip(last).into_iter().flat_map(move |(first, last)| {
                let corners = [(first, row), (first, row + 1), (last + 1, row), (last + 1, row + 1)];
                corners.map(|(column, row)| {
                    let corner = Point2::new(column as f64, row as f64) * self.resolution;
                    self.transform_world_grid * corner
                })
            })
        })
    }

    /// The grid of samples of the pixels of a view.
    pub(super) fn samples(&self, view: &View) -> PixelSamples<'_> {
        let to_grid =
            |u: f64, v: f64| self.transform_world_grid.inverse_transform_point(&view.world(u, v)) / self.resolution;
        let per_side = view.samples_per_side;
        let half = 0.5 / per_side as f64;
        let corner = to_grid(0.0, 0.0);
        let (right, down) = (to_grid(1.0, 0.0) - corner, to_grid(0.0, 1.0) - corner);
        PixelSamples { layer: self, first: corner + half * (right + down), right, down, per_side }
    }

    /// The cell at a position in cells; unknown outside of the map.
    fn cell(&self, place: Point2<f64>) -> i8 {
        if !(place.x >= 0.0 && place.y >= 0.0 && place.x < self.width as f64) {
            return UNKNOWN;
        }
        let index = (place.y as usize).checked_mul(self.width).and_then(|row| row.checked_add(place.x as usize));
        index.and_then(|index| self.cells.get(index)).copied().unwrap_or(UNKNOWN)
    }
}

/// Where the samples of the pixels of a view lie on a map.
pub(super) struct PixelSamples<'a> {
    layer: &'a PlacedLayer<'a>,
    /// The first sample of the pixel in column 0 and row 0, cells.
    first: Point2<f64>,
    /// The way from a pixel to the next one of its row and of its column, cells.
    right: Vector2<f64>,
    down: Vector2<f64>,
    /// The number of samples along each side of a pixel.
    per_side: usize,
}

impl PixelSamples<'_> {
    /// The coverage of the pixel in column `u` and row `v`.
    pub(super) fn coverage(&self, u: usize, v: usize) -> Coverage {
        let step = 1.0 / self.per_side as f64;
        let first = self.first + self.right * u as f64 + self.down * v as f64;
        let (mut walls, mut free) = (0u32, 0u32);
        for i in 0..self.per_side {
            let column = first + self.right * (i as f64 * step);
            for j in 0..self.per_side {
                let cell = self.layer.cell(column + self.down * (j as f64 * step));
                walls += u32::from(is_occupied(cell));
                free += u32::from(is_free(cell));
            }
        }
        if walls + free == 0 {
            return Coverage::default();
        }
        let count = (self.per_side * self.per_side) as f64;
        // A wall is one cell wide and must stay visible when cells are smaller than pixels.
        let wall = (2.0 * f64::from(walls) / count).min(1.0);
        Coverage { wall, free: f64::from(free) / (count - f64::from(walls)).max(1.0) }
    }
}
