//! `gridweave kinds`: lists the stage kinds with their ports and parameters.

use crate::status::{BadUse, Status};
use crate::terminal::{print, print_line, text_width};
use anyhow::Result;
use clap::Args;
use gridweave_runtime::pipeline::{kind_text, kinds_json, kinds_text, suggest};
use gridweave_runtime::stage::{Registry, StageKind};
use std::path::Path;

/// Arguments of `gridweave kinds`.
#[derive(Debug, Args)]
pub(crate) struct KindsArgs {
    /// Only this kind; or FILE.py or FILE.py:NAME, a stage in Python.
    pub(crate) kind: Option<String>,
    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

/// The kind of a stage in Python, if `name` is such a file.
fn stage_in_python(name: &str, registry: &Registry) -> Result<Option<StageKind>> {
    let is_file = name.ends_with(".py") || name.contains(".py:");
    let Some(kind) = registry.get("python").filter(|_| is_file) else { return Ok(None) };
    let module = toml::Table::from_iter([("module".to_owned(), name.into())]);
    let asked = kind.resolve(&module, Path::new("")).transpose();
    Ok(asked.map_err(|error| BadUse(error.to_string()))?.map(|asked| asked.kind.clone()))
}

/// Lists the stage kinds.
pub(crate) fn kinds(args: &KindsArgs, registry: &Registry) -> Result<Status> {
    let registry = match &args.kind {
        None => registry.clone(),
        Some(name) => {
            let found = registry.get(name).cloned();
            let found = found.map_or_else(|| stage_in_python(name, registry), |kind| Ok(Some(kind)))?;
            let kind = found.ok_or_else(|| {
                let names: Vec<&str> = registry.kinds().map(|kind| kind.name).collect();
                let meant = suggest(name, &names, "the kinds are").unwrap_or_default();
                BadUse(format!("there is no stage kind `{name}`: {meant}"))
            })?;
            Registry::new([kind])
        }
    };
    match (args.json, &args.kind) {
        (true, _) => print_line(serde_json::to_string_pretty(&kinds_json(&registry))?),
        (false, Some(_)) => print(registry.kinds().map(|kind| kind_text(kind, text_width())).collect::<String>()),
        (false, None) => print(kinds_text(&registry, text_width())),
    }?;
    Ok(Status::Done)
}
