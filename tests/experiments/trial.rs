//! One log, merged by any pipeline and compared with the truth.

use anyhow::{Context, Result, bail};
use gridweave::evaluate::{Evaluation, evaluate_summary};
use gridweave::shipped;
use gridweave_logs::summary::{self, Summary};
use gridweave_logs::truth;
use gridweave_runtime::engine::{self, EngineKind};
use gridweave_runtime::pipeline::Overrides;
use gridweave_runtime::stage::{Registry, StageKind};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The pipeline that makes worlds.
const SIMULATE: &str = "simulate";

/// Logs of robots, and what is true of them. Simulated logs are gone with it.
pub(crate) struct World {
    /// The log.
    pub(crate) log: PathBuf,
    /// Its truth.
    pub(super) truth: PathBuf,
    /// What the merges of this world write to.
    folder: TempDir,
}

/// What a pipeline has made of a world.
pub(super) struct Merge {
    /// What it has found.
    pub(super) summary: Summary,
    /// How far that is from the truth.
    pub(super) evaluation: Evaluation,
}

impl World {
    /// A simulated world. `settings` are parameters of the simulator, `PARAMETER=VALUE`.
    pub(super) fn simulate(settings: &[String], seed: u64, registry: &Registry) -> Result<Self> {
        let folder = TempDir::new().context("cannot make a folder for a simulated log")?;
        let world =
            Self { log: folder.path().join("world.mcap"), truth: folder.path().join("world.truth.json"), folder };
        let settings: Vec<String> = settings.iter().map(|setting| format!("simulator.{setting}")).collect();
        world.run(SIMULATE, &settings, Some(seed), &world.log, &truth::kind(), &world.truth, registry)?;
        Ok(world)
    }

    /// A log that is there, with its truth.
    pub(super) fn recorded(log: &Path, truth: &Path) -> Result<Self> {
        let folder = TempDir::new().context("cannot make a folder for the output of a merge")?;
        Ok(Self { log: log.to_owned(), truth: truth.to_owned(), folder })
    }

    /// A log of robots that have nothing to do with each other.
    pub(super) fn unrelated(log: &Path) -> Result<Self> {
        let folder = TempDir::new().context("cannot make a folder for the output of a merge")?;
        let truth = folder.path().join("unrelated.truth.json");
        std::fs::write(&truth, r#"{"frames": {}}"#).with_context(|| format!("cannot write {}", truth.display()))?;
        Ok(Self { log: log.to_owned(), truth, folder })
    }

    /// The recorded logs of a folder, by name: `NAME.mcap`, each with its `NAME.truth.json`. A log without one counts as
    /// one of robots that have nothing to do with each other.
    pub(super) fn recorded_in(folder: &Path) -> Result<Vec<(String, Self)>> {
        let mut logs = files(folder)?;
        logs.retain(|path| path.extension().is_some_and(|extension| extension == "mcap"));
        if logs.is_empty() {
            bail!(
                "{} holds no logs: NAME.mcap, and NAME.truth.json where the robots belong together",
                folder.display()
            );
        }
        let world = |log: &PathBuf| {
            let name = log.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let truth = log.with_extension("truth.json");
            Ok((name, if truth.exists() { Self::recorded(log, &truth) } else { Self::unrelated(log) }?))
        };
        logs.iter().map(world).collect()
    }

    /// What the last merge has written, but the input's messages.
    pub(super) fn output(&self) -> PathBuf {
        self.folder.path().join("merged.mcap")
    }

    /// Merges the world's log by a shipped pipeline, in one thread. `settings` are `STAGE.PARAMETER=VALUE`.
    pub(super) fn merge(&self, pipeline: &str, settings: &[String], registry: &Registry) -> Result<Merge> {
        let found = self.folder.path().join("summary.json");
        self.run(pipeline, settings, None, &self.output(), &summary::kind(), &found, registry)?;
        let text = std::fs::read(&found).with_context(|| format!("cannot read {}", found.display()))?;
        let summary: Summary = serde_json::from_slice(&text).context("cannot read the summary of a merge")?;
        let evaluation = evaluate_summary(&summary, &self.truth)?;
        Ok(Merge { summary, evaluation })
    }

    /// Runs a shipped pipeline, with a sink that writes its `result`.
    #[allow(clippy::too_many_arguments)]
    fn run(
        &self,
        pipeline: &str,
        settings: &[String],
        seed: Option<u64>,
        output: &Path,
        sink: &StageKind,
        result: &Path,
        registry: &Registry,
    ) -> Result<()> {
        let mut overrides = Overrides::default();
        overrides.seed = seed;
        for setting in settings {
            overrides.set(setting).with_context(|| format!("cannot set {setting}"))?;
        }
        let text = |path: &Path| path.to_string_lossy().into_owned();
        overrides.set_for_kind("mcap_sink", "file", text(output));
        if pipeline != SIMULATE {
            overrides.set_for_kind("mcap_source", "files", vec![text(&self.log)]);
            overrides.set_for_kind("mcap_sink", "pass_input", false);
        }
        let mut pipeline = shipped::load(Path::new(pipeline), &overrides, registry)?;
        let parameters = toml::Table::from_iter([("file".to_owned(), text(result).into())]);
        pipeline.attach(sink, parameters, "results", |_, _, _| true);
        engine::run(&pipeline, EngineKind::Single, &())?;
        Ok(())
    }
}

/// The files of a folder, by name.
pub(super) fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.map(|entry| entry.path())).collect::<Result<_, _>>()?;
    files.sort();
    Ok(files)
}
