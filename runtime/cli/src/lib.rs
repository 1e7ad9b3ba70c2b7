//! The command `gridweave`: merges the maps of several robots.
//!
//! A program with stages of its own is the same command with more kinds:
//!
//! ```no_run
//! # use gridweave_runtime::stage::StageKind;
//! # fn my_kind() -> StageKind { unimplemented!() }
//! fn main() -> std::process::ExitCode {
//!     gridweave::command([my_kind()])
//! }
//! ```

#![forbid(unsafe_code)]
// A command prints its results.
#![allow(clippy::print_stdout)]

mod args;
mod demo;
mod evaluate;
mod experiment;
mod export;
mod golden;
mod info;
mod inputs;
mod live;
mod merge;
mod outputs;
mod pipelines;
mod processes;
mod progress;
mod run;
mod simulate;
mod summary;
mod table;

use anyhow::Result;
use args::{Cli, Command};
use clap::Parser;
use gridweave_runtime::stage::{Registry, StageKind};
use std::io::IsTerminal;
use std::process::ExitCode;

/// How a command ended, as its exit status says it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    /// All is done.
    Done,
    /// It was used wrongly; what is wrong has been said.
    BadUse,
    /// Something is not as it should be; what that is has been said.
    Failed,
    /// It is done, but some robots could not be merged.
    NotAllMerged,
}

/// Does what the command line says, with the stage kinds of Gridweave and the given ones; of two kinds with one name the
/// given one counts. The exit status is 0 if all is done, 1 if it failed, 2 for bad use, and 3 if something could not be
/// merged.
pub fn command(kinds: impl IntoIterator<Item = StageKind>) -> ExitCode {
    let registry = registry(kinds);
    let cli = Cli::parse();
    start_log(cli.verbose);
    match dispatch(cli.command, &registry) {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::Failed) => ExitCode::from(1),
        Ok(Outcome::BadUse) => ExitCode::from(2),
        Ok(Outcome::NotAllMerged) => ExitCode::from(3),
        Err(error) => {
            let bad_use = error.is::<args::BadUse>();
            eprintln!("error: {error:#}");
            ExitCode::from(if bad_use { 2 } else { 1 })
        }
    }
}

/// The stage kinds of Gridweave and the given ones.
fn registry(kinds: impl IntoIterator<Item = StageKind>) -> Registry {
    Registry::new(gridweave_logs::kinds().into_iter().chain(gridweave_stages::kinds()).chain(kinds))
}

fn dispatch(command: Command, registry: &Registry) -> Result<Outcome> {
    match command {
        Command::Run(args) => run::run(&args, registry),
        Command::Merge(args) => merge::merge(&args, registry),
        Command::Check(args) => pipelines::check(&args, registry),
        Command::Graph(args) => pipelines::graph(&args, registry),
        Command::Kinds(args) => pipelines::kinds(&args, registry),
        Command::Info(args) => info::info(&args, registry),
        Command::Evaluate(args) => evaluate::command(&args),
        Command::Simulate(args) => simulate::simulate(&args, registry),
        Command::Demo(args) => demo::demo(&args, registry),
        Command::Golden(args) => golden::golden(&args, registry),
        Command::Play(args) => live::play(&args, registry),
        Command::Record(args) => live::record(&args, registry),
        Command::Tap(args) => live::tap(&args, registry),
        Command::Top(args) => live::top(&args, registry),
        Command::Clean => processes::clean(),
        Command::Stage(args) => processes::stage(&args, registry),
        Command::Experiment(args) => experiment::experiment(&args, registry),
    }
}

/// Sends what the libraries log to standard error: warnings, or all that `RUST_LOG` asks for.
fn start_log(verbose: bool) {
    let default = if verbose { "info" } else { "warn" };
    let filter = tracing_subscriber::EnvFilter::try_from_default_env()
        .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new(default));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .without_time()
        .with_target(false)
        .init();
}
