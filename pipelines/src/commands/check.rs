//! `gridweave check`: shows all errors in pipeline files.

use crate::shipped;
use crate::status::Status;
use crate::terminal::{eprint_styled_line, print_line};
use anyhow::Result;
use clap::Args;
use gridweave_runtime::pipeline::Overrides;
use gridweave_runtime::stage::Registry;
use std::io::IsTerminal;
use std::path::PathBuf;

/// Arguments of `gridweave check`.
#[derive(Debug, Args)]
pub(crate) struct CheckArgs {
    /// Pipeline files, or names of shipped pipelines.
    #[arg(required = true, value_name = "PIPELINE")]
    pub(crate) pipelines: Vec<PathBuf>,
}

/// Checks pipeline files, each by itself.
pub(crate) fn check(args: &CheckArgs, registry: &Registry) -> Result<Status> {
    let mut status = Status::Done;
    for path in &args.pipelines {
        match shipped::load(path, &Overrides::default(), registry) {
            Ok(pipeline) => {
                print_line(format_args!("{}: {} stages, no errors", path.display(), pipeline.stages.len()))?;
            }
            Err(errors) => {
                eprint_styled_line(errors.render(std::io::stderr().is_terminal()));
                status = Status::BadUse;
            }
        }
    }
    Ok(status)
}
