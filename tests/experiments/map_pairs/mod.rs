//! Merging pairs of map files by the maps alone, with the stages of `map_merge`: cleaned, searched, registered, judged.
//!
//! - **Pairs with a truth**: those that `pairs.json` of a folder names.
//! - **Pairs of different buildings**: parts of two maps, each cut out and turned at random; all that are merged are
//!   wrong.
//! - **Simulated ones**: of two worlds of any kind.
//!
//! No log is written, so that thousands of pairs are done in an hour.

pub(crate) mod judging;
pub(crate) mod kinds;
pub(crate) mod library;
pub(crate) mod truth;
pub(crate) mod wards;
pub(crate) mod worlds;

use super::results::Results;
use anyhow::{Result, bail};
use clap::Args;
use gridweave::table::Table;
use gridweave_runtime::stage::Registry;
use judging::Judged;
use library::{Library, MapOfBuilding, SimulatedPair};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::path::PathBuf;
use wards::{SAME_ROOMS, SameRooms};
use worlds::Seeds;

/// Arguments of the experiment `map-pairs`.
#[derive(Debug, Args)]
pub(super) struct MapPairsArgs {
    /// Folders of map files (YAML), with or without a `pairs.json`, and of logs (MCAP), with or without a
    /// `LOG.truth.json` that names common places, of which the last maps are taken. What two names have in common up to
    /// the first `_` or `-` is one building, which is never paired with itself.
    folders: Vec<PathBuf>,
    /// Pairs of parts of maps of different buildings.
    #[arg(long, default_value_t = 1000)]
    unrelated: u64,
    /// Simulated worlds of any kind: the maps of both robots, and with those of other worlds.
    #[arg(long, default_value_t = 0)]
    worlds: u64,
    /// Simulated worlds of this kind only: flats, offices, corridors, halls, warehouses, campuses, symmetric, repeated
    /// rooms.
    #[arg(long)]
    kind: Option<String>,
    /// Use the simulated worlds on which parameters were chosen.
    #[arg(long)]
    tuning: bool,
    /// Pairs of maps of different simulated worlds.
    #[arg(long, default_value_t = 0)]
    simulated: u64,
    /// Pairs of simulated buildings whose rooms are the same, down to their equipment, with two robots in each: the maps
    /// of both robots, and with those of the other building.
    #[arg(long, default_value_t = 0)]
    same_rooms: u64,
    /// Seed of the pairs, parts and rotations.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Leave out the pairs with a truth.
    #[arg(long)]
    only_unrelated: bool,
    /// Write the maps that are merged wrongly as map files (`wrong_NAME_a.yaml`, `_b.yaml`), to look at.
    #[arg(long)]
    keep_wrong: bool,
}

/// What came out of a pair.
struct Trial {
    set: String,
    pair: String,
    /// Whether the place is right, by the truth of the pair; of maps of different buildings none is.
    is_right: bool,
    /// Whether the maps have nothing in common.
    is_unrelated: bool,
    judged: Judged,
    /// The maps, if they were merged wrongly and are to be kept, and what they are called in the names of their files.
    wrong_maps: Option<(String, [MapOfBuilding; 2])>,
}

impl Trial {
    fn outcome(&self) -> &'static str {
        match (self.judged.is_merged(), self.is_right) {
            (true, true) => "right",
            (true, false) => "wrong",
            (false, _) if self.is_unrelated => "rightly refused",
            (false, _) => "refused",
        }
    }
}

/// Does the experiment.
pub(super) fn run(args: &MapPairsArgs, registry: &Registry, results: &mut Results) -> Result<()> {
    if args.folders.is_empty() && args.worlds == 0 && args.same_rooms == 0 {
        bail!(
            "name a folder of maps, or a number of worlds (--worlds) or of buildings of the same rooms (--same-rooms)"
        );
    }
    if args.simulated > 0 && args.worlds < 2 {
        bail!(
            "pairs of different simulated buildings (--simulated) are made of simulated worlds (--worlds), two at the least"
        );
    }
    let mut trials = Vec::new();
    if !args.only_unrelated {
        for folder in &args.folders {
            trials.extend(with_truth(folder, args)?);
        }
    }
    let files = Library::of_folders(&args.folders)?;
    trials.extend(of_different_buildings("different buildings", &files, args.unrelated, true, args)?);
    let seeds = if args.tuning { Seeds::Tuning } else { Seeds::HeldOut };
    let pairs = library::simulated_pairs(args.worlds, args.kind.as_deref(), seeds, registry);
    if !args.only_unrelated {
        trials.extend(pairs.par_iter().map(|pair| of_one_world(pair, args)).collect::<Vec<_>>());
    }
    let same_rooms = wards::same_rooms(args.same_rooms, seeds, registry);
    trials.extend(same_rooms.par_iter().flat_map_iter(|pair| of_same_rooms(pair, args)).collect::<Vec<_>>());
    // The sets by name, each in the order of its worlds.
    trials.sort_by(|one, other| one.set.cmp(&other.set));
    let worlds = Library::of_worlds(pairs);
    trials.extend(of_different_buildings("different simulated buildings", &worlds, args.simulated, false, args)?);
    report(&trials, results)
}

