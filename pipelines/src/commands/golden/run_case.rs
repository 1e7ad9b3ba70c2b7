//! Runs the stage of a case alone, over the same links as in a pipeline.

use super::case_file::Case;
use super::recording::Recording;
use super::routes::{InputStream, input_streams};
use super::{sink, source};
use anyhow::{Context, Result, bail};
use gridweave_logs::reader::LogFile;
use gridweave_logs::temporary;
use gridweave_runtime::engine::{self, EngineKind, Observer};
use gridweave_runtime::pipeline::{
    DEFAULT_DEPTH, DEFAULT_SAME_TIME_LIMIT, Mode, Overflow, Pipeline, Restart, StageSpec, Wire,
};
use gridweave_runtime::stage::StageKind;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Names of the source and the sink, in capital letters, which the name of the tested stage cannot have.
const SOURCE: &str = "INPUT";
const SINK: &str = "OUTPUT";

/// Placeholders in parameters for the path of `input.mcap`, of the file that the stage writes, and of the folder of the
/// case with other files that the stage reads.
const INPUT: &str = "{input}";
const OUTPUT: &str = "{output}";
const CASE: &str = "{case}";

/// Runs the stage of a case; returns all messages that it has sent or written.
pub(super) fn run_case(case: &Case, observer: &dyn Observer) -> Result<Recording> {
    let has_input = case.input.exists();
    let reads_file = case.has_placeholder(INPUT);
    if has_input && case.inputs.is_empty() && !reads_file {
        bail!("input.mcap is not used: name its topics below [inputs], or write {INPUT} in a parameter");
    }
    if !has_input && (!case.inputs.is_empty() || reads_file) {
        bail!("there is no {}", case.input.display());
    }
    let folder = temporary::folder().context("cannot make a folder for the output of a case")?;
    let output = folder.path().join("output.mcap");
    let files = [(INPUT, text_of(&case.input)?), (OUTPUT, text_of(&output)?), (CASE, text_of(&case.folder)?)];
    let mut recording = run_stage(case, &files, observer)?;
    if case.has_placeholder(OUTPUT) {
        let mut written: Vec<PathBuf> =
            std::fs::read_dir(folder.path())?.map(|file| Ok(file?.path())).collect::<std::io::Result<_>>()?;
        if written.is_empty() {
            bail!("the stage has not written the file {OUTPUT}");
        }
        written.sort();
        for path in written {
            let read = Recording::read_file(&path).context("cannot read the output of the stage")?;
            recording.messages.extend(read.messages);
        }
    }
    Ok(recording)
}

fn text_of(path: &Path) -> Result<String> {
    Ok(path.to_str().with_context(|| format!("the path {} is not UTF-8", path.display()))?.to_owned())
}

/// Runs source, stage and sink; a stage without inputs has no source, and one without outputs no sink.
fn run_stage(case: &Case, files: &[(&str, String)], observer: &dyn Observer) -> Result<Recording> {
    let kind = &case.stage.kind;
    let received = sink::Received::default();
    let mut stages = Vec::new();
    let mut inputs = Vec::new();
    if !case.inputs.is_empty() {
        let streams = input_streams(case, &LogFile::open(&case.input)?)?;
        if streams.len() > source::MAX_STREAMS {
            bail!("{} topic patterns are too many: at most {} can be given", streams.len(), source::MAX_STREAMS);
        }
        let wire = |(from_port, stream): (usize, &InputStream)| Wire { port: stream.port, from_stage: 0, from_port };
        inputs = streams.iter().enumerate().map(wire).collect();
        stages.push(helper(SOURCE, source::kind(SOURCE, kind, &case.input, streams), Vec::new()));
    }
    let place = stages.len();
    stages.push(StageSpec {
        name: case.stage.name.clone(),
        kind: kind.clone(),
        parameters: filled_in(&case.stage.parameters, files),
        inputs,
        topics: case.stage.topics.clone(),
        depth: case.stage.depth,
        process: case.stage.name.clone(),
        overflow: vec![Overflow::default(); kind.outputs.len()],
        restart: Restart::default(),
    });
    if !kind.outputs.is_empty() {
        let wires = (0..kind.outputs.len()).map(|from_port| Wire { port: 0, from_stage: place, from_port });
        stages.push(helper(SINK, sink::kind(SINK, Arc::clone(&received)), wires.collect()));
    }
    let pipeline = Pipeline {
        name: case.stage.name.clone(),
        reference: case.stage.reference.clone(),
        seed: case.stage.seed,
        mode: Mode::Replay,
        batch: case.stage.batch,
        stall_timeout: None,
        memory_limit: None,
        same_time_limit: DEFAULT_SAME_TIME_LIMIT,
        robots: case.stage.robots.clone(),
        initial_poses: case.stage.initial_poses.clone(),
        stages,
    };
    let report = engine::run(&pipeline, EngineKind::Threads, observer)?;
    let messages = std::mem::take(&mut *received.lock().map_err(|error| anyhow::anyhow!("{error}"))?);
    let stage = report.stages.into_iter().nth(place);
    let warnings = stage.map(|stage| portable(stage.warnings, files)).unwrap_or_default();
    Ok(Recording { messages, warnings })
}

fn helper(name: &str, kind: StageKind, inputs: Vec<Wire>) -> StageSpec {
    let overflow = vec![Overflow::default(); kind.outputs.len()];
    let topics = kind.outputs.iter().map(|port| format!("/{}", port.name)).collect();
    StageSpec {
        name: name.to_owned(),
        kind,
        parameters: toml::Table::new(),
        inputs,
        topics,
        depth: DEFAULT_DEPTH,
        process: name.to_owned(),
        overflow,
        restart: Restart::default(),
    }
}

/// Replaces placeholders in parameters by the paths of files.
fn filled_in(parameters: &toml::Table, files: &[(&str, String)]) -> toml::Table {
    fn fill(value: &toml::Value, files: &[(&str, String)]) -> toml::Value {
        match value {
            toml::Value::String(text) => {
                files.iter().fold(text.clone(), |text, (placeholder, path)| text.replace(placeholder, path)).into()
            }
            toml::Value::Array(values) => values.iter().map(|value| fill(value, files)).collect::<Vec<_>>().into(),
            toml::Value::Table(table) => filled_in(table, files).into(),
            other => other.clone(),
        }
    }
    parameters.iter().map(|(key, value)| (key.clone(), fill(value, files))).collect()
}

/// Replaces paths in warnings by their placeholders, since paths differ from machine to machine.
fn portable(warnings: BTreeMap<String, u64>, files: &[(&str, String)]) -> BTreeMap<String, u64> {
    let mut portable: BTreeMap<String, u64> = BTreeMap::new();
    for (warning, count) in warnings {
        let text = files.iter().fold(warning, |text, (placeholder, path)| text.replace(path.as_str(), placeholder));
        *portable.entry(text).or_default() += count;
    }
    portable
}
