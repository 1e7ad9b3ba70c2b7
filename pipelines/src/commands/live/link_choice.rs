//! The links that a command names.

use crate::status::BadUse;
use anyhow::Result;
use gridweave_runtime::pipeline::{Pipeline, suggest};

/// An output port of a stage that other stages read, by index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Link {
    pub(super) stage: usize,
    pub(super) port: usize,
}

impl Link {
    /// STAGE.PORT
    pub(super) fn name(self, pipeline: &Pipeline) -> String {
        let stage = &pipeline.stages[self.stage];
        format!("{}.{}", stage.name, stage.kind.outputs[self.port].name)
    }
}

/// All links of a pipeline, in its order.
pub(super) fn all_links(pipeline: &Pipeline) -> Vec<Link> {
    let is_read = |link: &Link| {
        let mut wires = pipeline.stages.iter().flat_map(|stage| &stage.inputs);
        wires.any(|wire| (wire.from_stage, wire.from_port) == (link.stage, link.port))
    };
    let stages = pipeline.stages.iter().enumerate();
    let links = stages.flat_map(|(stage, spec)| (0..spec.kind.outputs.len()).map(move |port| Link { stage, port }));
    links.filter(is_read).collect()
}

/// The links that a text names: `STAGE.PORT`, or `STAGE` for all that the stage has.
pub(super) fn named_links(name: &str, pipeline: &Pipeline) -> Result<Vec<Link>> {
    let links = all_links(pipeline);
    let stage_of = |link: &Link| pipeline.stages[link.stage].name.as_str();
    let named = links.iter().filter(|link| link.name(pipeline) == name || stage_of(link) == name);
    let named: Vec<Link> = named.copied().collect();
    if named.is_empty() {
        let names: Vec<String> = links.iter().map(|link| link.name(pipeline)).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let help = suggest(name, &names, "there are").map_or_else(String::new, |help| format!("; {help}"));
        return Err(BadUse(format!("the run has no link `{name}`{help}")).into());
    }
    Ok(named)
}
