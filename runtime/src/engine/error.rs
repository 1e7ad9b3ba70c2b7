//! The errors of a run.

use super::RunFolderError;
use crate::link::LinkError;
use crate::stage::StageError;
use serde::{Deserialize, Serialize};
use std::fmt;

/// The error of a failed run: the stage and the cause.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub struct RunError {
    /// The stage that failed first; none if the run as a whole did.
    pub stage: Option<String>,
    /// The cause.
    pub failure: Failure,
}

impl RunError {
    /// The error of a failed stage.
    pub fn of_stage(stage: &str, failure: impl Into<Failure>) -> Self {
        Self { stage: Some(stage.to_owned()), failure: failure.into() }
    }

    /// The error of a run that failed as a whole.
    pub fn of_run(failure: impl Into<Failure>) -> Self {
        Self { stage: None, failure: failure.into() }
    }
}

impl fmt::Display for RunError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.stage {
            Some(stage) => write!(f, "stage `{stage}` {}", self.failure),
            None => write!(f, "the run {}", self.failure),
        }
    }
}

impl From<RunFolderError> for Failure {
    fn from(error: RunFolderError) -> Self {
        Self::Process(error.to_string())
    }
}

/// The cause of a failed stage or run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, thiserror::Error)]
#[serde(rename_all = "snake_case")]
pub enum Failure {
    /// The stage returned an error.
    #[error("failed: {0}")]
    Stage(#[from] StageError),
    /// The stage panicked, which is a bug.
    #[error("panicked: {0}; this is a bug in the program, please report it")]
    Panic(String),
    /// A link of the stage failed.
    #[error("lost its links: {0}")]
    Link(#[from] LinkError),
    /// The user interrupted the run.
    #[error("was interrupted")]
    Interrupted,
    /// The user stopped a live run, but it makes no progress towards its end.
    #[error(
        "was asked to end, but has made no progress for {seconds} s, and these stages have not ended: {}",
        stages.join(", ")
    )]
    Stuck {
        /// The time without progress.
        seconds: f64,
        /// The stages that have not ended, with the numbers of their pending messages.
        stages: Vec<String>,
    },
    /// The engine reserves more address space than the program may have.
    #[error(
        "needs at least {} MB of address space with the engine `{engine}`, which reserves far more than it uses, and this program \
         may have {} MB (`ulimit -v`): raise that limit{}",
        needed >> 20,
        limit >> 20,
        if engine == "single" { "" } else { ", or, for a replay, use `--engine single`" }
    )]
    AddressSpace {
        /// The name of the engine.
        engine: String,
        /// The address space that it needs at least, bytes.
        needed: u64,
        /// The limit, bytes.
        limit: u64,
    },
    /// A process or thread could not be started, or the folder of the run could not be used.
    #[error("could not be started: {0}")]
    Process(String),
    /// The folder of the run was removed, by which its processes find each other.
    #[error(
        "has lost its folder {0}, which another program has removed: run it again, with XDG_RUNTIME_DIR set to a folder that stays"
    )]
    NoFolder(String),
    /// The request of a program outside of the run is impossible.
    #[error("{0}")]
    Outside(String),
    /// The process ended before the stage was done.
    #[error("lost its process, which {0}")]
    Ended(String),
    /// The stage exceeded `stall_timeout` on one message.
    #[error("hangs: it has made no progress for {seconds} s; `stall_timeout` in [pipeline] sets how long it may take")]
    Hung {
        /// The timeout.
        seconds: f64,
    },
    /// The process exceeded the memory limit of the pipeline.
    #[error(
        "was killed, as its process used {} MB of memory; `memory_limit` in [pipeline] allows {} MB",
        taken / 1_000_000,
        limit / 1_000_000
    )]
    Memory {
        /// The memory that it used, bytes.
        taken: u64,
        /// The memory limit, bytes.
        limit: u64,
    },
    /// The pending messages of one log time take more memory than the pipeline allows.
    #[error(
        "has received {messages} messages of `{input}` with the same log time, {}.{:09} s, and can handle none of them before \
         later ones come, as other inputs may bring some of that time; they take {} MB of memory, and `same_time_limit` in \
         [pipeline] allows {} MB: give the messages of the log their own times, leave their topic out, or raise the limit",
        log_time / 1_000_000_000,
        log_time % 1_000_000_000,
        bytes / 1_000_000,
        limit / 1_000_000
    )]
    SameTime {
        /// The output that they come from: STAGE.PORT.
        input: String,
        /// The number of pending messages.
        messages: usize,
        /// Their log time, nanoseconds.
        log_time: u64,
        /// The memory that they take, bytes.
        bytes: u64,
        /// The limit, bytes.
        limit: u64,
    },
    /// The process that started it is gone.
    #[error("lost its supervisor")]
    Orphaned,
}
