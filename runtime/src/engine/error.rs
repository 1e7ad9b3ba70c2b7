//! How a run fails.

use super::RunFolderError;
use crate::link::LinkError;
use crate::stage::StageError;
use serde::{Deserialize, Serialize};
use std::fmt;

/// A run has failed: which stage, and why.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub struct RunError {
    /// The stage that failed first; none if the run as a whole did.
    pub stage: Option<String>,
    /// Why.
    pub failure: Failure,
}

impl RunError {
    /// A stage has failed.
    pub fn of_stage(stage: &str, failure: impl Into<Failure>) -> Self {
        Self { stage: Some(stage.to_owned()), failure: failure.into() }
    }

    /// The run as a whole has failed.
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

/// Why a stage, or a run, has failed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, thiserror::Error)]
#[serde(rename_all = "snake_case")]
pub enum Failure {
    /// It says so itself.
    #[error("failed: {0}")]
    Stage(#[from] StageError),
    /// It panicked: a fault in the program.
    #[error("panicked: {0}; this is a fault in the program, please report it")]
    Panic(String),
    /// Its links failed.
    #[error("lost its links: {0}")]
    Link(#[from] LinkError),
    /// The user asked for a stop.
    #[error("was interrupted")]
    Interrupted,
    /// The user asked a live run for its end, and it does not come to it.
    #[error(
        "was to end, but nothing has moved in it for {seconds} s, and these stages have not ended: {}",
        stages.join(", ")
    )]
    Stuck {
        /// For how long nothing has moved.
        seconds: f64,
        /// The stages that have not ended, with how many messages wait in them.
        stages: Vec<String>,
    },
    /// Its process could not be started or watched.
    #[error("cannot run in processes: {0}")]
    Process(String),
    /// What a program outside of the run wants of it cannot be.
    #[error("{0}")]
    Outside(String),
    /// Its process has ended before the stage was done.
    #[error("lost its process, which {0}")]
    Ended(String),
    /// It has worked for so long without a pause.
    #[error("hangs: it has made no progress for {seconds} s; `stall_timeout` in [pipeline] sets how long it may take")]
    Hung {
        /// For how long.
        seconds: f64,
    },
    /// Its process has taken more memory than the pipeline allows.
    #[error(
        "was ended, as its process had taken {} MB of memory; `memory_limit` in [pipeline] allows {} MB",
        taken / 1_000_000,
        limit / 1_000_000
    )]
    Memory {
        /// Bytes that it had taken.
        taken: u64,
        /// Bytes that it may take.
        limit: u64,
    },
    /// The process that started it is gone.
    #[error("lost its supervisor")]
    Orphaned,
}
