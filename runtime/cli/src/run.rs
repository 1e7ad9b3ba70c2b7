//! `gridweave run` and `gridweave merge`.

use crate::Outcome;
use crate::args::{BadUse, MergeArgs, RunArgs, RunOptions};
use crate::export::Exports;
use crate::pipelines;
use crate::progress::Progress;
use crate::summary::Summary;
use anyhow::{Context, Result};
use gridweave_logs::sink::close_log;
use gridweave_runtime::engine::{self, EngineKind};
use gridweave_runtime::pipeline::{Mode, Overrides, Pipeline};
use gridweave_runtime::stage::Registry;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// One run of a pipeline, put together from what the command line says.
pub(crate) struct Job<'a> {
    /// A pipeline file, or the name of a shipped pipeline.
    pub(crate) pipeline: &'a Path,
    /// What the only source of logs reads; if none, what the pipeline says.
    pub(crate) inputs: &'a [PathBuf],
    /// What the only sink writes; if none, what the pipeline says.
    pub(crate) output: Option<&'a Path>,
    pub(crate) options: &'a RunOptions,
    /// The stage kinds that the pipeline may name.
    pub(crate) registry: &'a Registry,
}

/// Runs a pipeline file.
pub(crate) fn run(args: &RunArgs, registry: &Registry) -> Result<Outcome> {
    let job = Job {
        pipeline: &args.pipeline,
        inputs: &args.input,
        output: args.output.as_deref(),
        options: &args.options,
        registry,
    };
    job.run_and_print()
}

/// Merges logs by the shipped pipeline for them.
pub(crate) fn merge(args: &MergeArgs, registry: &Registry) -> Result<Outcome> {
    if let Some(map) = args.inputs.iter().find(|path| path.extension().is_some_and(|end| end == "yaml" || end == "yml"))
    {
        let text = format!("{} is a map file: merge takes logs (MCAP files or rosbag2 folders)", map.display());
        return Err(BadUse(text).into());
    }
    let job = Job {
        pipeline: Path::new("tag_merge"),
        inputs: &args.inputs,
        output: Some(&args.output),
        options: &args.options,
        registry,
    };
    job.run_and_print()
}

impl Job<'_> {
    fn run_and_print(&self) -> Result<Outcome> {
        let Some(summary) = self.run()? else { return Ok(Outcome::BadUse) };
        match self.options.json {
            true => println!("{}", summary.to_json()),
            false => print!("{}", summary.to_text()),
        }
        Ok(match summary.has_unmerged() {
            true => Outcome::NotAllMerged,
            false => Outcome::Done,
        })
    }

    /// Runs the pipeline and writes all that was asked for. `None` if the pipeline is wrong, which has been said then.
    pub(crate) fn run(&self) -> Result<Option<Summary>> {
        let exports = Exports::new(self.options, self.output)?;
        let Some(pipeline) = pipelines::load(self.pipeline, &self.overrides()?, self.registry)? else {
            return Ok(None);
        };
        refuse_to_overwrite_inputs(&pipeline)?;
        let progress = Progress::new(pipeline.mode);
        let start = SystemTime::now();
        let by_mode = match pipeline.mode {
            Mode::Replay => EngineKind::default(),
            Mode::Live => EngineKind::Processes,
        };
        let report = engine::run(&pipeline, self.options.engine.unwrap_or(by_mode), &progress);
        progress.finish();
        if let Err(error) = &report {
            close_outputs(&pipeline, start, &error.to_string());
        }
        let report = report?;
        let summary = Summary::new(&report);
        if let Some(path) = &self.options.summary {
            std::fs::write(path, summary.to_json() + "\n")
                .with_context(|| format!("cannot write the summary {}", path.display()))?;
        }
        exports.write(&summary, &pipeline.robots)?;
        if pipeline.mode == Mode::Replay {
            summary.check_for_maps()?;
        }
        Ok(Some(summary))
    }

    fn overrides(&self) -> Result<Overrides> {
        let mut overrides = Overrides::default();
        overrides.reference.clone_from(&self.options.reference);
        overrides.seed = self.options.seed;
        if !self.inputs.is_empty() {
            let files: Vec<String> = self.inputs.iter().map(|path| text_of(path)).collect::<Result<_>>()?;
            overrides.set_for_kind("mcap_source", "files", files);
        }
        if let Some(output) = self.output {
            overrides.set_for_kind("mcap_sink", "file", text_of(output)?);
        }
        if self.options.results_only {
            overrides.set_for_kind("mcap_sink", "pass_input", false);
        }
        for setting in &self.options.set {
            overrides.set(setting).map_err(|error| BadUse(error.to_string()))?;
        }
        Ok(overrides)
    }
}

fn text_of(path: &Path) -> Result<String> {
    let text = path.to_str().ok_or_else(|| BadUse(format!("the path {} is not UTF-8", path.display())))?;
    Ok(text.to_owned())
}

/// A sink whose process was killed has not closed its output: it is closed here, and says why it is not complete.
fn close_outputs(pipeline: &Pipeline, start: SystemTime, reason: &str) {
    for stage in pipeline.stages.iter().filter(|stage| stage.kind.name == "mcap_sink") {
        let Some(file) = stage.parameters.get("file").and_then(|file| file.as_str()).map(Path::new) else { continue };
        let is_of_this_run = file.metadata().and_then(|file| file.modified()).is_ok_and(|time| time >= start);
        if is_of_this_run && let Err(error) = close_log(file, reason) {
            tracing::warn!("the output {} has no end: {error}", file.display());
        }
    }
}

/// A sink must not write to a file that a source reads, by whatever name.
fn refuse_to_overwrite_inputs(pipeline: &Pipeline) -> Result<()> {
    let of_kind = |kind: &'static str| pipeline.stages.iter().filter(move |stage| stage.kind.name == kind);
    let outputs = of_kind("mcap_sink").filter_map(|stage| stage.parameters.get("file")?.as_str());
    for output in outputs {
        let inputs = of_kind("mcap_source").filter_map(|stage| stage.parameters.get("files")?.as_array());
        for input in inputs.flatten().filter_map(|input| input.as_str()) {
            if is_or_holds(Path::new(input), Path::new(output)) {
                let text = format!("{output} is an input, and would be overwritten: choose another output");
                return Err(BadUse(text).into());
            }
        }
    }
    Ok(())
}

/// Whether two paths lead to the same file, or the first to a folder that holds the second, through links as well.
fn is_or_holds(input: &Path, output: &Path) -> bool {
    let (Ok(input), Ok(output)) = (input.canonicalize(), output.canonicalize()) else { return false };
    output.starts_with(&input) || same_file(&input, &output)
}

#[cfg(unix)]
fn same_file(a: &Path, b: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let (Ok(a), Ok(b)) = (a.metadata(), b.metadata()) else { return false };
    (a.dev(), a.ino()) == (b.dev(), b.ino())
}

#[cfg(not(unix))]
fn same_file(a: &Path, b: &Path) -> bool {
    a == b
}
