//! Merging by the maps alone: how often it is right, whether it is ever wrong, and what the verifier's score means.
//!
//! - **random**: pairs of robots of one simulated building, with any overlap, drift, noise, furniture and resolution.
//! - **unrelated**: robots of two buildings.
//! - **varied**: robots of one building of any kind, and robots of two of them.
//! - **alike**: buildings that look the same after half a turn, or all of whose rooms are alike.
//! - **recorded**: logs with their truth.
//! - **teams**: many robots in one building.
//!
//! The parameters and weights of the stages were chosen on the tuning seeds. What is published is measured on others.

mod calibration;
pub(crate) mod kinds;
mod many_robots;
mod pairs;
mod trial;
pub(crate) mod worlds;

use super::results::Results;
use anyhow::Result;
use calibration::Calibration;
use clap::Args;
use gridweave::table::Table;
use gridweave_runtime::stage::Registry;
use rayon::prelude::*;
use std::path::PathBuf;
use trial::PairTrial;
use worlds::Seeds;

/// Arguments of the experiment `align`.
#[derive(Debug, Args)]
pub(super) struct AlignArgs {
    /// Random pairs of one building.
    #[arg(long, default_value_t = 500)]
    pairs: u64,
    /// Pairs of two buildings.
    #[arg(long, default_value_t = 200)]
    unrelated: u64,
    /// Pairs in buildings whose parts are alike.
    #[arg(long, default_value_t = 50)]
    alike: u64,
    /// Pairs of one building of any kind: flats, offices, corridors, halls, warehouses, campuses, symmetric and
    /// repeated ones.
    #[arg(long, default_value_t = 400)]
    varied: u64,
    /// Each first robot of these is also paired with the second robot of so many of the buildings that follow.
    #[arg(long, default_value_t = 2)]
    varied_unrelated: usize,
    /// Numbers of robots in one building.
    #[arg(long, value_delimiter = ',', default_values_t = [4, 8, 16, 32, 64])]
    teams: Vec<u32>,
    /// A folder with recorded logs: LOG.mcap, each with its LOG.truth.json if its robots belong together.
    #[arg(long, value_name = "FOLDER")]
    logs: Option<PathBuf>,
    /// The pipeline that merges.
    #[arg(long, default_value = "map_merge")]
    pipeline: String,
    /// Use the seeds on which the parameters were chosen.
    #[arg(long)]
    tuning: bool,
}

/// Does the experiment.
pub(super) fn run(args: &AlignArgs, registry: &Registry, results: &mut Results) -> Result<()> {
    let seeds = if args.tuning { Seeds::Tuning } else { Seeds::HeldOut };
    let all = |count: u64, one: &(dyn Fn(u64) -> Result<Vec<PairTrial>> + Sync)| -> Result<Vec<PairTrial>> {
        let trials: Vec<Vec<PairTrial>> = (0..count).into_par_iter().map(one).collect::<Result<_>>()?;
        Ok(trials.into_iter().flatten().collect())
    };
    let merge = |world: &worlds::PairWorld| trial::merge(world, &args.pipeline, registry);
    let random = all(args.pairs, &|number| merge(&worlds::random(seeds, number, registry)?))?;
    if !random.is_empty() {
        pairs::report_random(&random, results)?;
    }
    let unrelated = all(args.unrelated, &|number| merge(&worlds::unrelated(seeds, number, registry)?))?;
    let alike = all(args.alike, &|number| merge(&worlds::alike(seeds, number, registry)?))?;
    let (varied, varied_unrelated) = varied(args, seeds, registry)?;
    let mut recorded = Vec::new();
    for log in args.logs.iter().map(|folder| worlds::recorded(folder)).collect::<Result<Vec<_>>>()?.iter().flatten() {
        recorded.extend(merge(log)?);
    }
    let by_kind = pairs::by_kind(&varied);
    let mut sets = vec![("random", &random), ("two buildings", &unrelated), ("parts alike", &alike)];
    sets.extend(by_kind.iter().map(|(kind, trials)| (*kind, trials)));
    sets.extend([("two buildings of any kind", &varied_unrelated), ("recorded", &recorded)]);
    if sets.iter().any(|(_, trials)| !trials.is_empty()) {
        results.table("align", "Merging by the maps alone", &pairs::totals(&sets))?;
        let mut table = Table::new(PairTrial::HEADS);
        for (set, trial) in sets.iter().flat_map(|(set, trials)| trials.iter().map(move |trial| (*set, trial))) {
            table.row(trial.cells(set));
        }
        results.data("align_trials", &table)?;
        let judged: Vec<&PairTrial> = sets.iter().flat_map(|(_, trials)| trials.iter()).collect();
        Calibration::of(&judged).report(results)?;
    }
    many_robots::run(&args.teams, seeds, &args.pipeline, registry, results)
}

/// Pairs of one building of any kind, and of two.
fn varied(args: &AlignArgs, seeds: Seeds, registry: &Registry) -> Result<(Vec<PairTrial>, Vec<PairTrial>)> {
    let worlds: Vec<worlds::PairWorld> =
        (0..args.varied).into_par_iter().filter_map(|number| worlds::varied(seeds, number, registry)).collect();
    let merge = |world: &worlds::PairWorld| trial::merge(world, &args.pipeline, registry);
    let together = worlds.par_iter().map(merge).collect::<Result<Vec<_>>>()?;
    let pairs: Vec<[usize; 2]> = (0..worlds.len())
        .flat_map(|first| (1..=args.varied_unrelated).map(move |apart| [first, first + apart]))
        .filter(|[_, second]| *second < worlds.len())
        .collect();
    let apart = pairs
        .par_iter()
        .map(|&[first, second]| merge(&worlds::varied_unrelated(&worlds[first], &worlds[second])?))
        .collect::<Result<Vec<_>>>()?;
    Ok((together.into_iter().flatten().collect(), apart.into_iter().flatten().collect()))
}
