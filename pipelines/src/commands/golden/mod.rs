//! `gridweave golden`: runs every stage alone on stored input, and compares its messages with stored ones.
//!
//! A case is a folder KIND/CASE with `stage.toml` ([`case_file`]), `input.mcap` and `expected.mcap`. Its stage runs
//! between a source that sends the input ([`source`]) and a sink that keeps the output ([`sink`]), over the same
//! shared-memory links as in a pipeline ([`run_case`]); the [`recording`] of its messages is compared with the expected
//! one ([`compare`]) or replaces it (`--bless`).

mod case_file;
mod check_case;
mod compare;
mod differences;
mod expect;
mod find;
mod recording;
mod report;
mod routes;
mod run_case;
mod sink;
mod source;

use crate::interrupt::{OUTPUT_IS_CLOSED, stop_on_interrupt};
use crate::status::{BadUse, Status};
use crate::terminal::{print, print_line};
use anyhow::{Context, Result, bail};
use check_case::{CaseOutcome, check_case};
use clap::Args;
use find::CaseFolder;
use gridweave_runtime::stage::Registry;
use rayon::prelude::*;
use report::Report;
use std::path::PathBuf;
use std::sync::atomic::Ordering;

/// Arguments of `gridweave golden`.
#[derive(Debug, Args)]
pub(crate) struct GoldenArgs {
    /// Only cases with one of these texts in KIND/CASE.
    #[arg(value_name = "FILTER")]
    filters: Vec<String>,
    /// Replace expected messages that differ by those that the stage sends, and report which.
    #[arg(long)]
    bless: bool,
    /// The folder with the cases, as KIND/CASE.
    #[arg(long, value_name = "FOLDER", default_value = "tests/golden")]
    cases: PathBuf,
    /// The folder for messages that are not as expected, and for pictures of grids that differ.
    #[arg(long, value_name = "FOLDER", default_value = "golden-differences")]
    differences: PathBuf,
    /// Allow stage kinds without a case.
    #[arg(long)]
    partial: bool,
    /// Show at most COUNT differences of a case.
    #[arg(long, value_name = "COUNT", default_value_t = 10)]
    limit: usize,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Runs the cases and prints their results.
pub(crate) fn golden(args: &GoldenArgs, registry: &Registry) -> Result<Status> {
    if !args.cases.is_dir() {
        let help = "give the folder of the cases with --cases FOLDER";
        return Err(BadUse(format!("there is no folder {}: {help}", args.cases.display())).into());
    }
    let all = find::find(&args.cases)?;
    let without = match args.partial || !args.filters.is_empty() {
        true => Vec::new(),
        false => find::kinds_without_a_case(registry, &all),
    };
    let fits =
        |case: &CaseFolder| args.filters.is_empty() || args.filters.iter().any(|text| case.name().contains(text));
    let cases: Vec<CaseFolder> = all.into_iter().filter(fits).collect();
    if cases.is_empty() {
        let text = format!("no case in {} has {} in its name", args.cases.display(), args.filters.join(" or "));
        return Err(BadUse(text).into());
    }
    let report = Report { cases: check_all(&cases, args, registry)?, kinds_without_a_case: without };
    match args.json {
        true => print_line(format_args!("{:#}", report.to_json())),
        false => print(report.to_text(&args.cases)),
    }?;
    Ok(if report.has_failed() { Status::Failed } else { Status::Done })
}

/// Checks the cases concurrently; the results are in the order of the cases.
fn check_all(cases: &[CaseFolder], args: &GoldenArgs, registry: &Registry) -> Result<Vec<CaseOutcome>> {
    // A separate pool: a case waits for its stages, which may need the threads of the global pool.
    let pool = rayon::ThreadPoolBuilder::new().build().context("cannot start threads for the cases")?;
    let stop = stop_on_interrupt(OUTPUT_IS_CLOSED);
    let check = |case: &CaseFolder| check_case(case, args, registry, stop);
    let outcomes = pool.install(|| cases.par_iter().map(check).collect());
    match stop.load(Ordering::Relaxed) {
        true => bail!("interrupted"),
        false => Ok(outcomes),
    }
}
