//! Choice of the run in progress that a command connects to.

use crate::status::BadUse;
use anyhow::{Result, bail};
use clap::Args;
use gridweave_runtime::engine::{RunningRun, running_runs};
use gridweave_runtime::pipeline::{Overrides, Pipeline};
use gridweave_runtime::stage::Registry;
use std::thread;
use std::time::{Duration, Instant};

/// Choice among the runs in progress.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct RunChoice {
    /// The run, if there are several: the name of its pipeline, or the beginning of the run's name, as `top` shows it.
    #[arg(long, value_name = "NAME")]
    pub(crate) run: Option<String>,
    /// Wait at most so many seconds for such a run.
    #[arg(long, value_name = "SECONDS", default_value_t = 5.0)]
    pub(crate) wait: f64,
}

/// Interval of the search for a run.
const SEARCH_INTERVAL: Duration = Duration::from_millis(50);

/// A run in progress and its pipeline.
pub(super) struct Running {
    pub(super) run: RunningRun,
    pub(super) pipeline: Pipeline,
}

impl Running {
    /// Name for messages: that of the pipeline and that of the run.
    pub(super) fn name(&self) -> String {
        format!("{} ({})", self.pipeline.name, self.run.prefix)
    }
}

impl Drop for Running {
    /// Removes what is left of a run that ended while this program was connected.
    fn drop(&mut self) {
        self.run.remove_traces();
    }
}

/// Finds the run among those of this user.
pub(super) fn find_run(choice: &RunChoice, registry: &Registry) -> Result<Running> {
    find_run_with(choice, registry, |_| true)
}

/// Finds the run as [`find_run`] does; among several, one whose pipeline is likely.
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
        let in_progress = names(&runs);
        if let Some(name) = &choice.run {
            runs.retain(|running| running.pipeline.name == *name || running.run.prefix.starts_with(name));
        }
        if runs.iter().any(|running| is_likely(&running.pipeline)) {
            runs.retain(|running| is_likely(&running.pipeline));
        }
        match (runs.len(), runs.pop()) {
            (1, Some(running)) => return Ok(running),
            (0, _) if start.elapsed().as_secs_f64() < choice.wait => thread::sleep(SEARCH_INTERVAL),
            (0, _) => match (&choice.run, in_progress.is_empty()) {
                (Some(name), false) => bail!("no run {name} is in progress; there are {in_progress}"),
                _ => bail!(
                    "no run with the engine `processes` is in progress: start one with `gridweave run live_merge`"
                ),
            },
            _ => {
                return Err(
                    BadUse(format!("several runs are in progress: {in_progress}; choose one with --run")).into()
                );
            }
        }
    }
}

/// Lists the runs in progress. A run whose pipeline cannot be read is left out: it has just ended, or is one of another
/// program.
fn all_runs(registry: &Registry) -> Result<Vec<Running>> {
    let load = |run: RunningRun| {
        let pipeline = Pipeline::load(&run.pipeline(), registry, &Overrides::default()).ok()?;
        Some(Running { run, pipeline })
    };
    Ok(running_runs()?.into_iter().filter_map(load).collect())
}
