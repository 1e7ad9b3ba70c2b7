//! A run of a pipeline by the options of a command.

mod expected_robots;
mod inputs;
mod options;
mod outputs;
mod placing;
pub(crate) mod progress;
mod provenance;
mod reading;
mod results;
mod robot_options;
mod view;

pub(crate) use inputs::{Inputs, is_yaml};
pub(crate) use options::RunOptions;
pub(crate) use outputs::check as check_outputs;
pub(crate) use outputs::{check_ending, check_is_no_input, check_mcap_ending};
pub(crate) use placing::Outputs;
pub(crate) use reading::{NamingOptions, ReadingOptions};
pub(crate) use view::STANDARD_VIEW;

use crate::logging;
use crate::shipped;
use crate::status::{BadUse, Status};
use crate::summary::RunSummary;
use crate::terminal::{eprint_line, print, print_line, width};
use crate::trace;
use anyhow::Result;
use expected_robots::add_unused_robots;
use gridweave_logs::bag::Bag;
use gridweave_logs::names::name_map_files;
use gridweave_runtime::engine::{self, EngineKind, Observer, RunError, RunReport, processes};
use gridweave_runtime::pipeline::{Mode, Overrides, Pipeline};
use gridweave_runtime::stage::Registry;
use progress::Progress;
use results::ResultSinks;
use std::path::{Path, PathBuf};

/// The kind of stage that writes logs.
const LOG_SINK: &str = "mcap_sink";
/// The kind of stage that decides between hypotheses.
const VERIFIER: &str = "merge_verifier";

/// The output of a run beside the files of its options.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Output<'a> {
    /// The outputs of the pipeline.
    OfPipeline,
    /// A log, written by the only log sink of the pipeline.
    Log(&'a Path),
    /// No log.
    MapOnly,
}

impl<'a> From<Option<&'a Path>> for Output<'a> {
    fn from(log: Option<&'a Path>) -> Self {
        log.map_or(Self::OfPipeline, Self::Log)
    }
}

/// The observer of a run.
pub(crate) enum Watcher<'a> {
    /// The user at a terminal: progress is shown, and an interrupt ends the run.
    Terminal,
    /// A program.
    Observer(&'a dyn Observer),
}

/// A run of a pipeline by the options of the command line.
pub(crate) struct Job<'a> {
    /// A pipeline file, or the name of a shipped pipeline.
    pub(crate) pipeline: &'a Path,
    /// Files for the only source of logs or map files; if empty, those of the pipeline.
    pub(crate) inputs: &'a [PathBuf],
    /// The kind of the inputs.
    pub(crate) kind: Inputs,
    /// The output beside the files of the options.
    pub(crate) output: Output<'a>,
    pub(crate) options: &'a RunOptions,
    /// The stage kinds that the pipeline may name.
    pub(crate) registry: &'a Registry,
}

