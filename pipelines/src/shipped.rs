//! What ships: the stage kinds of all crates, and the pipeline files.

use gridweave_runtime::pipeline::{Overrides, Pipeline, PipelineErrors};
use gridweave_runtime::stage::{Registry, StageKind};
use std::path::Path;

/// The stage kinds of Gridweave and the given ones; of two kinds with one name the given one counts.
pub fn registry(kinds: impl IntoIterator<Item = StageKind>) -> Registry {
    Registry::new(gridweave_logs::kinds().into_iter().chain(gridweave_stages::kinds()).chain(kinds))
}

/// The pipelines that ship, by name.
const SHIPPED: [(&str, &str); 15] = [
    ("auto_merge", include_str!("../auto_merge.toml")),
    ("cut", include_str!("../cut.toml")),
    ("group_mapping", include_str!("../group_mapping.toml")),
    ("hough_spectrum", include_str!("../hough_spectrum.toml")),
    ("live", include_str!("../live.toml")),
    ("live_merge", include_str!("../live_merge.toml")),
    ("map_file_merge", include_str!("../map_file_merge.toml")),
    ("map_files_to_log", include_str!("../map_files_to_log.toml")),
    ("map_merge", include_str!("../map_merge.toml")),
    ("random_walk", include_str!("../random_walk.toml")),
    ("simulate", include_str!("../simulate.toml")),
    ("tag_direction", include_str!("../tag_direction.toml")),
    ("tag_merge", include_str!("../tag_merge.toml")),
    ("tag_only", include_str!("../tag_only.toml")),
    ("topological", include_str!("../topological.toml")),
];

/// Loads a pipeline file, or the shipped pipeline of that name.
///
/// # Errors
/// The file cannot be read, or the pipeline is wrong: the error shows everything that is.
pub fn load(pipeline: &Path, overrides: &Overrides, registry: &Registry) -> Result<Pipeline, PipelineErrors> {
    let shipped = SHIPPED.iter().find(|(name, _)| Path::new(name) == pipeline && !pipeline.exists());
    match shipped {
        Some((name, text)) => Pipeline::parse(&format!("pipelines/{name}.toml"), text, registry, overrides),
        None => Pipeline::load(pipeline, registry, overrides),
    }
}
