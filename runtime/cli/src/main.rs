//! The command `gridweave`: merges the maps of several robots.

#![forbid(unsafe_code)]
// A command prints its results.
#![allow(clippy::print_stdout)]

mod args;
mod demo;
mod evaluate;
mod export;
mod info;
mod pipelines;
mod progress;
mod run;
mod simulate;
mod summary;
mod table;

use anyhow::Result;
use args::{Cli, Command};
use clap::Parser;
use std::io::IsTerminal;
use std::process::ExitCode;

/// How a command ended, as its exit status says it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    /// All is done.
    Done,
    /// It was used wrongly; what is wrong has been said.
    BadUse,
    /// It is done, but some robots could not be merged.
    NotAllMerged,
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    start_log(cli.verbose);
    match dispatch(cli.command) {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::BadUse) => ExitCode::from(2),
        Ok(Outcome::NotAllMerged) => ExitCode::from(3),
        Err(error) => {
            let bad_use = error.is::<args::BadUse>();
            eprintln!("error: {error:#}");
            ExitCode::from(if bad_use { 2 } else { 1 })
        }
    }
}

fn dispatch(command: Command) -> Result<Outcome> {
    match command {
        Command::Run(args) => run::run(&args),
        Command::Merge(args) => run::merge(&args),
        Command::Check(args) => pipelines::check(&args),
        Command::Graph(args) => pipelines::graph(&args),
        Command::Kinds(args) => pipelines::kinds(&args),
        Command::Info(args) => info::info(&args),
        Command::Evaluate(args) => evaluate::command(&args),
        Command::Simulate(args) => simulate::simulate(&args),
        Command::Demo(args) => demo::demo(&args),
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