impl Job<'_> {
    /// Runs the pipeline, writes all outputs, and prints the summary.
    pub(crate) fn run_and_print(&self) -> Result<Status> {
        let summary = self.run()?;
        let explained: Vec<String> = self.options.explain.iter().map(|typed| self.robot(typed)).collect();
        summary.check_robots(&explained)?;
        match self.options.json {
            true => print_line(summary.to_json()),
            false => print(summary.to_text(&explained, width())),
        }?;
        Ok(match summary.has_unmerged() {
            true => Status::NotAllMerged,
            false => Status::Done,
        })
    }

    /// Runs the pipeline and writes all outputs. Shows the progress, and ends in order when the user interrupts it.
    pub(crate) fn run(&self) -> Result<RunSummary> {
        self.run_with(|_| Ok(()), Watcher::Terminal)
    }

    /// The same with the stages that `attach` adds, and another watcher of the run.
    pub(crate) fn run_with(
        &self,
        attach: impl FnOnce(&mut Pipeline) -> Result<()>,
        watcher: Watcher<'_>,
    ) -> Result<RunSummary> {
        let bag = self.bag()?;
        let mut pipeline = shipped::load(self.pipeline, &self.overrides(bag.as_ref())?, self.registry)?;
        if self.output == Output::MapOnly {
            pipeline.remove_sinks(LOG_SINK);
        }
        let file = Some(self.pipeline).filter(|file| file.exists());
        outputs::check(&pipeline, file, self.options)?;
        self.check_trace(&pipeline)?;
        provenance::record(&mut pipeline);
        let sinks = ResultSinks::attach(&mut pipeline, self.options)?;
        attach(&mut pipeline)?;
        let outputs = Outputs::of(&mut pipeline, sinks.file());
        if let Some(address) = &self.options.view {
            let address = view::attach(&mut pipeline, self.registry, address)?;
            eprint_line(format_args!(
                "to see this run in Foxglove, open the connection \"Foxglove WebSocket\" {address}"
            ));
        }
        let report = match watcher {
            Watcher::Observer(observer) => self.engine_run(&pipeline, observer)?,
            Watcher::Terminal => {
                let progress = Progress::new(pipeline.mode);
                let report = self.engine_run(&pipeline, &progress)?;
                progress.finish();
                report
            }
        };
        let written = report.map_err(anyhow::Error::from).and_then(|report| {
            let mut summary = RunSummary::new(sinks.summary()?, &report);
            add_unused_robots(self, &pipeline, &mut summary);
            if pipeline.mode == Mode::Replay {
                summary.check_for_maps()?;
            }
            let text = summary.to_json() + "\n";
            outputs.place(self.options.summary.as_deref().map(|path| (path, text.as_str())))?;
            Ok((report, summary))
        });
        if let Err(error) = &written {
            outputs.close(&error.to_string());
        }
        if let Some(bag) = bag.filter(|bag| written.is_ok() || bag.log().exists()) {
            bag.describe()?;
        }
        let (report, summary) = written?;
        sinks.check_written(&summary, &report)?;
        Ok(summary)
    }

    fn engine(&self, pipeline: &Pipeline) -> EngineKind {
        self.options.engine.unwrap_or(match pipeline.mode {
            Mode::Replay => EngineKind::default(),
            Mode::Live => EngineKind::Processes,
        })
    }

    /// Checks that a trace is not asked for of stages in other processes.
    fn check_trace(&self, pipeline: &Pipeline) -> Result<(), BadUse> {
        match trace::file() {
            Some(file) if self.engine(pipeline) == EngineKind::Processes => Err(BadUse(format!(
                "cannot write the trace {}: the engine `processes` has none; give --engine threads, or omit --trace",
                file.display()
            ))),
            _ => Ok(()),
        }
    }

    fn engine_run(&self, pipeline: &Pipeline, observer: &dyn Observer) -> Result<Result<RunReport, RunError>> {
        Ok(match self.engine(pipeline) {
            EngineKind::Processes => processes::run(pipeline, &logging::launch()?, observer),
            engine => engine::run(pipeline, engine, observer),
        })
    }

    /// Creates the rosbag2 folder for the log, if the output is one.
    fn bag(&self) -> Result<Option<Bag>> {
        match self.output {
            Output::Log(path) if Bag::is_meant(path) => Ok(Some(Bag::create(path)?)),
            _ => Ok(None),
        }
    }

    /// The name of a robot, which may be given by its map file among the inputs.
    fn robot(&self, typed: &str) -> String {
        let mut files = name_map_files(self.inputs).unwrap_or_default().into_iter();
        files.find(|(_, file)| file.as_os_str() == typed).map_or_else(|| typed.to_owned(), |(robot, _)| robot)
    }

    /// The reference, if the user names one; and with initial poses of map files, whose robots are known beforehand,
    /// the one that the frame solver would take, so that one initial pose says how its robot lies to that.
    fn reference(&self) -> Option<String> {
        let first = || {
            let is_needed = !self.options.initial.is_empty() && self.kind == Inputs::MapFiles;
            let robots = name_map_files(self.inputs).ok().filter(|_| is_needed)?;
            robots.into_iter().map(|(robot, _)| robot).min()
        };
        self.options.reference.as_deref().map(|typed| self.robot(typed)).or_else(first)
    }

    /// Replaces a map file in `ROBOT=...` by the name of the robot.
    fn robot_first(&self, typed: &str) -> String {
        match typed.rsplit_once('=') {
            Some((robot, value)) => format!("{}={value}", self.robot(robot)),
            None => typed.to_owned(),
        }
    }

    /// The settings of the pipeline; its log is in the bag, if there is one.
    fn overrides(&self, bag: Option<&Bag>) -> Result<Overrides> {
        let mut overrides = Overrides::default();
        overrides.reference = self.reference();
        overrides.seed = self.options.seed;
        overrides.initial_poses = self.options.initial.iter().map(|typed| self.robot_first(typed)).collect();
        if !self.options.accept.is_empty() {
            overrides.set_for_kind(VERIFIER, "hypotheses", robot_options::accepted(self)?);
        }
        if !self.inputs.is_empty() {
            let files: Vec<String> = self.inputs.iter().map(|path| text_of(path)).collect::<Result<_>>()?;
            overrides.set_for_kind(self.kind.source_kind(), "files", files);
        }
        if let Output::Log(output) = self.output {
            let file = bag.map_or_else(|| output.to_owned(), Bag::log);
            overrides.set_for_kind(LOG_SINK, "file", text_of(&file)?);
        }
        let inputs = if self.inputs.is_empty() { Inputs::MapFiles } else { self.kind };
        if self.options.literal_thresholds {
            overrides.set_for_kind(inputs.source_kind(), "literal_thresholds", true);
        }
        if !self.options.resolution.is_empty() {
            overrides.set_for_kind(inputs.source_kind(), "resolutions", robot_options::resolutions(self)?);
        }
        if !self.options.lidar.is_empty() {
            overrides.set_for_kind(Inputs::Logs.source_kind(), "lidars", robot_options::lidars(self)?);
        }
        if self.options.results_only {
            overrides.set_for_kind(LOG_SINK, "pass_input", false);
        }
        self.options.reading.set(&mut overrides);
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
