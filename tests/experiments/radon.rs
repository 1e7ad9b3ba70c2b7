//! The energy of the Radon transform over the angle, of the last maps of a log, and how they are correlated.

use crate::log::last_maps;
use crate::plot::{Axis, Plot, Series, Shape};
use crate::results::Results;
use anyhow::{Context, Result, bail};
use clap::Args;
use gridweave::table::Table;
use gridweave_published::radon_aligner::{QuarterEnergy, WallPoints, energy};
use gridweave_stages::shared::geometry::{Grid, GridGeometry};
use std::path::PathBuf;

/// Angles of a quarter turn: a quarter of a degree apart.
const STEPS: usize = 360;

#[derive(Debug, Args)]
pub(super) struct RadonArgs {
    /// A log with maps of two robots or more.
    #[arg(long, value_name = "FILE")]
    log: PathBuf,
}

pub(super) fn run(args: &RadonArgs, results: &mut Results) -> Result<()> {
    let mut energies: Vec<(String, QuarterEnergy)> = Vec::new();
    for (topic, map) in last_maps(&args.log)? {
        let grid = Grid::new(GridGeometry::from(&map.info), &map.cells)
            .with_context(|| format!("the last map on {topic} cannot be used"))?;
        energies.push((topic, QuarterEnergy::new(&energy(&WallPoints::of(&grid), STEPS))));
    }
    let [(first, a), (second, b), ..] = &energies[..] else {
        bail!("{} holds no maps of two robots; another log may", args.log.display());
    };
    let degrees = |step: usize| step as f64 * 90.0 / STEPS as f64;
    let curve = |values: &[f64]| values.iter().enumerate().map(|(step, value)| (degrees(step), *value)).collect();
    let curves = energies.iter().map(|(topic, energy)| Series::new(topic, curve(energy.values())));
    let energy_plot =
        plot("Radon energy over the angle", ["angle, degrees", "energy, less its mean"], curves.collect());
    results.plot("radon_energy", &energy_plot)?;

    let mut correlation = Series::new(format!("{second} on {first}"), curve(&a.correlation(b)));
    let mut table = Table::new(["first map", "second map", "rotation, degrees", "correlation", "deviation, degrees"]);
    if let Some(peak) = a.rotation_of(b) {
        correlation = correlation.with_mark(peak.rotation.to_degrees());
        let numbers = [peak.rotation.to_degrees(), peak.correlation, peak.deviation.to_degrees()];
        let cells = [first.clone(), second.clone()].into_iter().chain(numbers.map(|number| format!("{number:.3}")));
        table.row(cells);
    }
    let correlation_plot = plot("Correlation of two energies", ["rotation, degrees", "correlation"], vec![correlation]);
    results.plot("radon_correlation", &correlation_plot)?;
    results.table("radon", "Rotation by the directions of walls, up to quarter turns", &table)
}

fn plot(title: &str, [x, y]: [&str; 2], curves: Vec<Series>) -> Plot {
    Plot { title: title.into(), x: Axis::new(x).range(0.0, 90.0), y: Axis::new(y), shape: Shape::Lines(curves) }
}
