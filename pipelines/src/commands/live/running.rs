//! The run that a command means.

use crate::status::BadUse;
use anyhow::{Result, bail};
use clap::Args;
use gridweave_runtime::engine::{RunningRun, running_runs};
use gridweave_runtime::pipeline::{Overrides, Pipeline};
use gridweave_runtime::stage::Registry;
use std::thread;
use std::time::{Duration, Instant};

/// Which of the runs that are going on is meant.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct RunChoice {
    /// Which run, if there are several: the name of its pipeline, or what its own begins with, as `top` shows
    /// it.
    #[arg(long, value_name = "NAME")]
    pub(crate) run: Option<String>,
    /// Wait for so many seconds until there is such a run.
    #[arg(long, value_name = "SECONDS", default_value_t = 5.0)]
    pub(crate) wait: f64,
}

/// So often it is looked for a run that is not there yet.
const LOOK_INTERVAL: Duration = Duration::from_millis(50);

/// A run that is going on, and its pipeline.
pub(super) struct Running {
    pub(super) run: RunningRun,
    pub(super) pipeline: Pipeline,
}

impl Running {
    /// What to call it.
    pub(super) fn name(&self) -> String {
        format!("{} ({})", self.pipeline.name, self.run.prefix)
    }
}

impl Drop for Running {
    /// A program that is still there when the run ends must not leave anything after it.
    fn drop(&mut self) {
        self.run.remove_traces();
    }
}

/// The run that is meant, of those of this user that are going on.
pub(super) fn find_run(choice: &RunChoice, registry: &Registry) -> Result<Running> {
    find_run_with(choice, registry, |_| true)
}

/// The same; where several may be meant, it is one with this pipeline.
pub(super) fn find_run_with(
    choice: &RunChoice,
    registry: &Registry,
    is_likely: impl Fn(&Pipeline) -> bool,
) -> Result<Running> {
    if !(choice.wait.is_finite() && choice.wait >= 0.0) {
        return Err(BadUse("--wait must be 0 s or more".to_owned()).into());
    }
    let start = Instant::now();
    loop {
        let mut runs = all_runs(registry)?;
        let names = |runs: &[Running]| runs.iter().map(Running::name).collect::<Vec<_>>().join(", ");
        let going_on = names(&runs);
        if let Some(name) = &choice.run {
            runs.retain(|running| running.pipeline.name == *name || running.run.prefix.starts_with(name));
        }
        if runs.iter().any(|running| is_likely(&running.pipeline)) {
            runs.retain(|running| is_likely(&running.pipeline));
        }
        match (runs.len(), runs.pop()) {
            (1, Some(running)) => return Ok(running),
            (0, _) if start.elapsed().as_secs_f64() < choice.wait => thread::sleep(LOOK_INTERVAL),
            (0, _) => match (&choice.run, going_on.is_empty()) {
                (Some(name), false) => bail!("no run called {name} is going on; there are {going_on}"),
                _ => bail!("no run of processes is going on: start one with `gridweave run live`"),
            },
            _ => return Err(BadUse(format!("several runs are going on: {going_on}; choose one with --run")).into()),
        }
    }
}

/// A run whose pipeline cannot be read has just ended, or has been started by another program.
fn all_runs(registry: &Registry) -> Result<Vec<Running>> {
    let load = |run: RunningRun| {
        let pipeline = Pipeline::load(&run.pipeline(), registry, &Overrides::default()).ok()?;
        Some(Running { run, pipeline })
    };
    Ok(running_runs()?.into_iter().filter_map(load).collect())
}
