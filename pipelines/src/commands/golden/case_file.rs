//! The file `stage.toml` of a case.

use super::expect::Expect;
use super::find::CaseFolder;
use anyhow::{Context, Result, bail};
use gridweave_runtime::input_file;
use gridweave_runtime::pipeline::{SingleStage, quoted_list, suggest};
use gridweave_runtime::stage::{Registry, StageKind};
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// The sections that are not those of a pipeline.
const OWN_SECTIONS: [&str; 3] = ["inputs", "compare", "expect"];

/// A case, checked against the stage kind.
#[derive(Debug)]
pub(super) struct Case {
    /// The stage and its parameters.
    pub(super) stage: SingleStage,
    /// For every connected input port: its index, and the patterns of its topics.
    pub(super) inputs: Vec<(usize, Vec<String>)>,
    /// How far apart two equal numbers with a fraction may be.
    pub(super) float_tolerance: f64,
    /// Conditions that must hold for every expected log.
    pub(super) expects: Vec<Expect>,
    /// The folder of the case.
    pub(super) folder: PathBuf,
    /// `input.mcap`.
    pub(super) input: PathBuf,
    /// `expected.mcap`.
    pub(super) expected: PathBuf,
}

/// The contents of the file. The sections of a pipeline are read, and checked, by [`SingleStage`].
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct CaseFile {
    #[serde(rename = "stage")]
    _stage: IgnoredAny,
    #[serde(rename = "pipeline")]
    _pipeline: Option<IgnoredAny>,
    #[serde(rename = "robots")]
    _robots: Option<IgnoredAny>,
    #[serde(default)]
    inputs: BTreeMap<String, Patterns>,
    #[serde(default)]
    compare: Compare,
    #[serde(default)]
    expect: Vec<super::expect::ExpectEntry>,
}

#[derive(Debug, Deserialize)]
#[serde(untagged, expecting = "expected a topic in quotes, or a list of them")]
enum Patterns {
    One(String),
    Several(Vec<String>),
}

#[derive(Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Compare {
    float_tolerance: f64,
}

impl Default for Compare {
    fn default() -> Self {
        Self { float_tolerance: 1e-9 }
    }
}

impl Case {
    /// Reads the case of a folder.
    pub(super) fn load(folder: &CaseFolder, registry: &Registry) -> Result<Self> {
        let path = folder.path.join("stage.toml");
        let name = path.display().to_string();
        let text =
            input_file::read_text(&path, input_file::LONGEST_TEXT).with_context(|| format!("cannot read {name}"))?;
        let stage = SingleStage::parse(&name, &text, registry, &OWN_SECTIONS)?;
        if stage.kind.name != folder.kind {
            bail!(
                "{name}: the stage is of kind `{}`, but the case is in the folder of the kind `{}`",
                stage.kind.name,
                folder.kind
            );
        }
        let file: CaseFile = toml::from_str(&text).map_err(|error| anyhow::anyhow!("{name}: {error}"))?;
        let tolerance = file.compare.float_tolerance;
        if !(tolerance.is_finite() && tolerance >= 0.0) {
            bail!("{name}: `float_tolerance` must be 0 or more, not {tolerance}");
        }
        let inputs = inputs(&stage.kind, file.inputs).with_context(|| name.clone())?;
        let expects = file.expect.into_iter().enumerate().map(|(at, entry)| {
            Expect::new(entry, &stage.kind).with_context(|| format!("{name}: in [[expect]] number {}", at + 1))
        });
        Ok(Self {
            expects: expects.collect::<Result<_>>()?,
            stage,
            inputs,
            float_tolerance: tolerance,
            folder: folder.path.clone(),
            input: folder.path.join("input.mcap"),
            expected: folder.path.join("expected.mcap"),
        })
    }

    /// Whether a parameter of the stage contains this placeholder.
    pub(super) fn has_placeholder(&self, placeholder: &str) -> bool {
        self.stage.parameters.values().any(|value| contains(value, placeholder))
    }
}

fn contains(value: &toml::Value, text: &str) -> bool {
    match value {
        toml::Value::String(value) => value.contains(text),
        toml::Value::Array(values) => values.iter().any(|value| contains(value, text)),
        toml::Value::Table(table) => table.values().any(|value| contains(value, text)),
        _ => false,
    }
}

/// Reads the section `[inputs]`, by input port.
fn inputs(kind: &StageKind, given: BTreeMap<String, Patterns>) -> Result<Vec<(usize, Vec<String>)>> {
    let names: Vec<&str> = kind.inputs.iter().map(|port| port.name).collect();
    if let Some(name) = given.keys().find(|name| !names.contains(&name.as_str())) {
        let help = suggest(name, &names, "its inputs").unwrap_or_else(|| "it has no inputs".to_owned());
        bail!("`{}` has no input `{name}`; {help}", kind.name);
    }
    let mut given = given;
    let mut inputs = Vec::new();
    for (index, port) in kind.inputs.iter().enumerate() {
        let patterns = match given.remove(port.name) {
            Some(Patterns::One(pattern)) => vec![pattern],
            Some(Patterns::Several(patterns)) if !patterns.is_empty() => patterns,
            None if port.optional => continue,
            _ => bail!(
                "the input `{}` of `{}` has no topic; write `{} = \"/TOPIC\"` below [inputs], with {{robot}} for the \
                 robot's name",
                port.name,
                kind.name,
                port.name
            ),
        };
        patterns.iter().try_for_each(|pattern| check_pattern(pattern))?;
        inputs.push((index, patterns));
    }
    Ok(inputs)
}

fn check_pattern(pattern: &str) -> Result<()> {
    let rest = pattern.replacen("{robot}", "", 1);
    if !pattern.starts_with('/') || rest.contains(['{', '}']) {
        let example = quoted_list(&["/{robot}/map", "/map"]);
        bail!("`{pattern}` is not a topic pattern: write one such as {example}, with {{robot}} at most once");
    }
    Ok(())
}
