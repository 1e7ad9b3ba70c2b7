//! Choice of links by name.

use crate::status::BadUse;
use anyhow::Result;
use gridweave_runtime::pipeline::{self, Pipeline};

/// Name of the run in errors.
const THE_RUN: &str = "the run";

/// An output port of a stage that other stages read, by index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Link {
    pub(super) stage: usize,
    pub(super) port: usize,
}

/// Lists all links of a pipeline, in its order.
pub(super) fn all_links(pipeline: &Pipeline) -> Vec<Link> {
    let is_read = |link: &Link| {
        let mut wires = pipeline.stages.iter().flat_map(|stage| &stage.inputs);
        wires.any(|wire| (wire.from_stage, wire.from_port) == (link.stage, link.port))
    };
    let stages = pipeline.stages.iter().enumerate();
    let links = stages.flat_map(|(stage, spec)| (0..spec.kind.outputs.len()).map(move |port| Link { stage, port }));
    links.filter(is_read).collect()
}

/// Finds the links that texts name, each once: `STAGE.PORT`, or `STAGE` for all links of the stage.
pub(super) fn chosen_links(texts: &[String], pipeline: &Pipeline) -> Result<Vec<Link>> {
    let links = all_links(pipeline);
    let names = names(&links, pipeline);
    let mut chosen = Vec::new();
    for text in texts {
        chosen.extend(pipeline::named_links(text, THE_RUN, &names).map_err(BadUse)?);
    }
    chosen.sort_unstable();
    chosen.dedup();
    Ok(chosen.into_iter().map(|link| links[link]).collect())
}

/// Finds the one link that a text names: `STAGE.PORT`, or `STAGE` if it has only one.
pub(super) fn named_link(name: &str, pipeline: &Pipeline) -> Result<Link> {
    let links = all_links(pipeline);
    let named = pipeline::named_link(name, THE_RUN, &names(&links, pipeline)).map_err(BadUse)?;
    Ok(links[named])
}

fn names<'a>(links: &[Link], pipeline: &'a Pipeline) -> Vec<(&'a str, &'a str)> {
    let name = |link: &Link| {
        let stage = &pipeline.stages[link.stage];
        (stage.name.as_str(), stage.kind.outputs[link.port].name)
    };
    links.iter().map(name).collect()
}
