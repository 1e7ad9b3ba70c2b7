//! `gridweave pipelines`: lists the shipped pipelines.

use crate::shipped;
use crate::status::{BadUse, Status};
use crate::table::Table;
use crate::terminal::{print, width};
use anyhow::Result;
use clap::Args;

/// Arguments of `gridweave pipelines`.
#[derive(Debug, Args)]
pub(crate) struct PipelinesArgs {
    /// Print the file of this pipeline, as a start for another: `gridweave pipelines auto_merge > my_merge.toml`.
    name: Option<String>,
}

/// Lists the shipped pipelines, or prints one.
pub(crate) fn pipelines(args: &PipelinesArgs) -> Result<Status> {
    match &args.name {
        Some(name) => print(shipped::find(name).map_err(BadUse)?.text)?,
        None => {
            let mut table = Table::new(["pipeline", "what it does"]);
            shipped::all().into_iter().for_each(|shipped| table.row([shipped.name, shipped.what].map(str::to_owned)));
            print(table.fit(width()))?
        }
    };
    Ok(Status::Done)
}
