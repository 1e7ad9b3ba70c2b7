//! What the weights are fitted to.

use super::FitJudgementArgs;
use crate::map_pairs::judging::candidates_of;
use crate::map_pairs::kinds::Kind;
use crate::map_pairs::library::{self, Library, MapOfBuilding, SimulatedPair};
use crate::map_pairs::truth::{self, Closeness};
use crate::map_pairs::wards::{self, SAME_ROOMS, SameRooms, WARDS};
use crate::map_pairs::worlds::Seeds;
use anyhow::{Context, Result};
use gridweave_runtime::stage::Registry;
use gridweave_stages::registration::judgement::{Alias, COUNT, Candidate};
use gridweave_stages::shared::geometry::Pose2;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::Path;

/// Aliases are looked for where a place is more probable than this: only what may be accepted has any.
const LIKELY: f64 = 0.5;

/// Kinds of buildings whose parts are alike, of which there are more.
const ALIKE: [Kind; 2] = [Kind::Symmetric, Kind::Repeated];

/// What the pairs of simulated buildings of a kind are called.
fn set_of(kind: &str) -> String {
    format!("simulated: {kind}")
}

/// Two maps, and the places that are judged.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Example {
    pub(super) set: String,
    pub(super) pair: String,
    /// What is kept together in the cross-validation.
    pub(super) place: String,
    /// Whether the maps belong together.
    pub(super) is_related: bool,
    /// The places.
    pub(super) places: Vec<Place>,
    /// The aliases of the most probable of them, and how near each is to the truth.
    pub(super) aliases: Vec<([f64; 3], Closeness)>,
}

/// A place that is judged.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Place {
    /// The values of the terms, to four digits behind the point.
    pub(super) terms: [f64; COUNT],
    /// Whether ICP has refused it.
    pub(super) is_refused: bool,
    pub(super) closeness: Closeness,
}

impl Example {
    fn new(
        names: [&str; 3],
        is_related: bool,
        (places, aliases): (Vec<Candidate>, Vec<Alias>),
        closeness: impl Fn(&Pose2) -> Closeness,
    ) -> Self {
        let [set, pair, place] = names.map(str::to_owned);
        let places = places.into_iter().map(|candidate| Place {
            terms: candidate.terms().0.map(rounded),
            is_refused: candidate.hypothesis.is_refused,
            closeness: closeness(&candidate.transform_a_b()),
        });
        let aliases = aliases.into_iter().map(|alias| (alias.terms.map(rounded), closeness(&alias.transform_a_b)));
        Self { set, pair, place, is_related, places: places.collect(), aliases: aliases.collect() }
    }

    /// The places that may be accepted.
    pub(super) fn usable(&self) -> impl Iterator<Item = &Place> {
        self.places.iter().filter(|place| !place.is_refused)
    }

    /// Whether a place is the right one, but none exactly: which place it is can be learnt from that no more than that
    /// it is none.
    pub(super) fn is_inexact(&self) -> bool {
        let has = |closeness: Closeness| self.places.iter().any(|place| place.closeness == closeness);
        has(Closeness::Near) && !has(Closeness::Right)
    }

    /// Whether the maps are simulated.
    pub(super) fn is_simulated(&self) -> bool {
        self.set.contains("simulated")
    }

    /// Whether the robots were in a building whose parts are alike, or in two whose rooms are the same.
    pub(super) fn has_parts_alike(&self) -> bool {
        let kinds = ALIKE.map(Kind::name).into_iter().chain([WARDS]);
        self.set == SAME_ROOMS || kinds.into_iter().any(|kind| self.set == set_of(kind))
    }

    /// Whether an alias is the right place.
    pub(super) fn is_aliased(&self) -> bool {
        self.aliases.iter().any(|(_, closeness)| *closeness != Closeness::Wrong)
    }
}

/// So that a file holds what the weights are fitted to.
fn rounded(value: f64) -> f64 {
    (1e4 * value).round() / 1e4
}

