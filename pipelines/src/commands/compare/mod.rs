//! `gridweave compare`: pipelines side by side on the same inputs.
//!
//! The inputs become [`cases`], logs with their truth. Every pipeline merges each of them in a separate process
//! ([`merge_case`]), under another one that measures its time and memory ([`measure`]); so a run that crashes is a
//! result like any other. The results are compared with the truth ([`score`]), gathered in rows ([`rows`]) and printed
//! ([`report`]).

mod cases;
pub(crate) mod measure;
mod merge_case;
mod report;
mod rows;
mod score;

use crate::interrupt::stop_on_interrupt;
use crate::job::check_is_no_input;
use crate::job::progress::Gauge;
use crate::shipped;
use crate::status::{BadUse, Status};
use crate::terminal::{print, print_line, width};
use crate::trace;
use anyhow::{Context, Result, bail};
use cases::Case;
use clap::Args;
use gridweave_logs::file::{check_writable, replace};
use gridweave_logs::temporary;
use gridweave_runtime::pipeline::Mode;
use gridweave_runtime::stage::Registry;
use merge_case::{Merge, MergeResult};
use rayon::prelude::*;
use report::Report;
use rows::RowsBy;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Arguments of `gridweave compare`.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  gridweave compare --pipelines map_merge topological --inputs logs/ one.mcap --csv table.csv

A robot is right if its pose is less than 0.5 m, at the middle of its map, and 1 degree from the truth, as in `evaluate`; for a \
pair of map files, the distances between common places decide. Success counts robots that are right or rightly refused; refused \
counts only robots that could be merged. Errors are those of all merged robots, right or wrong. Times are medians over runs: \
wall-clock time, which concurrent runs lengthen, and processor time; memory is the peak of the largest process.

Exit status: 0 if all runs were completed, merged or not; 1 if a run failed or the truth cannot be read; 2 for bad use.")]
pub(crate) struct CompareArgs {
    /// Pipeline files, or names of shipped pipelines such as `map_merge`.
    #[arg(long, required = true, num_args = 1.., value_name = "PIPELINE")]
    pipelines: Vec<PathBuf>,
    /// Logs (MCAP files or rosbag2 folders), each with its truth beside it as NAME.truth.json; or folders: all logs in
    /// it, or all pairs of map files that its pairs.json lists.
    #[arg(long, required = true, num_args = 1.., value_name = "INPUT")]
    inputs: Vec<PathBuf>,
    /// Run each pipeline on each log with the seeds 1 to N.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    seeds: u64,
    /// How many runs are done concurrently; by default one for each processor. Times are best measured with 1.
    #[arg(long, value_name = "COUNT")]
    jobs: Option<NonZeroUsize>,
    /// Take logs without a truth as those of unrelated robots, which must not be merged.
    #[arg(long)]
    unrelated: bool,
    /// A row for each log, for each input on the command line (a folder is one), or for each pipeline only.
    #[arg(long, value_enum, default_value_t = RowsBy::Log)]
    by: RowsBy,
    /// Also write the table as comma-separated values.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Print the table in Markdown.
    #[arg(long, conflicts_with = "json")]
    markdown: bool,
    /// Print JSON: the rows of the table, and every run.
    #[arg(long)]
    json: bool,
}

