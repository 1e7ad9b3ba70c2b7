//! The papers' experiments repeated, and how far the stages hold:
//!
//!     cargo run --release -p gridweave-tests --bin experiments -- map-pairs --help
//!
//! Each experiment is a file or a folder here. It prints its tables and writes them as CSV, and its curves as SVG, to a
//! folder. Everything but the times is the same on every machine: an experiment's trials are seeded one by one.

#![allow(clippy::print_stdout, clippy::print_stderr)]

mod cut;
mod direction;
mod edges;
mod few_tags;
mod hough;
mod judgement;
mod localization;
mod log;
mod map_pairs;
mod methods;
mod noise;
mod plot;
mod pose_certainty;
mod processor_time;
mod radon;
mod results;
mod statistics;
mod tag_slam;
mod trial;

use anyhow::Result;
use clap::{Parser, Subcommand};
use results::Results;
use std::path::PathBuf;

/// Repeats the experiments of the papers, and measures how far the stages hold.
#[derive(Debug, Parser)]
struct Arguments {
    /// The folder for the tables (CSV) and the curves (SVG).
    #[arg(long, global = true, default_value = "tests/experiments/results", value_name = "FOLDER")]
    out: PathBuf,
    #[command(subcommand)]
    experiment: Experiment,
}

#[derive(Debug, Subcommand)]
enum Experiment {
    /// How exactly the direction of a map's walls is found (Tsardoulias et al., section 5.1).
    Direction(direction::DirectionArgs),
    /// Merging by tags, by tags and directions, and by both and ICP (Tsardoulias et al., section 5.2).
    Methods(methods::MethodsArgs),
    /// How certain a tag's place is, and how wrong, after how many readings (Tsardoulias et al., figure 4).
    Localization(localization::LocalizationArgs),
    /// Merging with few common tags, and whether robots of two buildings are ever merged by chance.
    FewTags(few_tags::FewTagsArgs),
    /// Robots without maps whose odometry drifts, merged by the tags that they read.
    TagSlam(tag_slam::TagSlamArgs),
    /// Whether the poses of SLAM are as certain as its pose graph says.
    PoseCertainty(pose_certainty::PoseCertaintyArgs),
    /// Merging pairs of map files by the maps alone: pairs with a truth, and thousands of different buildings.
    MapPairs(map_pairs::MapPairsArgs),
    /// Fits the weights of the judgement to pairs of maps, cross-validated by place, and writes them.
    FitJudgement(judgement::FitJudgementArgs),
    /// The energy of the Radon transform over the angle, of the maps of a log (Saeedi et al., "Group mapping").
    Radon(radon::RadonArgs),
    /// The Hough spectra of the maps of a log (Carpin, "Fast and accurate map merging").
    Hough(hough::HoughArgs),
    /// The edges of the Voronoi diagrams of two maps that determine the translation (Saeedi et al., "Group mapping").
    Edges(edges::EdgesArgs),
    /// How often a merge succeeds as tags, odometry and overlap get worse.
    Noise(noise::NoiseArgs),
}

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    let registry = gridweave::shipped::registry([]);
    let mut results = Results::new(&arguments.out)?;
    match &arguments.experiment {
        Experiment::Direction(args) => direction::run(args, &mut results),
        Experiment::Methods(args) => methods::run(args, &registry, &mut results),
        Experiment::Localization(args) => localization::run(args, &mut results),
        Experiment::FewTags(args) => few_tags::run(args, &registry, &mut results),
        Experiment::TagSlam(args) => tag_slam::run(args, &registry, &mut results),
        Experiment::PoseCertainty(args) => pose_certainty::run(args, &mut results),
        Experiment::MapPairs(args) => map_pairs::run(args, &registry, &mut results),
        Experiment::FitJudgement(args) => judgement::run(args, &registry, &mut results),
        Experiment::Radon(args) => radon::run(args, &mut results),
        Experiment::Hough(args) => hough::run(args, &mut results),
        Experiment::Edges(args) => edges::run(args, &mut results),
        Experiment::Noise(args) => noise::run(args, &registry, &mut results),
    }?;
    results.say_where();
    Ok(())
}
