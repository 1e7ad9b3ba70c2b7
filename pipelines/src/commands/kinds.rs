//! `gridweave kinds`: the stage kinds with their ports and parameters.

use crate::status::{BadUse, Status};
use crate::terminal::{print, print_line};
use anyhow::Result;
use clap::Args;
use gridweave_runtime::pipeline::{kind_text, kinds_json, kinds_text, suggest};
use gridweave_runtime::stage::Registry;

/// What `gridweave kinds` is told.
#[derive(Debug, Args)]
pub(crate) struct KindsArgs {
    /// Only this kind.
    pub(crate) kind: Option<String>,
    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Lists the stage kinds.
pub(crate) fn kinds(args: &KindsArgs, registry: &Registry) -> Result<Status> {
    let registry = match &args.kind {
        None => registry.clone(),
        Some(name) => {
            let kind = registry.get(name).cloned().ok_or_else(|| {
                let names: Vec<&str> = registry.kinds().map(|kind| kind.name).collect();
                let meant = suggest(name, &names, "the kinds are").unwrap_or_default();
                BadUse(format!("there is no stage kind `{name}`: {meant}"))
            })?;
            Registry::new([kind])
        }
    };
    match (args.json, &args.kind) {
        (true, _) => print_line(serde_json::to_string_pretty(&kinds_json(&registry))?),
        (false, Some(_)) => print(registry.kinds().map(kind_text).collect::<String>()),
        (false, None) => print(kinds_text(&registry)),
    }?;
    Ok(Status::Done)
}
