//! Does to runs what happens to them in the field, and holds each against what is promised.
//!
//!     cargo run --release -p gridweave-tests --bin torture -- rounds --rounds 1000 --kills --seed 1
//!     cargo run --release -p gridweave-tests --bin torture -- soak --minutes 60 --seed 1
//!
//! Where the machine allows it, all happens in namespaces of its own: with its own processes and its own /dev/shm, which
//! go with it, and some runs in further ones, as in containers that share /tmp and /dev/shm.

mod processes;
mod promises;
mod rounds;
mod soak;
mod trouble;
mod world;

use anyhow::{Context as _, Result};
use clap::Parser;
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(Debug, Parser)]
enum Args {
    /// Runs a small pipeline again and again, each time in other trouble.
    Rounds {
        /// How many times.
        #[arg(long, default_value_t = 100)]
        rounds: u32,
        /// What happens, and when, is drawn from this.
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// Nothing but kills, at random moments.
        #[arg(long)]
        kills: bool,
        /// The program to torture: by default the one that lies beside this one.
        #[arg(long)]
        program: Option<PathBuf>,
    },
    /// Plays a log into a live pipeline over and over, and kills stages at random.
    Soak {
        /// For so long.
        #[arg(long, default_value_t = 60.0)]
        minutes: f64,
        /// How much faster than it was recorded: no faster than the machine can follow, as the run is to have nothing left to do
        /// half a minute after the last message.
        #[arg(long, default_value_t = 2.0)]
        rate: f64,
        /// What is killed, and when, is drawn from this.
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// The program to torture: by default the one that lies beside this one.
        #[arg(long)]
        program: Option<PathBuf>,
    },
}

fn main() -> ExitCode {
    match torture(Args::parse()) {
        Ok(code) => code,
        Err(error) => {
            world::tell(&format!("{error:#}"));
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

/// The command with stages that get into trouble.
fn beside() -> Result<PathBuf> {
    let path = std::env::current_exe()?.with_file_name("troubled_stages");
    path.is_file()
        .then_some(path)
        .context("there is no program troubled_stages beside this one: build it, or give --program")
}
