//! Merging with few common tags: how often it is right, and whether it is ever wrong.
//!
//! - **few**: robots of one simulated building with few tags.
//! - **two**: robots of one building, simulated or recorded, of whose tags all but two are taken away.
//! - **moved**: the same, where both tags are for one robot so many metres along its walls from where they are for the
//!   other, as a reflection in both or a labelled box that was carried away might have it. The tags' distance and the
//!   directions agree. Wherever the merge is right, the walls have mended it.
//! - **unrelated**: robots of two buildings in which two, three or five tags bear the same ids.
//! - **look-alike**: robots of two buildings in which two tags bear the same ids, are as far apart, and are turned
//!   against each other as the walls are. Only the walls can distinguish them; few unrelated pairs get so far.
//!
//! A pair is wrong if it is so in the end, and "ever wrong" if it was merged wrongly at any time of the run.

mod building;

mod known;
mod look_alike;
mod outcome;
mod trials;

use super::results::Results;
use super::trial::World;
use anyhow::Result;
use building::{Building, merge_two};
use clap::Args;
use gridweave::table::Table;
use gridweave_runtime::stage::Registry;
use outcome::{Count, PairOutcome, add_trial, all_trials};
use rayon::prelude::*;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use trials::{Trial, moved_alike, two_tags, with_look_alikes, with_shared_ids};

/// How many common tags are asked for: the paper's three, and two.
const NEEDED: [usize; 2] = [3, 2];
/// How many tags the buildings with few tags have.
const FEW: RangeInclusive<u32> = 4..=15;
/// How many tags bear the same ids in unrelated buildings.
const SHARED: [usize; 3] = [2, 3, 5];
/// How far two tags are moved alike, metres.
const MOVED: [f64; 3] = [1.0, 2.0, 3.0];

/// Arguments of the experiment `few-tags`.
#[derive(Debug, Args)]
pub(super) struct FewTagsArgs {
    /// How many buildings with each number of tags.
    #[arg(long, default_value_t = 20)]
    seeds: u64,
    /// How many buildings of each kind are taken apart and paired with each other.
    #[arg(long, default_value_t = 15)]
    buildings: u64,
    /// How many choices of two tags are tried in each pair of robots.
    #[arg(long, default_value_t = 4)]
    choices: usize,
    /// A folder with recorded logs to take apart as well: LOG.mcap, each with its LOG.truth.json if its robots belong
    /// together. In them ten times as many choices are tried.
    #[arg(long, value_name = "FOLDER")]
    logs: Option<PathBuf>,
}

