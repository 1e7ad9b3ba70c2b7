//! Merging by tags, by tags and directions, and by both and ICP: section 5.2 of Tsardoulias et al.
//!
//! Every world is merged by the three shipped pipelines, one after the other, in one thread.
//!
//! - The **mean square error** of a robot is the mean of `|T_found p - T_true p|^2` over the centres p of the occupied
//!   cells of the robot's last map: in square metres, and in the squared cell width of that map. The paper's is that
//!   between the points of the second map as transformed and as they should lie.
//! - How far the walls of the two maps lie apart, at the found place and at the true one, says whose error it is: where
//!   a drifting robot has bent its map, walls do not lie on walls at the true place either.
//! - The time of **one alignment** is what the paper measures: from the last maps of a pair and the tags that they have
//!   in common to the transform.

mod one_alignment;
mod record;
mod report;
mod wall_distance;

use super::results::Results;
use super::trial::World;
use crate::log::last_maps;
use anyhow::{Context, Result};
use clap::Args;
use gridweave_logs::map_file::GridMap;
use gridweave_runtime::stage::{Registry, RobotTopics, match_robot};
use gridweave_stages::shared::geometry::{Grid, GridGeometry};
use one_alignment::{Aligner, PairMaps, last_common_tags};
use record::Record;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The pipelines of the paper's methods 1, 2 and 3.
const METHODS: [&str; 3] = ["tag_only", "tag_direction", "tag_merge"];

/// The paper's conditions as far as it states them: cells of 0.02 m in 14 x 12 m, tags that are read within 3 m and
/// with a deviation of 5 cm. The rest is the simulator's default.
const WORLD: [&str; 6] = ["robots=2", "width=14", "height=12", "resolution=[0.02]", "tag_reach=3", "tag_noise=0.05"];

/// Arguments of the experiment `methods`.
#[derive(Debug, Args)]
pub(super) struct MethodsArgs {
    /// How many simulated worlds of each kind, each with its own seed.
    #[arg(long, default_value_t = 50)]
    seeds: u64,
    /// A folder with recorded logs to merge as well: LOG.mcap, each with its LOG.truth.json. A log without a truth
    /// counts as one of robots that have nothing to do with each other.
    #[arg(long, value_name = "FOLDER")]
    logs: Option<PathBuf>,
    /// How often each alignment is done again for its time, which is the median.
    #[arg(long, default_value_t = 5)]
    repetitions: usize,
}

/// Worlds of one kind.
struct Set {
    /// What the files call it.
    name: &'static str,
    /// What people call it.
    title: String,
    records: Vec<Record>,
}

/// Does the experiment.
pub(super) fn run(args: &MethodsArgs, registry: &Registry, results: &mut Results) -> Result<()> {
    let methods: Vec<(&str, Aligner)> =
        METHODS.iter().map(|name| Ok((*name, Aligner::new(name, registry)?))).collect::<Result<_>>()?;
    let trial = Trial { methods: &methods, repetitions: args.repetitions.max(1), registry };

    let mut sets = Vec::new();
    for (name, title, settings) in [
        ("exact", format!("{}, exact poses", counted(args.seeds, "simulated world")), vec!["drift=0"]),
        ("drift", format!("{}, drifting poses", counted(args.seeds, "simulated world")), vec![]),
    ] {
        let settings: Vec<String> = WORLD.into_iter().chain(settings).map(str::to_owned).collect();
        let mut records = Vec::new();
        for seed in 1..=args.seeds {
            eprintln!("{title}: seed {seed}");
            let world = World::simulate(&settings, seed, registry)?;
            records.extend(trial.records(&world, &format!("seed {seed}"))?);
        }
        sets.push(Set { name, title, records });
    }
    if let Some(folder) = &args.logs {
        let mut records = Vec::new();
        let logs = World::recorded_in(folder)?;
        for (name, world) in &logs {
            eprintln!("log {name}");
            records.extend(trial.records(world, name).with_context(|| format!("in the log {}", world.log.display()))?);
        }
        sets.push(Set { name: "logs", title: counted(logs.len() as u64, "recorded log"), records });
    }
    report::write(&sets, results)
}

/// What is done with every world.
struct Trial<'a> {
    methods: &'a [(&'static str, Aligner)],
    repetitions: usize,
    registry: &'a Registry,
}

impl Trial<'_> {
    /// Merges a world by every method. A record for each method and robot but the reference.
    fn records(&self, world: &World, name: &str) -> Result<Vec<Record>> {
        let maps = robot_maps(&world.log)?;
        let mut records = Vec::new();
        for (number, (pipeline, aligner)) in self.methods.iter().enumerate() {
            let merge = world.merge(pipeline, &[], self.registry)?;
            let tags = last_common_tags(&world.output())?;
            let reference = merge.evaluation.reference.clone().unwrap_or_default();
            for robot in &merge.evaluation.robots {
                let pair = (reference.clone(), robot.robot.clone());
                let pair_maps = match (maps.get(&pair.0), maps.get(&pair.1)) {
                    (Some(a), Some(b)) => Some(PairMaps { a: grid(a)?, b: grid(b)? }),
                    _ => None,
                };
                let alignment = match (&pair_maps, tags.get(&pair)) {
                    (Some(maps), Some(tags)) if tags.accepted => aligner.measure(maps, &tags.tags, self.repetitions),
                    _ => None,
                };
                records.push(Record::new(name, number + 1, robot, pair_maps.as_ref(), alignment, &merge));
            }
        }
        Ok(records)
    }
}

fn counted(count: u64, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// Every robot's last map in a log, by robot.
fn robot_maps(log: &Path) -> Result<BTreeMap<String, GridMap>> {
    let topics = RobotTopics::default();
    let maps = last_maps(log)?.into_iter();
    Ok(maps.filter_map(|(topic, map)| Some((match_robot(&topics.map, &topic)?.to_owned(), map))).collect())
}

fn grid(map: &GridMap) -> Result<Grid<'_>> {
    Grid::new(GridGeometry::from(&map.info), &map.cells).context("a map of the log cannot be used")
}
