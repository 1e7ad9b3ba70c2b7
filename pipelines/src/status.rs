//! How a command ends.

/// The command line asks for something that cannot be.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct BadUse(pub(crate) String);

/// How a command ended, as its exit status says it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Status {
    /// All is done.
    Done,
    /// It was used wrongly; what is wrong has been said.
    BadUse,
    /// Something is not as it should be; what that is has been said.
    Failed,
    /// It is done, but some robots could not be merged.
    NotAllMerged,
}