/// Does the experiment.
pub(super) fn run(args: &FewTagsArgs, registry: &Registry, results: &mut Results) -> Result<()> {
    let mut all = all_trials();
    results.table("few_tags", "Buildings with few tags", &few(args.seeds, registry, &mut all)?)?;

    let heads = ["buildings", "tags needed", "pairs"].into_iter().chain(Count::HEADS).chain(["worst m", "worst deg"]);
    let mut two = Table::new(heads);
    let heads = ["buildings", "shared ids", "tags needed", "pairs", "wrong", "ever wrong"];
    let refused = ["refused by the tags", "by the directions", "by the walls"];
    let mut unrelated = Table::new(heads.into_iter().chain(refused));
    let mut kinds = Vec::new();
    for (name, setting) in [("furnished", "clutter=0.12"), ("bare", "clutter=0")] {
        kinds.push((name, args.choices, Building::simulated(setting, args.buildings, registry)?));
    }
    if let Some(folder) = &args.logs {
        kinds.push(("recorded", 10 * args.choices, Building::recorded(folder, registry)?));
    }
    for (name, choices, buildings) in &kinds {
        let (related, others): (Vec<_>, Vec<_>) =
            two_tags(buildings, *choices).into_iter().partition(|trial| trial.truth.is_some());
        let moved = MOVED.map(|metres| (format!("{name}, both moved by {metres} m"), moved_alike(buildings, metres)));
        let two_sets = [((*name).to_owned(), related), (format!("{name}, robots of two buildings"), others)];
        for (name, trials) in two_sets.into_iter().chain(moved) {
            for needed in NEEDED.into_iter().filter(|_| !trials.is_empty()) {
                let count = merge_all(&format!("two, {name}"), &trials, needed, registry, &mut all)?;
                let cells = [name.clone(), needed.to_string(), trials.len().to_string()].into_iter();
                two.row(cells.chain(count.cells()).chain(count.worst()));
            }
        }
        let strangers = SHARED.map(|shared| (shared.to_string(), with_shared_ids(buildings, shared)));
        let look_alike = ("2 that look alike".to_owned(), with_look_alikes(buildings, *choices));
        for (shared, trials) in strangers.into_iter().chain([look_alike]) {
            // Where there are two, three are not found.
            for needed in NEEDED.into_iter().filter(|needed| *needed == 2 || !shared.starts_with('2')) {
                let count = merge_all(&format!("unrelated, {name}, {shared}"), &trials, needed, registry, &mut all)?;
                let cells = [(*name).to_owned(), shared.clone(), needed.to_string(), trials.len().to_string()];
                let wrong = [count.wrong().to_string(), count.ever_wrong().to_string()];
                unrelated.row(cells.into_iter().chain(wrong).chain(count.refusals()));
            }
        }
    }
    results.table("few_tags_two", "All but two tags taken away", &two)?;
    results.table("few_tags_unrelated", "Robots of two buildings", &unrelated)?;
    results.data("few_tags_trials", &all)
}

fn settings(needed: usize) -> Vec<String> {
    vec![format!("common_tags.min_tags={needed}")]
}

/// Simulated buildings with few tags.
fn few(seeds: u64, registry: &Registry, all: &mut Table) -> Result<Table> {
    let heads = ["tags in the building", "tags needed", "pairs"].into_iter();
    let mut table = Table::new(heads.chain(Count::HEADS).chain(["worst m", "worst deg"]));
    let mut sums = NEEDED.map(|_| Count::default());
    for tags in FEW {
        let one = |seed: u64| -> Result<Vec<PairOutcome>> {
            let world = World::simulate(&["robots=2".to_owned(), format!("tags={tags}")], seed, registry)?;
            NEEDED.iter().map(|&needed| PairOutcome::of(&world, "robot2", &settings(needed), registry)).collect()
        };
        let outcomes: Vec<Vec<PairOutcome>> = (1..=seeds).into_par_iter().map(one).collect::<Result<_>>()?;
        for (place, needed) in NEEDED.into_iter().enumerate() {
            let mut count = Count::default();
            for (seed, outcome) in (1..).zip(outcomes.iter().filter_map(|outcomes| outcomes.get(place))) {
                add_trial(all, &format!("few, {tags} tags"), &format!("seed {seed}"), needed, outcome);
                count.add(outcome.clone());
                sums[place].add(outcome.clone());
            }
            let cells = [tags.to_string(), needed.to_string(), seeds.to_string()].into_iter();
            table.row(cells.chain(count.cells()).chain(count.worst()));
        }
    }
    for (needed, sum) in NEEDED.into_iter().zip(&sums) {
        let cells = ["all".to_owned(), needed.to_string(), sum.all().to_string()].into_iter();
        table.row(cells.chain(sum.cells()).chain(sum.worst()));
    }
    Ok(table)
}

/// Merges the robots of all trials where so many common tags are needed.
fn merge_all(set: &str, trials: &[Trial<'_>], needed: usize, registry: &Registry, all: &mut Table) -> Result<Count> {
    let settings = settings(needed);
    let merge = |trial: &Trial<'_>| merge_two(&trial.members, trial.truth, &settings, registry);
    let outcomes: Vec<PairOutcome> = trials.par_iter().map(merge).collect::<Result<_>>()?;
    let mut count = Count::default();
    for (trial, outcome) in trials.iter().zip(outcomes) {
        add_trial(all, set, &trial.name, needed, &outcome);
        count.add(outcome);
    }
    Ok(count)
}
