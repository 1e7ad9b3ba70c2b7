//! The engine `processes`: every stage a process of its own, with links over the shared memory of the machine.
//!
//! The **supervisor** ([`run`]) writes the pipeline to the run's folder, starts the processes, and waits for all of them.
//! Stages that the pipeline file gives the same `process` share one. Each process ([`run_process`]) makes its stages and
//! their links as the engine `threads` does, and tells the supervisor how they go.
//!
//! They speak in lines of JSON (`words.rs`): the supervisor on the process's standard input, the process on its standard
//! output. So each learns of the other's death, in whatever way it died, from the end of the pipe:
//!
//! - A process that ends before its stages are done has failed. The supervisor then tells all others to stop and why,
//!   and kills those that have not ended after a while.
//! - When the supervisor is gone, the processes stop by themselves.
//!
//! In both cases a sink closes its output and says in it why it is not complete.
//!
//! A live run goes on without a process that has failed if its stages say `restart = "on_failure"`: the supervisor removes
//! what the process has left in shared memory and starts it again after a while. A live run ends when the observer asks
//! for a stop: the supervisor tells the sources to send no more, and what is on its way is handled to its end, however long
//! that takes; only when nothing moves any more does the run fail.

mod suspend_detector;
mod backoff;
mod child;
mod drain;
mod event;
mod process;
mod supervisor;
mod system;
mod protocol;

pub use child::run_process;
pub use system::{describe_exit, memory_of_process};

use super::{Observer, RunError, RunReport};
use crate::pipeline::Pipeline;
use std::path::PathBuf;

/// How a process of a run is started: PROGRAM ARGUMENTS FOLDER PROCESS. It must call [`run_process`] with the folder, the
/// name, and the stage kinds of the program that started it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Launch {
    /// The program.
    pub program: PathBuf,
    /// What stands before the folder and the name.
    pub arguments: Vec<String>,
}

impl Launch {
    /// This program itself, with the command `stage`.
    pub fn this_program() -> std::io::Result<Self> {
        Ok(Self { program: std::env::current_exe()?, arguments: vec!["stage".to_owned()] })
    }
}

/// Runs a pipeline to its end, its stages as processes.
pub fn run(pipeline: &Pipeline, launch: &Launch, observer: &dyn Observer) -> Result<RunReport, RunError> {
    supervisor::run(pipeline, launch, observer)
}
