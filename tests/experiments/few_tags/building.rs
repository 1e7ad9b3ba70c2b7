//! Buildings whose robots can be put together anew.

use super::known::Known;
use super::outcome::PairOutcome;
use crate::cut::{self, Member};
use crate::trial::World;
use anyhow::{Context, Result};
use gridweave_runtime::stage::Registry;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::Path;
use tempfile::TempDir;

/// A log, and what its robots know.
pub(super) struct Building {
    /// What it is called.
    pub(super) name: String,
    /// The log, merged once.
    pub(super) world: World,
    /// Its robots, by name.
    pub(super) robots: BTreeMap<String, Known>,
    /// Whether they belong together.
    pub(super) related: bool,
}

impl Building {
    fn new(name: String, world: World, registry: &Registry) -> Result<Self> {
        let related = world.merge("tag_merge", &[], registry)?.evaluation.related;
        let robots = Known::of(&world)?;
        Ok(Self { name, world, robots, related })
    }

    /// `count` simulated buildings with two robots that see the whole of it. `setting` is one of the simulator's.
    pub(super) fn simulated(setting: &str, count: u64, registry: &Registry) -> Result<Vec<Self>> {
        let settings = ["robots=2", "overlap=1.0", setting].map(str::to_owned);
        let building =
            |seed: u64| Self::new(format!("seed {seed}"), World::simulate(&settings, seed, registry)?, registry);
        (1..=count).into_par_iter().map(building).collect()
    }

    /// The recorded logs of a folder.
    pub(super) fn recorded(folder: &Path, registry: &Registry) -> Result<Vec<Self>> {
        let worlds = World::recorded_in(folder)?.into_par_iter();
        worlds.map(|(name, world)| Self::new(name, world, registry)).collect()
    }

    /// One of its robots, if it has it.
    pub(super) fn robot(&self, name: &str) -> Option<(&str, &Known)> {
        self.robots.get_key_value(name).map(|(name, known)| (name.as_str(), known))
    }
}

/// Merges two robots. The second is compared with `truth`; without one the two do not belong together.
pub(super) fn merge_two(
    members: &[Member<'_>; 2],
    truth: Option<&Path>,
    settings: &[String],
    registry: &Registry,
) -> Result<PairOutcome> {
    let folder = TempDir::new().context("cannot make a folder for a log of two robots")?;
    let log = folder.path().join("two.mcap");
    cut::write(members, &log)?;
    let world = match truth {
        Some(truth) => World::recorded(&log, truth)?,
        None => World::unrelated(&log)?,
    };
    PairOutcome::of(&world, members[1].robot, settings, registry)
}
