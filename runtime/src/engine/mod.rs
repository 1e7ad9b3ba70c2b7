//! Engines: what runs the stages of a pipeline.
//!
//! Every engine gives each stage the same inputs in the same order, so every engine gives the same result.

mod error;
mod external_sender;
mod links;
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

pub use error::{Failure, RunError};
pub use external_sender::{ExternalSender, SenderStopper};
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

/// How the stages share the machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EngineKind {
    /// All stages in one thread; a message goes straight from one to the next.
    Single,
    /// A thread a stage, with links over iceoryx2 within the process.
    #[default]
    Threads,
    /// A thread a stage, with links over the shared memory of the machine, as between processes.
    ThreadsIpc,
    /// A process a stage. The program itself is started for each of them, with the command `stage`.
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

/// What looks on while a pipeline runs. Nothing that it does changes the result, unless it asks for a stop.
pub trait Observer: Sync {
    /// A source has done this share of its work (0 to 1) and stands at this log time. Called now and then.
    fn progress(&self, _stage: &str, _share: f64, _log_time: LogTime) {}

    /// All processes of a run have been started, whose names begin so.
    fn started(&self, _prefix: &str) {}

    /// A stage of a live run has failed, and is started again after a while.
    fn restarting(&self, _stage: &str, _failure: &str, _after: Duration) {}

    /// Whether the run should stop, as after an interrupt by the user.
    fn should_stop(&self) -> bool {
        false
    }
}

/// An observer that sees nothing.
impl Observer for () {}

/// Asks a run to stop when it is set, for example by a signal handler.
impl Observer for AtomicBool {
    fn should_stop(&self) -> bool {
        self.load(Ordering::Relaxed)
    }
}

/// Runs a pipeline to its end: a replay to that of its logs, a live one until the observer asks for a stop.
pub fn run(pipeline: &Pipeline, engine: EngineKind, observer: &dyn Observer) -> Result<RunReport, RunError> {
    if pipeline.mode == Mode::Live && engine != EngineKind::Processes {
        let text = format!("it is live, and the engine `{engine}` is for replays: use `processes`");
        return Err(RunError::of_run(Failure::Process(text)));
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
                .map_err(|error| RunError::of_run(Failure::Process(format!("cannot find this program: {error}"))))?;
            processes::run(pipeline, &launch, observer)
        }
    }
}
