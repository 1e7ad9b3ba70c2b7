//! The shipped stage kinds and pipelines.

use gridweave_runtime::pipeline::{Overrides, Pipeline, PipelineErrors, suggest};
use gridweave_runtime::stage::{Registry, StageKind};
use std::path::Path;
use std::sync::OnceLock;

/// Makes the registry of the stage kinds of Gridweave and the given ones; of two kinds with one name the given one
/// counts.
pub fn registry(kinds: impl IntoIterator<Item = StageKind>) -> Registry {
    Registry::new(gridweave_logs::kinds().into_iter().chain(gridweave_stages::kinds()).chain(kinds))
}

/// A shipped pipeline.
pub struct Shipped {
    /// Its name.
    pub name: &'static str,
    /// A description in one line.
    pub what: &'static str,
    /// Its file.
    pub text: &'static str,
}

macro_rules! shipped {
    ($name:literal, $what:literal) => {
        Shipped { name: $name, what: $what, text: include_str!(concat!("../", $name, ".toml")) }
    };
}

/// The shipped pipelines, by name.
pub const PIPELINES: &[Shipped] = &[
    shipped!(
        "auto_merge",
        "merge by tags and maps; the maps must confirm each result (run by `gridweave merge` on logs)"
    ),
    shipped!("cut", "cut a time range or some topics out of logs"),
    shipped!("live", "merge by tags while the robots explore"),
    shipped!("live_merge", "merge by tags and maps while the robots explore"),
    shipped!("map_file_merge", "merge map files (run by `gridweave merge` on map files)"),
    shipped!("map_files_to_log", "write map files as a log that the other pipelines read"),
    shipped!("map_merge", "map-only merge"),
    shipped!(
        "scan_merge",
        "build maps from scans, then merge (run by `gridweave merge` where robots have scans and no map)"
    ),
    shipped!("simulate", "simulate robots in a building (run by `gridweave simulate`)"),
    shipped!("tag_direction", "merge as Tsardoulias et al., method 2: tags and the direction of walls (to compare)"),
    shipped!(
        "tag_frames",
        "estimate the frames of robots by tags, without maps (run by `gridweave merge` where there are none)"
    ),
    shipped!("tag_merge", "merge by tags, directions and ICP, confirmed by the maps: Tsardoulias et al., method 3"),
    shipped!("tag_only", "merge as Tsardoulias et al., method 1: only tags (to compare)"),
    shipped!("topological", "merge as Wang et al.: topological maps (to compare)"),
    shipped!("topology_file_merge", "merge topological maps that were drawn by hand (JSON)"),
];

/// The pipelines that a program with other stages ships beside these.
static FURTHER: OnceLock<&'static [Shipped]> = OnceLock::new();

/// Ships the pipelines of a program with other stages, too. The first call counts.
pub fn ship(pipelines: &'static [Shipped]) {
    FURTHER.get_or_init(|| pipelines);
}

/// All shipped pipelines, by name.
pub fn all() -> Vec<&'static Shipped> {
    let further = FURTHER.get().copied().unwrap_or_default();
    let mut all: Vec<&Shipped> = PIPELINES.iter().chain(further).collect();
    all.sort_by_key(|shipped| shipped.name);
    all
}

/// Finds a shipped pipeline by name.
///
/// # Errors
/// There is none; the text suggests a similar name.
pub fn find(name: &str) -> Result<&'static Shipped, String> {
    let all = all();
    let names: Vec<&str> = all.iter().map(|shipped| shipped.name).collect();
    let meant = || suggest(name, &names, "there are").unwrap_or_default();
    let found = all.iter().find(|shipped| shipped.name == name);
    found.copied().ok_or_else(|| format!("no shipped pipeline `{name}`: {}", meant()))
}

/// Loads a pipeline file, or the shipped pipeline of that name.
///
/// # Errors
/// The file cannot be read, or the pipeline is wrong: the error shows everything that is wrong.
pub fn load(pipeline: &Path, overrides: &Overrides, registry: &Registry) -> Result<Pipeline, PipelineErrors> {
    // A file takes precedence over a shipped pipeline of the same name.
    let name = pipeline.to_str().filter(|name| is_name(name) && !pipeline.exists());
    match name.map(find) {
        Some(Ok(Shipped { name, text, .. })) => {
            Pipeline::parse(&format!("pipelines/{name}.toml"), text, registry, overrides)
        }
        Some(Err(error)) => {
            let name = pipeline.display().to_string();
            Err(PipelineErrors::of_whole(&name, format!("there is no file `{name}`, and {error}")))
        }
        None => Pipeline::load(pipeline, registry, overrides),
    }
}

/// Whether a text can be the name of a shipped pipeline, and not only the path of a file.
fn is_name(text: &str) -> bool {
    !text.is_empty() && text.chars().all(|c| c.is_ascii_alphanumeric() || "_-".contains(c))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pipelines_of_a_program_are_found_beside_the_others() {
        assert!(find("of_a_program").is_err_and(|error| error.contains("no shipped pipeline")));
        ship(&[Shipped { name: "of_a_program", what: "", text: "a" }]);
        assert_eq!(find("of_a_program").map(|shipped| shipped.text), Ok("a"));
        assert!(find("tag_merge").is_ok() && all().is_sorted_by_key(|shipped| shipped.name));
    }

    #[test]
    fn every_parameter_of_every_kind_can_be_set_in_a_pipeline() {
        let registry = registry([]);
        assert!(registry.kinds().count() > 20);
        assert_eq!(registry.shadowed_parameters(), Vec::<String>::new());
    }
}
