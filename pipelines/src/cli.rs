//! The command line and its subcommands.

use crate::commands::{
    cat, check, compare, convert, demo, evaluate, golden, graph, info, kinds, live, merge, pipelines, processes,
    recover, render, report, run, shell, simulate,
};
use crate::interrupt;
use crate::logging::LoggingArgs;
use crate::status::Status;
use anyhow::Result;
use clap::{Parser, Subcommand};
use gridweave_runtime::stage::Registry;
use std::ffi::OsString;
use std::path::Path;

/// Merges the maps of several robots that explore one building, each in its own map frame.
///
/// Exit status: 0 done, 1 failed, 2 bad use, 3 done but something could not be merged.
#[derive(Debug, Parser)]
#[command(name = "gridweave", version, max_term_width = 110)]
pub(crate) struct Cli {
    #[command(flatten)]
    logging: LoggingArgs,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a pipeline.
    Run(run::RunArgs),
    /// Merge the maps in logs, or map files, by the shipped pipeline that fits.
    Merge(merge::MergeArgs),
    /// Check pipeline files and show all errors in them.
    Check(check::CheckArgs),
    /// Show which stages a pipeline has and how they are wired.
    Graph(graph::GraphArgs),
    /// List the pipelines that ship, or print one of them.
    Pipelines(pipelines::PipelinesArgs),
    /// List the stage kinds with their ports and parameters.
    Kinds(kinds::KindsArgs),
    /// Show the contents of logs (topics, types, counts, times, robots) or of map files.
    Info(info::InfoArgs),
    /// Write logs of any format, or some topics, robots or seconds of them, as one MCAP file or rosbag2 folder.
    #[command(visible_alias = "filter")]
    Convert(convert::ConvertArgs),
    /// Write what can be read of a cut or damaged log, and report what cannot.
    Recover(recover::RecoverArgs),
    /// Print messages of logs as lines of JSON.
    Cat(cat::CatArgs),
    /// Draw the maps of a log, or map files, as a picture (PNG, SVG or PDF).
    Render(render::RenderArgs),
    /// Write a report on a merge, as one page for a browser.
    Report(report::ReportArgs),
    /// Compare a summary with the truth.
    Evaluate(evaluate::EvaluateArgs),
    /// Run several pipelines on the same logs, and compare their errors, times and memory.
    Compare(compare::CompareArgs),
    /// Simulate robots in a building, and write a log and its truth.
    Simulate(simulate::SimulateArgs),
    /// Simulate three robots, merge their maps, and compare with the truth.
    Demo(demo::DemoArgs),
    /// Run every stage alone on stored input, and compare what it sends with what is expected.
    Golden(golden::GoldenArgs),
    /// Play logs into a live pipeline, as the robots would send them.
    Play(live::PlayArgs),
    /// Record links of a run in progress.
    Record(live::RecordArgs),
    /// Print the messages of a link of a run in progress.
    Tap(live::TapArgs),
    /// Show rates, queues and latencies of the stages of a run in progress.
    Top(live::TopArgs),
    /// Show the merge of a run in progress in a browser.
    View(live::ViewArgs),
    /// Carry links of a run in progress to a run on another machine (with `gridweave-ros`).
    Bridge(live::BridgeArgs),
    /// Remove what killed runs have left in shared memory and in temporary folders. Runs in progress are not touched.
    Clean,
    /// Print the completions of a shell, or write the manual pages.
    Shell(shell::ShellArgs),
    /// Run one process of a pipeline on the engine `processes`, which starts it.
    #[command(hide = true)]
    Stage(processes::StageArgs),
    /// Run one run of a comparison, which starts it, and measure its time and memory.
    #[command(hide = true)]
    Measure(compare::measure::MeasureArgs),
}

impl Command {
    /// Whether the command has outputs that it would write again from the start, and does not end in order.
    fn writes_again(&self) -> bool {
        matches!(self, Self::Recover(_) | Self::Render(_) | Self::Report(_))
    }

    /// Whether the command has outputs that must be closed when it is interrupted.
    fn must_end_in_order(&self) -> bool {
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
    /// Runs the command, whose command line has these words, with the given stage kinds. `command` describes all
    /// commands of the program. `on_warning` is called for each warning.
    pub(crate) fn execute(
        self,
        words: &[OsString],
        command: &clap::Command,
        registry: &Registry,
        on_warning: fn(&str, &str),
    ) -> Result<Status> {
        let trace = self.logging.start(words, on_warning)?;
        let program = words.first().and_then(|word| Path::new(word).file_name()?.to_str());
        let done = self.run(command, program.unwrap_or(command.get_name()), registry);
        if let Some(trace) = trace {
            trace.end(done.is_ok());
        }
        done
    }

    fn run(self, command: &clap::Command, program: &str, registry: &Registry) -> Result<Status> {
        if self.command.must_end_in_order() {
            interrupt::hold_back();
        }
        if self.command.writes_again() {
            interrupt::remove_on_interrupt();
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
            Command::Shell(args) => shell::shell(&args, command, program),
            Command::Stage(args) => processes::stage(&args, registry),
            Command::Measure(args) => compare::measure::measure(&args),
        }
    }
}
