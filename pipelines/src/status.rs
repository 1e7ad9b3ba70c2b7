//! Outcomes of a command.

/// An error in the command line: exit status 2.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct BadUse(pub(crate) String);

/// Outcome of a command, which decides its exit status.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Status {
    /// All is done.
    Done,
    /// The command line was wrong; the error has been printed.
    BadUse,
    /// The command failed; the error has been printed.
    Failed,
    /// All is done, but some robots could not be merged.
    NotAllMerged,
}
