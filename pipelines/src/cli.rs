//! What the command line may say, and who does it.

use crate::commands::{
    cat, check, compare, convert, demo, evaluate, golden, graph, info, kinds, live, merge, pipelines, processes,
    recover, render, report, run, shell, simulate,
};
use crate::interrupt;
use crate::status::Status;
use crate::telling::TellingArgs;
use anyhow::Result;
use clap::{CommandFactory, Parser, Subcommand};
use gridweave_runtime::stage::Registry;

/// Merges the maps of several robots that explore one building, each with a map frame of its own.
///
/// Exit status: 0 done, 1 failed, 2 bad use, 3 done but something could not be merged.
#[derive(Debug, Parser)]
#[command(name = "gridweave", version, max_term_width = 110)]
pub(crate) struct Cli {
    #[command(flatten)]
    telling: TellingArgs,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a pipeline.
    Run(run::RunArgs),
    /// Merge the maps in logs, or map files, by the shipped pipeline that fits.
    Merge(merge::MergeArgs),
    /// Check pipeline files and show everything that is wrong with them.
    Check(check::CheckArgs),
    /// Show which stages a pipeline has and how they are wired.
    Graph(graph::GraphArgs),
    /// List the pipelines that ship, or print one of them.
    Pipelines(pipelines::PipelinesArgs),
    /// List the stage kinds with their ports and parameters.
    Kinds(kinds::KindsArgs),
    /// Show what is in logs (topics, types, counts, times, robots) or in map files.
    Info(info::InfoArgs),
    /// Write logs of any kind that is read, or some topics, robots or seconds of them, as one MCAP file or rosbag2 folder.
    #[command(visible_alias = "filter")]
    Convert(convert::ConvertArgs),
    /// Write all that can be read of a log that is cut or damaged, and tell what cannot.
    Recover(recover::RecoverArgs),
    /// Print messages of logs as lines of JSON.
    Cat(cat::CatArgs),
    /// Draw the maps of a log, or map files, as a picture (PNG, SVG or PDF).
    Render(render::RenderArgs),
    /// Show what a merge has found and how, as one page for a browser.
    Report(report::ReportArgs),
    /// Compare a summary with the truth.
    Evaluate(evaluate::EvaluateArgs),
    /// Run several pipelines on the same logs, and compare how right, how fast and how large they are.
    Compare(compare::CompareArgs),
    /// Simulate robots in a building, and write a log and its truth.
    Simulate(simulate::SimulateArgs),
    /// Simulate three robots, merge their maps, and compare with the truth.
    Demo(demo::DemoArgs),
    /// Run every stage alone on stored input, and compare what it sends with what is expected.
    Golden(golden::GoldenArgs),
    /// Play logs into a live pipeline, as the robots would send them.
    Play(live::PlayArgs),
    /// Record links of a run that is going on.
    Record(live::RecordArgs),
    /// Print the messages of a link of a run that is going on, as they pass.
    Tap(live::TapArgs),
    /// Show what the stages of a run that is going on do.
    Top(live::TopArgs),
    /// Show in a browser what a run that is going on has found so far.
    View(live::ViewArgs),
    /// Carry links of a run that is going on to a run on another machine (with `gridweave-ros`).
    Bridge(live::BridgeArgs),
    /// Remove what killed runs have left in shared memory and in temporary folders. Runs that live are not touched.
    Clean,
    /// Print the completions of a shell, or write the manual pages.
    Shell(shell::ShellArgs),
    /// Run one process of a pipeline on the engine `processes`, which starts it.
    #[command(hide = true)]
    Stage(processes::StageArgs),
    /// Run one run of a comparison, which starts it, and tell what that takes.
    #[command(hide = true)]
    Measure(compare::measure::MeasureArgs),
}

impl Command {
    /// Whether it writes or sends something that must be brought to an end.
    fn has_something_to_put_in_order(&self) -> bool {
        matches!(
            self,
            Self::Run(_)
                | Self::Merge(_)
                | Self::Convert(_)
                | Self::Simulate(_)
                | Self::Demo(_)
                | Self::Compare(_)
                | Self::Golden(_)
                | Self::Play(_)
                | Self::Record(_)
                | Self::Tap(_)
                | Self::Top(_)
                | Self::View(_)
                | Self::Bridge(_)
        )
    }
}

impl Cli {
    /// Does what the command line says, with the given stage kinds. `hear` hears what is warned of.
    pub(crate) fn execute(self, registry: &Registry, hear: fn(&str, &str)) -> Result<Status> {
        let _trace = self.telling.start(hear)?;
        if self.command.has_something_to_put_in_order() {
            interrupt::hold_back();
        }
        match self.command {
            Command::Run(args) => run::run(&args, registry),
            Command::Merge(args) => merge::merge(&args, registry),
            Command::Check(args) => check::check(&args, registry),
            Command::Graph(args) => graph::graph(&args, registry),
            Command::Pipelines(args) => pipelines::pipelines(&args),
            Command::Kinds(args) => kinds::kinds(&args, registry),
            Command::Info(args) => info::info(&args, registry),
            Command::Convert(args) => convert::convert(&args, registry),
            Command::Recover(args) => recover::recover(&args),
            Command::Cat(args) => cat::cat(&args),
            Command::Render(args) => render::render(&args),
            Command::Report(args) => report::report(&args),
            Command::Evaluate(args) => evaluate::command(&args),
            Command::Compare(args) => compare::compare(&args, registry),
            Command::Simulate(args) => simulate::simulate(&args, registry),
            Command::Demo(args) => demo::demo(&args, registry),
            Command::Golden(args) => golden::golden(&args, registry),
            Command::Play(args) => live::play(&args, registry),
            Command::Record(args) => live::record(&args, registry),
            Command::Tap(args) => live::tap(&args, registry),
            Command::Top(args) => live::top(&args, registry),
            Command::View(args) => live::view(&args, registry),
            Command::Bridge(args) => live::bridge(&args, registry),
            Command::Clean => processes::clean(),
            Command::Shell(args) => shell::shell(&args, &Self::command()),
            Command::Stage(args) => processes::stage(&args, registry),
            Command::Measure(args) => compare::measure::measure(&args),
        }
    }
}
