//! `gridweave graph`: the stages of a pipeline and its wires.

use crate::shipped;
use crate::status::Status;
use crate::terminal::{print, text_width};
use anyhow::Result;
use clap::{Args, ValueEnum};
use gridweave_runtime::pipeline::Overrides;
use gridweave_runtime::stage::Registry;
use std::path::PathBuf;

/// What `gridweave graph` is told.
#[derive(Debug, Args)]
pub(crate) struct GraphArgs {
    /// A pipeline file, or the name of a shipped pipeline.
    pub(crate) pipeline: PathBuf,
    /// How to show it.
    #[arg(long, value_enum, default_value_t = GraphFormat::Text)]
    pub(crate) format: GraphFormat,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum GraphFormat {
    /// A list for people.
    Text,
    /// A Mermaid flowchart, as GitHub draws it.
    Mermaid,
    /// A Graphviz graph.
    Dot,
    /// A pipeline file in which nothing is left to defaults.
    Toml,
}

/// Shows a pipeline.
pub(crate) fn graph(args: &GraphArgs, registry: &Registry) -> Result<Status> {
    let pipeline = shipped::load(&args.pipeline, &Overrides::default(), registry)?;
    print(match args.format {
        GraphFormat::Text => pipeline.to_text(text_width()),
        GraphFormat::Mermaid => pipeline.to_mermaid(),
        GraphFormat::Dot => pipeline.to_dot(),
        GraphFormat::Toml => pipeline.to_toml(),
    })?;
    Ok(Status::Done)
}