/// The pairs that a folder has a truth of.
fn with_truth(folder: &std::path::Path, args: &MapPairsArgs) -> Result<Vec<Trial>> {
    let pairs = truth::pairs(folder)?;
    let set = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let trial = |pair: &truth::Pair| {
        let [a, b] = &pair.maps;
        let judged = judging::judge_maps(a, b);
        let is_right = judged.place().is_some_and(|place| pair.is_right(place));
        let is_kept = args.keep_wrong && judged.is_merged() && !is_right;
        Trial {
            set: pair.quality.as_ref().map_or_else(|| set.clone(), |quality| format!("{set}, {quality}")),
            pair: pair.name.clone(),
            is_right,
            is_unrelated: pair.is_unrelated(),
            wrong_maps: is_kept.then(|| (pair.name.clone(), pair.maps.clone())),
            judged,
        }
    };
    let mut trials: Vec<Trial> = pairs.par_iter().map(trial).collect();
    trials.sort_by(|one, other| one.set.cmp(&other.set));
    Ok(trials)
}

/// The two robots of a simulated world.
fn of_one_world(pair: &SimulatedPair, args: &MapPairsArgs) -> Trial {
    let [a, b] = &pair.maps;
    let judged = judging::judge_maps(a, b);
    let is_right = judged.place().is_some_and(|place| pair.is_right(place));
    let is_kept = args.keep_wrong && judged.is_merged() && !is_right;
    Trial {
        set: format!("simulated: {}", pair.kind()),
        pair: pair.world.name.clone(),
        is_right,
        is_unrelated: false,
        wrong_maps: is_kept.then(|| (format!("world_{}", pair.number), pair.maps.clone())),
        judged,
    }
}

/// The robots of two buildings whose rooms are the same: those of each building, and those of both.
fn of_same_rooms(SameRooms { buildings, .. }: &SameRooms, args: &MapPairsArgs) -> Vec<Trial> {
    let across = |robot: usize| {
        let [a, b] = [0, 1].map(|building| &buildings[building].maps[robot]);
        let judged = judging::judge_maps(a, b);
        let is_kept = args.keep_wrong && judged.is_merged();
        Trial {
            set: SAME_ROOMS.to_owned(),
            pair: format!("{} and {}", a.name, b.name),
            wrong_maps: is_kept.then(|| (format!("rooms_{}_{robot}", buildings[0].number), [a.clone(), b.clone()])),
            is_right: false,
            is_unrelated: true,
            judged,
        }
    };
    let within = |building: usize| of_one_world(&buildings[building], args);
    let within = if args.only_unrelated { vec![] } else { vec![within(0), within(1)] };
    within.into_iter().chain([across(0), across(1)]).collect()
}

/// Pairs of maps of different buildings; `in_parts` takes a part of each, turned.
fn of_different_buildings(
    set: &str,
    library: &Library,
    count: u64,
    in_parts: bool,
    args: &MapPairsArgs,
) -> Result<Vec<Trial>> {
    if count > 0 && !library.has_two_buildings() {
        bail!("there are no maps of two buildings to make {count} pairs of {set}");
    }
    let trial = |number: u64| {
        let mut random = ChaCha8Rng::seed_from_u64(args.seed.wrapping_mul(1 << 32).wrapping_add(number));
        let maps = library.two_buildings(&mut random);
        let names = maps.map(|map| map.name.as_str());
        let [a, b] = maps.map(|map| if in_parts { map.part(&mut random) } else { map.clone() });
        let judged = judging::judge_maps(&a, &b);
        let is_kept = args.keep_wrong && judged.is_merged();
        Trial {
            set: set.to_owned(),
            wrong_maps: is_kept.then(|| (number.to_string(), [a, b])),
            pair: format!("{number}: {} and {}", names[0], names[1]),
            is_right: false,
            is_unrelated: true,
            judged,
        }
    };
    Ok((0..count).into_par_iter().map(trial).collect())
}

fn report(trials: &[Trial], results: &mut Results) -> Result<()> {
    let mut sets: Vec<&str> = trials.iter().map(|trial| trial.set.as_str()).collect();
    sets.dedup();
    let mut table = Table::new(["set", "pairs", "right", "wrong", "refused", "rightly refused"]);
    for set in sets {
        let of_set: Vec<&Trial> = trials.iter().filter(|trial| trial.set == set).collect();
        let count = |outcome: &str| of_set.iter().filter(|trial| trial.outcome() == outcome).count();
        let counts = [of_set.len(), count("right"), count("wrong"), count("refused"), count("rightly refused")];
        table.row([set.to_owned()].into_iter().chain(counts.map(|count| count.to_string())));
    }
    results.table("map_pairs", "Merging pairs of map files", &table)?;
    let mut runs = Table::new(["set", "pair", "outcome", "probability", "refusal"]);
    for trial in trials {
        if let Some((name, maps)) = &trial.wrong_maps {
            for (map, which) in maps.iter().zip(["a", "b"]) {
                results.map(&format!("wrong_{name}_{which}"), &map.to_file())?;
            }
        }
        let Trial { set, pair, judged, .. } = trial;
        let outcome = trial.outcome().to_owned();
        runs.row([
            set.clone(),
            pair.clone(),
            outcome.clone(),
            format!("{:.6}", judged.probability),
            judged.refusal.clone().unwrap_or_default(),
        ]);
    }
    results.data("map_pairs_runs", &runs)
}
