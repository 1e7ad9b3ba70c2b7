//! The probability grids of one tag, as figure 4 of the paper shows them.

use super::super::results::Results;
use super::drive::{Drive, REACH, READINGS};
use super::trial::{Conditions, Likelihood, Recording};
use anyhow::{Context, Result};
use gridweave_stages::shared::geometry::Point2;
use gridweave_stages::tags::tag_localizer::{self, GridSize, Posterior, Reading, ReadingGroups, Readout};
use image::{ImageFormat, Rgb, RgbImage};
use std::io::Cursor;

/// The numbers of readings of figure 4.
const COUNTS: [usize; 4] = [30, 100, 200, READINGS];
/// The drive that is shown.
const SEED: u64 = 4;
/// Cells along a side of a grid, which is a pixel each.
const CELLS: usize = 300;
/// Pixels between grids.
const GAP: u32 = 8;
const PAPER: Rgb<u8> = Rgb([255, 255, 255]);
const FRAME: Rgb<u8> = Rgb([208, 208, 208]);
const WAY: Rgb<u8> = Rgb([0, 158, 115]);
const TAG: Rgb<u8> = Rgb([213, 94, 0]);

/// Draws the grids of a straight and of a circling drive below each other.
pub(super) fn run(results: &mut Results) -> Result<()> {
    let drives = [Drive::Straight, Drive::Circling];
    let side = |count: usize| count as u32 * (CELLS as u32 + GAP) + GAP;
    let mut image = RgbImage::from_pixel(side(COUNTS.len()), side(drives.len()), FRAME);
    for (row, drive) in drives.into_iter().enumerate() {
        let recording = Recording::new(drive, &Conditions::default(), SEED);
        for (column, count) in COUNTS.into_iter().enumerate() {
            let corner = (side(column), side(row));
            draw(&mut image, corner, &recording, count);
        }
    }
    let mut png = Cursor::new(Vec::new());
    image.write_to(&mut png, ImageFormat::Png).context("cannot make a PNG file of the grids")?;
    results.file("localization_grids.png", &png.into_inner())
}

/// Draws the grid after `count` readings, its upper left pixel at `corner`. The y axis points up.
fn draw(image: &mut RgbImage, corner: (u32, u32), recording: &Recording, count: usize) {
    let parameters = Likelihood::Paper.parameters(Readout::Blocks);
    let mut groups = ReadingGroups::default();
    for &(position, range) in &recording.readings[..count] {
        let stddev = parameters.range_stddev;
        groups.add(&Reading { position, range, stddev }, parameters.min_travel);
    }
    let product =
        tag_localizer::Likelihood::of_rings(groups.rings(parameters.pose_stddev), parameters.outlier_share, REACH);
    let grid = GridSize { centre: recording.readings[0].0.place, cells: CELLS, resolution: parameters.resolution };
    let mut masses = vec![0.0; CELLS * CELLS];
    for leaf in Posterior::new(&product, grid).iter().flat_map(|posterior| &posterior.leaves) {
        masses[leaf.row * CELLS + leaf.column] += leaf.mass;
    }
    let most = masses.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let mut paint = |column: usize, row: usize, colour: Rgb<u8>| {
        image.put_pixel(corner.0 + column as u32, corner.1 + (CELLS - 1 - row) as u32, colour);
    };
    for (index, mass) in masses.iter().enumerate() {
        // The root shows what is faint.
        let shade = (255.0 * (1.0 - (mass / most).sqrt())) as u8;
        let Rgb([red, green, blue]) = PAPER;
        paint(index % CELLS, index / CELLS, Rgb([red.min(shade), green.min(shade), blue.min(shade)]));
    }
    let cell = |place: &Point2| {
        let from_corner = (place - grid.centre) / grid.resolution + nalgebra::Vector2::repeat(0.5 * CELLS as f64);
        let on_grid = from_corner.iter().all(|value| (0.0..CELLS as f64).contains(value));
        on_grid.then_some((from_corner.x as usize, from_corner.y as usize))
    };
    for place in &recording.scene.places[..count] {
        if let Some((column, row)) = cell(place) {
            paint(column, row, WAY);
        }
    }
    // A ring round the tag, which leaves the probability there to be seen.
    for step in 0..90 {
        let angle = std::f64::consts::TAU * f64::from(step) / 90.0;
        let ring = recording.scene.tag + nalgebra::Vector2::new(angle.cos(), angle.sin()) * 0.15;
        if let Some((column, row)) = cell(&ring) {
            paint(column, row, TAG);
        }
    }
}
