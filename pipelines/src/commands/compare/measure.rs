//! `gridweave measure`: runs one command, and measures its time and memory.
//!
//! The system reports the peak memory of the largest of all processes that a process has waited for; so each run is
//! started by a separate process.

use crate::interrupt::stop_on_interrupt;
use crate::status::Status;
use anyhow::{Context, Result, anyhow};
use clap::Args;
use gridweave_runtime::engine::processes::Launch;
use nix::sys::resource::{UsageWho, getrusage};
use nix::sys::time::TimeValLike;
use serde::{Deserialize, Serialize};
use std::ffi::OsString;
use std::os::unix::process::ExitStatusExt;
use std::path::PathBuf;
use std::process::{Command, ExitStatus};
use std::time::Instant;

/// Arguments of `gridweave measure`.
#[derive(Debug, Args)]
pub(crate) struct MeasureArgs {
    /// The file for the measurements, as JSON.
    #[arg(long, value_name = "FILE")]
    usage: PathBuf,
    /// Arguments of `gridweave`.
    #[arg(last = true, required = true)]
    command: Vec<OsString>,
}

/// Time and memory of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Usage {
    /// Wall-clock time, seconds.
    pub(super) time_s: f64,
    /// Processor time of all processes, seconds.
    pub(super) cpu_s: f64,
    /// Peak memory of the largest process, bytes.
    pub(super) memory_bytes: u64,
    /// The exit status, or what ended the run.
    pub(super) end: Result<i32, String>,
}

/// Runs `gridweave` with the given arguments, and writes its time and memory.
pub(crate) fn measure(args: &MeasureArgs) -> Result<Status> {
    // A run that is interrupted ends in order, and this waits for it.
    stop_on_interrupt("the run is ended");
    let Launch { program, arguments } = Launch::this_program().context("cannot find the program itself")?;
    let start = Instant::now();
    let ended = Command::new(&program).args(arguments).args(&args.command).status();
    let ended = ended.with_context(|| format!("cannot start {}", program.display()))?;
    let time_s = start.elapsed().as_secs_f64();
    let used = getrusage(UsageWho::RUSAGE_CHILDREN).context("cannot measure the time and memory of the run")?;
    let usage = Usage {
        time_s,
        cpu_s: (used.user_time() + used.system_time()).num_microseconds() as f64 * 1e-6,
        memory_bytes: u64::try_from(used.max_rss()).unwrap_or_default() * 1024,
        end: end(ended),
    };
    std::fs::write(&args.usage, serde_json::to_vec(&usage)?)
        .map_err(|error| anyhow!("cannot write {}: {error}", args.usage.display()))?;
    Ok(Status::Done)
}

fn end(status: ExitStatus) -> Result<i32, String> {
    status.code().ok_or_else(|| match status.signal() {
        Some(signal) => format!("it was ended by signal {signal}"),
        None => "it has ended with no exit status".to_owned(),
    })
}
