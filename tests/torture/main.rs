//! Injects the faults that happen in the field in runs, and checks the promises on each.
//!
//!     cargo run --release -p gridweave-tests --bin torture -- rounds --rounds 1000 --kills --seed 1
//!     cargo run --release -p gridweave-tests --bin torture -- soak --minutes 60 --seed 1
//!
//! Where the machine allows it, everything runs in separate namespaces with their own processes and /dev/shm, which end
//! with it, and some runs in further ones, as in containers that share /tmp and /dev/shm.

mod fault;
mod processes;
mod promises;
mod rounds;
mod soak;
mod world;

use anyhow::{Context as _, Result};
use clap::Parser;
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(Debug, Parser)]
enum Args {
    /// Runs a small pipeline repeatedly, each time with another fault.
    Rounds {
        /// Number of runs.
        #[arg(long, default_value_t = 100)]
        rounds: u32,
        /// Seed of the faults and their times.
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// Only kills, at random moments.
        #[arg(long)]
        kills: bool,
        /// The program to test; by default the one beside this one.
        #[arg(long)]
        program: Option<PathBuf>,
    },
    /// Plays a log into a live pipeline repeatedly, and kills stages at random.
    Soak {
        /// Duration in minutes.
        #[arg(long, default_value_t = 60.0)]
        minutes: f64,
        /// Rate relative to the recording: no faster than the machine can follow, as the run must have no pending work
        /// half a minute after the last message.
        #[arg(long, default_value_t = 2.0)]
        rate: f64,
        /// Seed of the kills and their times.
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// The program to test; by default the one beside this one.
        #[arg(long)]
        program: Option<PathBuf>,
    },
}

fn main() -> ExitCode {
    match torture(Args::parse()) {
        Ok(code) => code,
        Err(error) => {
            world::print_line(&format!("{error:#}"));
            ExitCode::FAILURE
        }
    }
}

fn torture(args: Args) -> Result<ExitCode> {
    if let Some(code) = world::isolate()? {
        return Ok(code);
    }
    let program = |given: Option<PathBuf>| given.map_or_else(beside, Ok);
    match args {
        Args::Rounds { rounds, seed, kills, program: given } => rounds::torture(&program(given)?, rounds, seed, kills)?,
        Args::Soak { minutes, rate, seed, program: given } => soak::soak(&program(given)?, minutes, rate, seed)?,
    }
    Ok(ExitCode::SUCCESS)
}

/// Path of the command with stages that can fail.
fn beside() -> Result<PathBuf> {
    let path = std::env::current_exe()?.with_file_name("troubled_stages");
    path.is_file()
        .then_some(path)
        .context("there is no program troubled_stages beside this one: build it, or give --program")
}