/// Runs the pipelines and prints the results.
pub(crate) fn compare(args: &CompareArgs, registry: &Registry) -> Result<Status> {
    let pipelines = names(&args.pipelines)?;
    let folder = temporary::folder().context("cannot make a folder for the outputs of the runs")?;
    let cases = cases::of(&args.inputs, args.unrelated, folder.path(), registry)?;
    let inputs: Vec<&PathBuf> = args.pipelines.iter().chain(cases.iter().flat_map(|case| &case.files)).collect();
    for output in args.csv.iter().chain(trace::file()) {
        check_is_no_input(inputs.iter().copied(), output)?;
    }
    args.csv.as_deref().map(check_writable).transpose()?;
    for pipeline in &args.pipelines {
        check(pipeline, &cases[0].log, registry)?;
    }
    let results = run_all(args, &cases, folder.path())?;
    let report = Report::new(&pipelines, &cases, results, args.by);
    if let Some(path) = &args.csv {
        replace(&[(path, report.to_csv().as_bytes())])?;
    }
    match (args.json, args.markdown) {
        (true, _) => print_line(report.to_json()),
        (_, true) => print(report.to_markdown()),
        _ => print(report.to_text(width())),
    }?;
    Ok(if report.has_failed() { Status::Failed } else { Status::Done })
}

/// Names of the pipelines in the table: their file names, where these differ.
fn names(pipelines: &[PathBuf]) -> Result<Vec<String>, BadUse> {
    let stem = |path: &PathBuf| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let stems: Vec<String> = pipelines.iter().map(stem).collect();
    for (place, pipeline) in pipelines.iter().enumerate() {
        if pipelines[..place].contains(pipeline) {
            return Err(BadUse(format!("the pipeline {} is given twice", pipeline.display())));
        }
    }
    let is_alone = |name: &String| stems.iter().filter(|other| *other == name).count() == 1;
    let name = |(pipeline, stem): (&PathBuf, &String)| match is_alone(stem) {
        true => stem.clone(),
        false => pipeline.display().to_string(),
    };
    Ok(pipelines.iter().zip(&stems).map(name).collect())
}

/// Checks that a pipeline can be run on logs, so that its errors are reported before anything runs.
fn check(pipeline: &Path, log: &Path, registry: &Registry) -> Result<()> {
    let overrides = merge_case::overrides(log, Path::new("out.mcap"))?;
    let loaded = shipped::load(pipeline, &overrides, registry)?;
    if loaded.mode == Mode::Live {
        let text = format!("the pipeline {} is live: only replays can be compared", pipeline.display());
        return Err(BadUse(text).into());
    }
    Ok(())
}

/// Runs every pipeline on every case with every seed. The results are in this order.
fn run_all(args: &CompareArgs, cases: &[Case], folder: &Path) -> Result<Vec<MergeResult>> {
    let merges: Vec<Merge<'_>> = (0..args.pipelines.len())
        .flat_map(|pipeline| (0..cases.len()).map(move |case| (pipeline, case)))
        .flat_map(|(pipeline, case)| (1..=args.seeds).map(move |seed| (pipeline, case, seed)))
        .map(|(pipeline, case, seed)| Merge { pipeline, file: &args.pipelines[pipeline], case, seed })
        .collect();
    // More threads than runs would have nothing to do.
    let threads = args.jobs.map_or(0, |jobs| jobs.get().min(merges.len().max(1)));
    let pool =
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().context("cannot start threads for the runs")?;
    let stop = stop_on_interrupt("no more runs are started, and those in progress are completed");
    let (gauge, done) = (Gauge::new(true), AtomicUsize::new(0));
    let run = |(number, merge): (usize, &Merge<'_>)| -> Result<MergeResult> {
        if stop.load(Ordering::Relaxed) {
            bail!("interrupted");
        }
        let result = merge.run(&cases[merge.case], &folder.join(format!("run{number}")))?;
        let count = done.fetch_add(1, Ordering::Relaxed) + 1;
        let share = count as f64 / merges.len() as f64;
        let rate = gauge.rate(60.0 * count as f64).map_or_else(String::new, |rate| format!(", {rate:.1} per minute"));
        gauge.show(share, format_args!("{count} of {} runs{rate}", merges.len()));
        Ok(result)
    };
    let results: Result<Vec<MergeResult>> = pool.install(|| merges.par_iter().enumerate().map(run).collect());
    gauge.finish();
    match stop.load(Ordering::Relaxed) {
        true => bail!("interrupted"),
        false => results,
    }
}
