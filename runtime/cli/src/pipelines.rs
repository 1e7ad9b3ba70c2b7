//! Pipelines by name or file, and the commands that only look at them: `check`, `graph` and `kinds`.

use crate::Outcome;
use crate::args::{BadUse, CheckArgs, GraphArgs, GraphFormat, KindsArgs};
use anyhow::Result;
use gridweave_runtime::pipeline::{Overrides, Pipeline, kind_text, kinds_json, kinds_text};
use gridweave_runtime::stage::Registry;
use std::io::IsTerminal;
use std::path::Path;

/// The pipelines that ship, by name.
const SHIPPED: [(&str, &str); 9] = [
    ("auto_merge", include_str!("../../../pipelines/auto_merge.toml")),
    ("cut", include_str!("../../../pipelines/cut.toml")),
    ("live", include_str!("../../../pipelines/live.toml")),
    ("map_file_merge", include_str!("../../../pipelines/map_file_merge.toml")),
    ("map_merge", include_str!("../../../pipelines/map_merge.toml")),
    ("simulate", include_str!("../../../pipelines/simulate.toml")),
    ("tag_direction", include_str!("../../../pipelines/tag_direction.toml")),
    ("tag_merge", include_str!("../../../pipelines/tag_merge.toml")),
    ("tag_only", include_str!("../../../pipelines/tag_only.toml")),
];

/// Loads a pipeline file or a shipped pipeline. `None` if it is wrong: then all its errors have been shown.
pub(crate) fn load(pipeline: &Path, overrides: &Overrides, registry: &Registry) -> Result<Option<Pipeline>> {
    let shipped = SHIPPED.iter().find(|(name, _)| Path::new(name) == pipeline && !pipeline.exists());
    let loaded = match shipped {
        Some((name, text)) => Pipeline::parse(&format!("pipelines/{name}.toml"), text, registry, overrides),
        None => Pipeline::load(pipeline, registry, overrides),
    };
    match loaded {
        Ok(pipeline) => Ok(Some(pipeline)),
        Err(errors) => {
            eprintln!("{}", errors.render(std::io::stderr().is_terminal()));
            Ok(None)
        }
    }
}

/// Checks pipeline files.
pub(crate) fn check(args: &CheckArgs, registry: &Registry) -> Result<Outcome> {
    let mut outcome = Outcome::Done;
    for path in &args.pipelines {
        match load(path, &Overrides::default(), registry)? {
            Some(pipeline) => println!("{}: {} stages, no errors", path.display(), pipeline.stages.len()),
            None => outcome = Outcome::BadUse,
        }
    }
    Ok(outcome)
}

/// Shows a pipeline.
pub(crate) fn graph(args: &GraphArgs, registry: &Registry) -> Result<Outcome> {
    let Some(pipeline) = load(&args.pipeline, &Overrides::default(), registry)? else { return Ok(Outcome::BadUse) };
    print!(
        "{}",
        match args.format {
            GraphFormat::Text => pipeline.to_text(),
            GraphFormat::Mermaid => pipeline.to_mermaid(),
            GraphFormat::Dot => pipeline.to_dot(),
            GraphFormat::Toml => pipeline.to_toml(),
        }
    );
    Ok(Outcome::Done)
}

/// Lists the stage kinds.
pub(crate) fn kinds(args: &KindsArgs, registry: &Registry) -> Result<Outcome> {
    let registry = match &args.kind {
        None => registry.clone(),
        Some(name) => {
            let kind = registry.get(name).cloned().ok_or_else(|| {
                let names: Vec<&str> = registry.kinds().map(|kind| kind.name).collect();
                BadUse(format!("there is no stage kind `{name}`; the kinds are {}", names.join(", ")))
            })?;
            Registry::new([kind])
        }
    };
    match (args.json, &args.kind) {
        (true, _) => println!("{}", serde_json::to_string_pretty(&kinds_json(&registry))?),
        (false, Some(_)) => registry.kinds().for_each(|kind| print!("{}", kind_text(kind))),
        (false, None) => print!("{}", kinds_text(&registry)),
    }
    Ok(Outcome::Done)
}
