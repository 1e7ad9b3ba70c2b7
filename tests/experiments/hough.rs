//! The Hough spectra of the last maps of a log, and how they are correlated.

use crate::log::last_maps;
use crate::plot::{Axis, Plot, Series, Shape};
use crate::results::Results;
use anyhow::{Context, Result, bail};
use clap::Args;
use gridweave::table::Table;
use gridweave_published::hough_spectrum_aligner::{HoughSpectrum, WallCells, correlate_spectra, rotations};
use gridweave_stages::registration::search::NamedMap;
use gridweave_stages::shared::geometry::{Grid, GridGeometry};
use std::path::PathBuf;

/// Directions of half a turn: half a degree apart.
const DIRECTIONS: usize = 360;
/// The width of a line, metres.
const LINE: f64 = 0.05;
/// Maps that are larger than this are no maps of buildings, metres.
const MOST_EXTENT: f64 = 1000.0;
/// Rotations nearer than this to a better one are not another one, radians.
const APART: f64 = 0.1;

#[derive(Debug, Args)]
pub(super) struct HoughArgs {
    /// A log with maps of two robots or more.
    #[arg(long, value_name = "FILE")]
    log: PathBuf,
}

pub(super) fn run(args: &HoughArgs, results: &mut Results) -> Result<()> {
    let mut spectra: Vec<(String, HoughSpectrum)> = Vec::new();
    for (topic, map) in last_maps(&args.log)? {
        let grid = Grid::new(GridGeometry::from(&map.info), &map.cells)
            .with_context(|| format!("the last map on {topic} cannot be used"))?;
        let walls = WallCells::new(&NamedMap { robot: &topic, grid }, MOST_EXTENT)
            .with_context(|| format!("the last map on {topic} cannot be used"))?;
        let spectrum = HoughSpectrum::new(&walls, DIRECTIONS, LINE);
        spectra.push((topic, spectrum));
    }
    let [(first, a), (second, b), ..] = &spectra[..] else {
        bail!("{} holds no maps of two robots; another log may", args.log.display());
    };
    let degrees = |step: usize| step as f64 * 180.0 / DIRECTIONS as f64;
    let curve = |values: &[f64]| {
        // Maps with more walls would dwarf the others.
        let most = values.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        values.iter().enumerate().map(|(step, value)| (degrees(step), value / most)).collect()
    };
    let curves = spectra.iter().map(|(topic, spectrum)| Series::new(topic, curve(&spectrum.values)));
    let spectrum_plot =
        plot("Hough spectra", ["direction of a wall's normal, degrees", "share of the most"], curves.collect());
    results.plot("hough_spectra", &spectrum_plot)?;

    let mut correlation = Series::new(format!("{second} on {first}"), curve(&correlate_spectra(a, b)));
    let mut table = Table::new(["first map", "second map", "rotation, degrees", "deviation, degrees"]);
    for rotation in rotations(a, b, 2, APART) {
        correlation = match correlation.mark {
            None => correlation.with_mark(rotation.angle.to_degrees()),
            Some(_) => correlation,
        };
        let numbers = [rotation.angle.to_degrees(), rotation.deviation.to_degrees()];
        table.row([first.clone(), second.clone()].into_iter().chain(numbers.map(|number| format!("{number:.3}"))));
    }
    let labels = ["rotation, degrees", "share of the most"];
    results.plot("hough_correlation", &plot("Correlation of two spectra", labels, vec![correlation]))?;
    results.table("hough", "Rotations by Hough spectra, up to half a turn", &table)
}

fn plot(title: &str, [x, y]: [&str; 2], curves: Vec<Series>) -> Plot {
    Plot { title: title.into(), x: Axis::new(x).range(0.0, 180.0), y: Axis::new(y), shape: Shape::Lines(curves) }
}
