//! `gridweave graph`: shows the stages of a pipeline and their wires.

use crate::shipped;
use crate::status::Status;
use crate::terminal::{print, text_width};
use anyhow::Result;
use clap::{Args, ValueEnum};
use gridweave_runtime::pipeline::Overrides;
use gridweave_runtime::stage::Registry;
use std::path::PathBuf;

/// Arguments of `gridweave graph`.
#[derive(Debug, Args)]
pub(crate) struct GraphArgs {
    /// A pipeline file, or the name of a shipped pipeline.
    pub(crate) pipeline: PathBuf,
    /// The format.
    #[arg(long, value_enum, default_value_t = GraphFormat::Text)]
    pub(crate) format: GraphFormat,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum GraphFormat {
    /// A list.
    Text,
    /// A Mermaid flowchart.
    Mermaid,
    /// A Graphviz graph.
    Dot,
    /// A pipeline file with all defaults filled in.
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
