//! `gridweave evaluate`: errors of a merge against the truth.

use crate::evaluate::evaluate;
use crate::status::Status;
use crate::terminal::{print, print_line, width};
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `gridweave evaluate`.
#[derive(Debug, Args)]
pub(crate) struct EvaluateArgs {
    /// The summary of a run, as `--summary` writes it.
    pub(crate) summary: PathBuf,
    /// The true frames, as `gridweave simulate` writes them.
    #[arg(long)]
    pub(crate) truth: PathBuf,
    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Compares a summary with the truth, and prints the errors.
pub(crate) fn command(args: &EvaluateArgs) -> Result<Status> {
    let evaluation = evaluate(&args.summary, &args.truth)?;
    match args.json {
        true => print_line(serde_json::to_string_pretty(&evaluation)?),
        false => print(evaluation.to_text(width())),
    }?;
    Ok(Status::Done)
}
