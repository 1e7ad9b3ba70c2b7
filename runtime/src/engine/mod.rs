//! Engines: they run the stages of a pipeline.
//!
//! Every engine delivers the same inputs in the same order to each stage, so every engine produces the same result.

mod address_space;
mod calls;
mod error;
mod external_sender;
mod links;
mod private_folder;
pub mod processes;
mod report;
mod run_folder;
mod run_links;
mod run_lock;
mod run_prefix;
mod runner;
mod single;
mod stage_thread;
mod statistics;
mod threads;
mod user_folder;
mod watch;
mod work_timer;

pub use calls::wait_for_long_call;
pub use error::{Failure, RunError};
pub use external_sender::{ExternalSender, SenderStopper};
pub use private_folder::PrivateFolder;
pub use processes::{describe_exit, memory_of_process};
pub use report::{RunReport, StageReport};
pub use run_folder::{LeftOver, RunFolder, RunFolderError, RunningRun, clean, running_runs};
pub use run_links::watch_links;
pub use statistics::stage_statistics;
pub use watch::{WatchedLink, watch_stages, watch_statistics};

use crate::link::RunNames;
use crate::message::LogTime;
use crate::pipeline::{Mode, Pipeline};
use std::fmt;
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// The engine of a run: how its stages are distributed over threads and processes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EngineKind {
    /// All stages in one thread; a message goes directly from one to the next.
    Single,
    /// One thread per stage, with links over iceoryx2 within the process.
    #[default]
    Threads,
    /// One thread per stage, with links over the shared memory of the machine, as between processes.
    ThreadsIpc,
    /// One process per stage. The program starts itself for each of them, with the command `stage`.
    Processes,
}

impl FromStr for EngineKind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "single" => Ok(Self::Single),
            "threads" => Ok(Self::Threads),
            "threads-ipc" => Ok(Self::ThreadsIpc),
            "processes" => Ok(Self::Processes),
            other => {
                Err(format!("there is no engine `{other}`; the engines are single, threads, threads-ipc and processes"))
            }
        }
    }
}

impl fmt::Display for EngineKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Single => "single",
            Self::Threads => "threads",
            Self::ThreadsIpc => "threads-ipc",
            Self::Processes => "processes",
        })
    }
}

/// An observer of a run. It does not influence the result, unless it requests a stop.
pub trait Observer: Sync {
    /// Reports the progress of a source: the share of its work that is done (0 to 1) and the log time that it has
    /// reached. Called from time to time.
    fn progress(&self, _stage: &str, _share: f64, _log_time: LogTime) {}

    /// Reports that all processes of a run were started, with the name prefix of the run.
    fn started(&self, _prefix: &str) {}

    /// Reports that a stage of a live run has failed, and is restarted after a delay.
    fn restarting(&self, _stage: &str, _failure: &str, _after: Duration) {}

    /// Whether the run should stop, for example after an interrupt by the user.
    fn should_stop(&self) -> bool {
        false
    }
}

/// An observer that ignores everything.
impl Observer for () {}

/// An observer that requests a stop when the flag is set, for example by a signal handler.
impl Observer for AtomicBool {
    fn should_stop(&self) -> bool {
        self.load(Ordering::Relaxed)
    }
}

/// Runs a pipeline to its end: a replay until its logs end, a live run until the observer requests a stop.
///
/// # Errors
/// A stage or the run as a whole fails, or the observer stops a replay.
pub fn run(pipeline: &Pipeline, engine: EngineKind, observer: &dyn Observer) -> Result<RunReport, RunError> {
    if pipeline.mode == Mode::Live && engine != EngineKind::Processes {
        let text = format!("the pipeline is live, and the engine `{engine}` is for replays only: use `processes`");
        return Err(RunError::of_run(Failure::Process(text)));
    }
    if engine != EngineKind::Processes {
        address_space::check(engine, pipeline).map_err(RunError::of_run)?;
    }
    match engine {
        EngineKind::Single => single::run(pipeline, observer),
        EngineKind::Threads => {
            threads::run::<iceoryx2::service::local::Service>(pipeline, &RunNames::unique(), observer)
        }
        EngineKind::ThreadsIpc => {
            let folder = RunFolder::create().map_err(Failure::from).map_err(RunError::of_run)?;
            let result = threads::run::<iceoryx2::service::ipc::Service>(pipeline, &folder.names(), observer);
            let removed = folder.remove().map_err(Failure::from).map_err(RunError::of_run);
            result.and_then(|report| removed.map(|()| report))
        }
        EngineKind::Processes => {
            let launch = processes::Launch::this_program()
                .map(|program| program.with("stage"))
                .map_err(|error| RunError::of_run(Failure::Process(format!("cannot find this program: {error}"))))?;
            processes::run(pipeline, &launch, observer)
        }
    }
}