/// The examples in a file: a line of JSON for each.
pub(super) fn read(file: &Path) -> Result<Vec<Example>> {
    let text = std::fs::read_to_string(file).with_context(|| format!("cannot read {}", file.display()))?;
    let example = |(number, line): (usize, &str)| {
        serde_json::from_str(line).with_context(|| format!("line {} of {} is no example", number + 1, file.display()))
    };
    text.lines().enumerate().map(example).collect()
}

/// Examples as lines of JSON.
pub(super) fn to_lines(examples: &[Example]) -> Result<String> {
    let lines = examples.iter().map(|example| Ok(serde_json::to_string(example)? + "\n"));
    lines.collect()
}

/// The examples of the pairs of maps that the experiment is given.
pub(super) fn gather(args: &FitJudgementArgs, registry: &Registry) -> Result<Vec<Example>> {
    let mut examples = Vec::new();
    for folder in &args.folders {
        let set = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let pairs = truth::pairs(folder)?;
        let example = |pair: &truth::Pair| {
            let [a, b] = &pair.maps;
            let set = pair.quality.as_ref().map_or_else(|| set.clone(), |quality| format!("{set}, {quality}"));
            let names = [set.as_str(), pair.name.as_str(), a.building.as_str()];
            Example::new(names, !pair.is_unrelated(), candidates_of(a, b, LIKELY), |place| pair.closeness(place))
        };
        examples.extend(pairs.par_iter().map(example).collect::<Vec<_>>());
    }
    let files = Library::of_folders(&args.folders)?;
    examples.extend(of_different_buildings("different buildings", &files, args.unrelated, true, args.seed));
    let mut worlds = library::simulated_pairs(args.worlds, None, Seeds::Tuning, registry);
    let numbers: BTreeSet<u64> = worlds.iter().map(|pair| pair.number).collect();
    for kind in ALIKE {
        // The first of them are among the others.
        let count = args.alike + args.worlds / Kind::ALL.len() as u64;
        let more = library::simulated_pairs(count, Some(kind.name()), Seeds::Tuning, registry);
        worlds.extend(more.into_iter().filter(|pair| !numbers.contains(&pair.number)));
    }
    let example = |pair: &SimulatedPair, place: &str| {
        let [a, b] = &pair.maps;
        let names = [&set_of(pair.kind()), pair.world.name.as_str(), place];
        Example::new(names, true, candidates_of(a, b, LIKELY), |place| pair.closeness(place))
    };
    let of_world = |pair: &SimulatedPair| example(pair, &pair.maps[0].building);
    examples.extend(worlds.par_iter().map(of_world).collect::<Vec<_>>());
    let of_same_rooms = |SameRooms { name, buildings }: &SameRooms| {
        let across = |robot: usize| {
            let [a, b] = [0, 1].map(|building| &buildings[building].maps[robot]);
            let pair = format!("{} and {}", a.name, b.name);
            Example::new([SAME_ROOMS, &pair, name], false, candidates_of(a, b, LIKELY), |_| Closeness::Wrong)
        };
        [example(&buildings[0], name), example(&buildings[1], name), across(0), across(1)]
    };
    let same_rooms = wards::same_rooms(args.same_rooms, Seeds::Tuning, registry);
    examples.extend(same_rooms.par_iter().flat_map_iter(of_same_rooms).collect::<Vec<_>>());
    let worlds = Library::of_worlds(worlds);
    examples.extend(of_different_buildings("different simulated buildings", &worlds, args.simulated, false, args.seed));
    Ok(examples)
}

fn of_different_buildings(set: &str, library: &Library, count: u64, in_parts: bool, seed: u64) -> Vec<Example> {
    if !library.has_two_buildings() {
        return Vec::new();
    }
    let example = |number: u64| {
        let mut random = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(1 << 32).wrapping_add(number));
        let maps = library.two_buildings(&mut random);
        let pair = format!("{number}: {} and {}", maps[0].name, maps[1].name);
        let place = maps[0].building.clone();
        let [a, b] = maps.map(|map: &MapOfBuilding| if in_parts { map.part(&mut random) } else { map.clone() });
        Example::new([set, &pair, &place], false, candidates_of(&a, &b, LIKELY), |_| Closeness::Wrong)
    };
    (0..count).into_par_iter().map(example).collect()
}
