//! How a run fails.

use crate::link::shared::LinkError;
use crate::stage::StageError;

/// A run has failed: which stage, and why.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}", self.text())]
pub struct RunError {
    /// The stage that failed first.
    pub stage: String,
    /// Why.
    pub failure: Failure,
}

impl RunError {
    fn text(&self) -> String {
        match &self.failure {
            // No stage has done anything wrong.
            Failure::Interrupted => "the run was interrupted".to_owned(),
            failure => format!("stage `{}` {failure}", self.stage),
        }
    }
}

/// Why a stage has failed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
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
}
