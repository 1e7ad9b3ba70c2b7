//! The worlds of the experiment, each from a seed.

use super::kinds::Kind;
use crate::cut::{self, Member};
use crate::trial::World;
use anyhow::{Context, Result, bail};
use gridweave_runtime::stage::Registry;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::path::Path;
use tempfile::TempDir;

/// Which seeds worlds are made from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Seeds {
    /// Those on which parameters and weights were chosen.
    Tuning,
    /// Those that nothing was chosen on.
    HeldOut,
}

impl Seeds {
    /// The seed of a world; every kind of world has its own.
    pub(super) fn seed(self, kind: u64, number: u64) -> u64 {
        let first = match self {
            Self::Tuning => 100_000,
            Self::HeldOut => 700_000_000,
        };
        first + kind * 10_000 + number
    }
}

/// Kinds of worlds, for their seeds.
const RANDOM: u64 = 0;
const FIRST_BUILDING: u64 = 1;
const SECOND_BUILDING: u64 = 2;
const ALIKE: u64 = 3;
/// Kind of the worlds of many kinds.
const VARIED: u64 = 5;
/// Kind of the worlds with many robots.
pub(super) const MANY_ROBOTS: u64 = 4;

/// The two robots of simulated worlds.
pub(crate) const ROBOTS: [&str; 2] = ["robot1", "robot2"];

/// A log of two robots or more, and how it was made.
pub(crate) struct PairWorld {
    pub(crate) name: String,
    pub(crate) world: World,
    /// Standard deviation of the poses' drift after one metre, if it is known.
    pub(super) drift: Option<f64>,
    /// The kind of building, where there are many.
    pub(crate) kind: Option<Kind>,
    /// Holds logs that were put together.
    _folder: Option<TempDir>,
}

/// Settings of the simulator, without those that say what robots see of each other.
fn settings(random: &mut impl Rng) -> (Vec<String>, f64) {
    let mut between = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
    let drift = between(0.0, 0.004);
    let resolution = ["[0.05]", "[0.05, 0.04]", "[0.1, 0.05]", "[0.08]"][between(0.0, 4.0) as usize];
    let settings = vec![
        "robots=2".to_owned(),
        "tags=0".to_owned(),
        "snapshots=1".to_owned(),
        format!("width={:.1}", between(18.0, 40.0)),
        format!("height={:.1}", between(12.0, 32.0)),
        format!("room_width={:.1}", between(3.0, 7.0)),
        format!("clutter={:.2}", between(0.0, 0.3)),
        format!("lidar_noise={:.3}", between(0.005, 0.03)),
        format!("dropped_beams={:.2}", between(0.0, 0.1)),
        format!("drift={drift:.5}"),
        format!("resolution={resolution}"),
    ];
    (settings, drift)
}

/// Two robots in one building.
pub(super) fn random(seeds: Seeds, number: u64, registry: &Registry) -> Result<PairWorld> {
    let seed = seeds.seed(RANDOM, number);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (mut settings, drift) = settings(&mut random);
    settings.push(format!("overlap={:.3}", random.random::<f64>()));
    let world = World::simulate(&settings, seed, registry)?;
    Ok(PairWorld { name: format!("seed {seed}"), world, drift: Some(drift), kind: None, _folder: None })
}

/// A robot of one building, and one of another.
pub(super) fn unrelated(seeds: Seeds, number: u64, registry: &Registry) -> Result<PairWorld> {
    let simulate = |kind: u64| {
        let seed = seeds.seed(kind, number);
        let (mut settings, _) = settings(&mut ChaCha8Rng::seed_from_u64(seed));
        settings.push("overlap=1.0".to_owned());
        World::simulate(&settings, seed, registry)
    };
    let (first, second) = (simulate(FIRST_BUILDING)?, simulate(SECOND_BUILDING)?);
    let name = format!("seed {} and {}", seeds.seed(FIRST_BUILDING, number), seeds.seed(SECOND_BUILDING, number));
    of_two(&first, &second, name)
}

/// The first robot of one world, and the second of another.
fn of_two(first: &World, second: &World, name: String) -> Result<PairWorld> {
    let folder = TempDir::new().context("cannot make a folder for a log of two robots")?;
    let members = [(first, ROBOTS[0]), (second, ROBOTS[1])];
    let members = members.map(|(world, robot)| Member { log: &world.log, robot, tags: BTreeMap::new() });
    let log = folder.path().join("two.mcap");
    cut::write(&members, &log)?;
    Ok(PairWorld { name, world: World::unrelated(&log)?, drift: None, kind: None, _folder: Some(folder) })
}

/// Two robots in a building of any kind. `None` if the robots find no way or see nothing there.
pub(crate) fn varied(seeds: Seeds, number: u64, registry: &Registry) -> Option<PairWorld> {
    let seed = seeds.seed(VARIED, number);
    let kind = Kind::of(number);
    let settings = kind.settings(&mut ChaCha8Rng::seed_from_u64(seed));
    let world = World::simulate(&settings, seed, registry).ok()?;
    let name = format!("seed {seed}, {}", kind.name());
    Some(PairWorld { name, world, drift: None, kind: Some(kind), _folder: None })
}

/// The first robot of one of these worlds, and the second of another.
pub(super) fn varied_unrelated(first: &PairWorld, second: &PairWorld) -> Result<PairWorld> {
    of_two(&first.world, &second.world, format!("{} and {}", first.name, second.name))
}

/// Two robots in a building whose parts are alike: half of them symmetric, half of them with one room again and again,
/// and half of each without furniture.
pub(super) fn alike(seeds: Seeds, number: u64, registry: &Registry) -> Result<PairWorld> {
    let seed = seeds.seed(ALIKE, number);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (mut settings, drift) = settings(&mut random);
    settings.retain(|setting| !setting.starts_with("clutter"));
    let layout = if number.is_multiple_of(2) { "symmetric" } else { "repeated" };
    let clutter = if number % 4 < 2 { 0.0 } else { 0.05 };
    settings.extend([
        format!("layout=\"{layout}\""),
        format!("clutter={clutter}"),
        format!("overlap={:.3}", random.random::<f64>()),
    ]);
    let world = World::simulate(&settings, seed, registry)?;
    Ok(PairWorld { name: format!("seed {seed}, {layout}"), world, drift: Some(drift), kind: None, _folder: None })
}

/// The logs of a folder.
pub(super) fn recorded(folder: &Path) -> Result<Vec<PairWorld>> {
    let entries = std::fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let mut logs: Vec<_> = entries.map(|entry| entry.map(|entry| entry.path())).collect::<Result<_, _>>()?;
    logs.retain(|path| path.extension().is_some_and(|extension| extension == "mcap"));
    logs.sort();
    if logs.is_empty() {
        bail!("{} holds no logs: NAME.mcap, and NAME.truth.json where the robots belong together", folder.display());
    }
    let world = |log: &std::path::PathBuf| {
        let truth = log.with_extension("truth.json");
        let world = if truth.exists() { World::recorded(log, &truth)? } else { World::unrelated(log)? };
        let name = log.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok(PairWorld { name, world, drift: None, kind: None, _folder: None })
    };
    logs.iter().map(world).collect()
}
