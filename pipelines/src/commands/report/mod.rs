//! `gridweave report`: writes a report on a merge as one page for a browser.

mod collect;
mod graph;
mod grids;
mod live;
mod model;
mod page;

pub(crate) use live::LivePage;

use crate::job::{Inputs, NamingOptions, check_ending, check_is_no_input};
use crate::status::{BadUse, Status};
use crate::terminal::{eprint_line, print_line};
use anyhow::{Context, Result, bail};
use clap::Args;
use collect::Limits;
use gridweave_logs::file::replace;
use gridweave_runtime::input_file;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Arguments of `gridweave report`.
#[derive(Debug, Args)]
pub(crate) struct ReportArgs {
    /// The log that a merge has written; several are read as one. Maps in logs of robots are shown beside each other.
    #[arg(required = true, value_name = "LOG")]
    inputs: Vec<PathBuf>,
    /// The page to write.
    #[arg(short, long, value_name = "FILE.html")]
    output: PathBuf,
    /// The summary of the run (`--summary` of `merge` and `run`), with the messages, time and warnings of each stage.
    #[arg(long, value_name = "FILE.json")]
    summary: Option<PathBuf>,
    #[command(flatten)]
    names: NamingOptions,
}

/// Maximum size of the page, bytes. A larger one is made again with fewer moments and coarser maps.
const MAX_PAGE_SIZE: usize = 9_500_000;
/// Limits that are tried in turn; the last are used whatever the size.
const LIMITS: [Limits; 5] = [
    Limits { steps: 24, side: 2000 },
    Limits { steps: 12, side: 2000 },
    Limits { steps: 6, side: 1500 },
    Limits { steps: 3, side: 1000 },
    Limits { steps: 1, side: 600 },
];

/// Writes the page.
pub(crate) fn report(args: &ReportArgs) -> Result<Status> {
    if Inputs::of_maps_or_logs(&args.inputs, "report")? == Inputs::MapFiles {
        let text = "`report` reads logs: merge map files to one by `gridweave merge A.yaml B.yaml -o OUT.mcap`, or draw them by \
                    `gridweave render`";
        return Err(BadUse(text.to_owned()).into());
    }
    check_is_no_input(args.inputs.iter().chain(&args.summary), &args.output)?;
    check_ending(&args.output, "a page", &["html", "htm"])?;
    let summary = args.summary.as_deref().map(read_summary).transpose()?;
    let times = collect::moments(&args.inputs, &args.names)?;
    if times.is_empty() {
        bail!(
            "there is nothing to report: the log has neither maps on /map or /ROBOT/map nor results of a merge; `gridweave info LOG` \
             lists its topics, and --rename renames one"
        );
    }
    let mut page = String::new();
    for limits in LIMITS {
        let report = collect::collect(&args.inputs, &args.names, &times, limits)?;
        page = page::render(&report, summary.as_ref())?;
        if page.len() <= MAX_PAGE_SIZE {
            report.problems.iter().for_each(|problem| eprint_line(format_args!("warning: {problem}")));
            break;
        }
    }
    replace(&[(&args.output, page.as_bytes())])?;
    let megabytes = page.len() as f64 / 1e6;
    print_line(format_args!("wrote {} ({megabytes:.1} MB): open it in a browser", args.output.display()))?;
    Ok(Status::Done)
}

fn read_summary(path: &Path) -> Result<Value> {
    let text = input_file::read_text(path, input_file::LONGEST_TEXT)
        .with_context(|| format!("cannot read the summary {}", path.display()))?;
    let summary: Value = serde_json::from_str(&text)
        .with_context(|| format!("{} is not a summary that `merge --summary` has written", path.display()))?;
    if !summary["stages"].is_object() {
        bail!("{} is not a summary that `merge --summary` has written: it has no `stages`", path.display());
    }
    Ok(summary)
}
