//! The error of a stage.

use serde::{Deserialize, Serialize};
use std::fmt;

/// The error of a stage: what it was doing, what went wrong, and what would fix it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StageError {
    doing: String,
    cause: String,
    help: Option<String>,
    parameter: Option<String>,
}

impl StageError {
    /// An error. `doing` completes "cannot ...", such as "open /logs/a.mcap"; `cause` says what went wrong.
    pub fn new(doing: impl Into<String>, cause: impl fmt::Display) -> Self {
        Self { doing: doing.into(), cause: cause.to_string(), help: None, parameter: None }
    }

    /// Adds what would fix it.
    #[must_use]
    pub fn with_help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// Marks the error as caused by the value of a parameter that only the running stage can check.
    #[must_use]
    pub fn of_parameter(mut self, parameter: impl Into<String>) -> Self {
        self.parameter = Some(parameter.into());
        self
    }

    /// The parameter with the wrong value, if the error is caused by one.
    pub fn parameter(&self) -> Option<&str> {
        self.parameter.as_deref()
    }
}

impl fmt::Display for StageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "cannot {}: {}", self.doing, self.cause)?;
        match &self.help {
            Some(help) => write!(f, "; {help}"),
            None => Ok(()),
        }
    }
}

impl std::error::Error for StageError {}
