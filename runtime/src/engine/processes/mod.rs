//! The engine `processes`: one process per stage, with links over the shared memory of the machine.
//!
//! The **supervisor** ([`run`]) writes the pipeline to the run's folder, starts the processes, and waits for all of
//! them. Stages with the same `process` in the pipeline file share one. Each process ([`run_process`]) creates its
//! stages and their links like the engine `threads`, and reports to the supervisor.
//!
//! They exchange lines of JSON (`protocol.rs`): commands on the standard input of the process, reports on its standard
//! output. The closed pipe shows each of them that the other has died, whatever the cause:
//!
//! - A process that ends before its stages are done has failed. The supervisor then stops all others with the cause,
//!   and kills those that do not end within a timeout.
//! - When the supervisor is gone, the processes stop.
//!
//! In both cases a sink closes its output and records in it why it is not complete.
//!
//! A live run continues without a failed process if its stages have `restart = "on_failure"`: the supervisor removes
//! what the process has left in shared memory and restarts it after a delay. A live run ends when the observer requests
//! a stop: the sources send no more, and pending messages are handled, however long that takes. The run fails only if
//! there is no progress.

mod backoff;
mod child;
mod drain;
mod event;
mod process;
mod protocol;
mod spawn;
mod supervisor;
mod suspend_detector;
mod system;

pub use child::run_process;
pub use system::{describe_exit, memory_of_process};

use super::{EngineKind, Observer, RunError, RunReport, address_space};
use crate::pipeline::Pipeline;
use std::path::PathBuf;
use std::sync::OnceLock;

/// The command line of a process of a run: PROGRAM ARGUMENTS FOLDER PROCESS. The program must call [`run_process`] with
/// the folder, the name, and the stage kinds of the program that started it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Launch {
    /// The program.
    pub program: PathBuf,
    /// The arguments before the folder and the name.
    pub arguments: Vec<String>,
}

/// The command line that starts this program again, where it runs within an interpreter.
static THIS_PROGRAM: OnceLock<Launch> = OnceLock::new();

impl Launch {
    /// The current program.
    ///
    /// # Errors
    /// The system does not say which program this is.
    pub fn this_program() -> std::io::Result<Self> {
        match THIS_PROGRAM.get() {
            Some(set) => Ok(set.clone()),
            None => Ok(Self { program: std::env::current_exe()?, arguments: Vec::new() }),
        }
    }

    /// Makes this the command line of [`this_program`](Self::this_program), for a program that runs within an
    /// interpreter. Only the first call has an effect.
    pub fn set_this_program(self) {
        // The command line of a process does not change.
        let _ = THIS_PROGRAM.set(self);
    }

    /// The same with one more argument, such as the command `stage`.
    #[must_use]
    pub fn with(mut self, argument: &str) -> Self {
        self.arguments.push(argument.to_owned());
        self
    }
}

/// Runs a pipeline to its end, with its stages in processes.
pub fn run(pipeline: &Pipeline, launch: &Launch, observer: &dyn Observer) -> Result<RunReport, RunError> {
    address_space::check(EngineKind::Processes, pipeline).map_err(RunError::of_run)?;
    supervisor::run(pipeline, launch, observer)
}
