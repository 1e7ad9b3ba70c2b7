//! How a link over shared memory fails.

use serde::{Deserialize, Serialize};
use std::fmt;

/// A link over shared memory could not be made or used.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
#[serde(rename_all = "snake_case")]
pub enum LinkError {
    /// iceoryx2 refused something.
    #[error("cannot {doing}: iceoryx2 says {cause}; {}", HELP)]
    Shared {
        /// What was being done.
        doing: String,
        /// What iceoryx2 says.
        cause: String,
    },
    /// A sample does not follow the protocol.
    #[error("cannot read a sample of {link}: {problem}")]
    Sample {
        /// The link.
        link: String,
        /// What is wrong with it.
        problem: String,
    },
    /// A reader has not taken a sample although it had given credit for it.
    #[error("a sample of {link} reached {reached} of {readers} readers; a reader must have gone away")]
    Lost {
        /// The link.
        link: String,
        /// Readers that got it.
        reached: usize,
        /// Readers there are.
        readers: usize,
    },
    /// There is no memory for what is to be sent.
    #[error(
        "cannot send {bytes} bytes on {link}: there is no memory for it; a smaller `depth` or `--engine single` \
         lets fewer messages wait at a time"
    )]
    Memory {
        /// The link.
        link: String,
        /// Its size.
        bytes: usize,
    },
    /// There is no room in the shared memory of the machine.
    #[error(
        "cannot {doing}: there is no room left in /dev/shm; make room there, or use `--engine threads`, which needs none"
    )]
    Full {
        /// What was being done.
        doing: String,
    },
    /// As many programs as can send on a link, or look on at it, do so already.
    #[error("cannot {doing} {link}: {most} programs do so already, and no more can; end one of them")]
    Crowded {
        /// What was being done.
        doing: String,
        /// The link.
        link: String,
        /// How many can.
        most: usize,
    },
    /// The run is being stopped because something else has failed.
    #[error("the run is being stopped")]
    Stopped,
}

/// What mends most failures of shared memory.
const HELP: &str = "check that /dev/shm has room and can be written";

impl From<LinkError> for crate::stage::StageError {
    fn from(error: LinkError) -> Self {
        Self::new("send a message", error)
    }
}

impl LinkError {
    /// An error of iceoryx2 while `doing` something.
    pub(crate) fn shared(doing: impl Into<String>) -> impl FnOnce(&dyn fmt::Debug) -> Self {
        let doing = doing.into();
        move |cause| Self::Shared { doing, cause: format!("{cause:?}") }
    }
}
