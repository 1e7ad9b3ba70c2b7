//! Errors of a link over shared memory.

use rustix::io::Errno;
use rustix::process::{Resource, getrlimit};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::fs;

/// An error while a link over shared memory was created or used.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
#[serde(rename_all = "snake_case")]
pub enum LinkError {
    /// An operation of iceoryx2 failed.
    #[error("cannot {doing}: iceoryx2 says {cause}; {}", help(getrlimit(Resource::Fsize).current))]
    Shared {
        /// What was being done.
        doing: String,
        /// The error of iceoryx2.
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
    /// A sample did not reach a reader that had granted credit for it.
    #[error("a sample of {link} reached {reached} of {readers} readers; a reader must have disconnected")]
    Lost {
        /// The link.
        link: String,
        /// The readers that received it.
        reached: usize,
        /// The readers of the link.
        readers: usize,
    },
    /// There is not enough memory for a message.
    #[error(
        "cannot send {bytes} bytes on {link}: there is not enough memory; use a smaller `depth` or `--engine single`, \
         so that fewer messages wait at a time"
    )]
    Memory {
        /// The link.
        link: String,
        /// The size of the message.
        bytes: usize,
    },
    /// The shared memory of the machine is full.
    #[error(
        "cannot {doing}: there is no space left in /dev/shm; free some, or use `--engine threads`, which does not need it"
    )]
    Full {
        /// What was being done.
        doing: String,
    },
    /// This program has opened as many files as it may.
    #[error("cannot {doing}: this program has opened as many files as it may; raise the limit with `ulimit -n`")]
    Files {
        /// What was being done.
        doing: String,
    },
    /// An operation of iceoryx2 failed, and the address space of this program is limited.
    #[error(
        "cannot {doing}: iceoryx2 says {cause}; the address space of this program is limited to {} MB (`ulimit -v`), and shared \
         memory reserves far more than it uses: raise that limit, or, for a replay, use `--engine single`",
        limit >> 20
    )]
    AddressSpace {
        /// What was being done.
        doing: String,
        /// The error of iceoryx2.
        cause: String,
        /// The limit, bytes.
        limit: u64,
    },
    /// The link has the maximum number of external senders, or of observers.
    #[error("cannot {doing} {link}: {most} programs, the maximum, do so already; stop one of them")]
    Crowded {
        /// What was being done.
        doing: String,
        /// The link.
        link: String,
        /// The maximum.
        most: usize,
    },
    /// The run is being stopped, because something else has failed.
    #[error("the run is being stopped")]
    Stopped,
}

/// The number of files that iceoryx2 opens for one operation, at most, and has closed again when it reports the error.
const FILES_OF_ONE: u64 = 16;

/// Whether this program can open hardly any more files, which iceoryx2 does not distinguish from other errors.
fn are_files_used_up() -> bool {
    match fs::read_dir("/proc/self/fd") {
        Ok(open) => getrlimit(Resource::Nofile).current.is_some_and(|most| open.count() as u64 + FILES_OF_ONE > most),
        Err(error) => error.raw_os_error() == Some(Errno::MFILE.raw_os_error()),
    }
}

/// What fixes most errors of shared memory, where files have at most so many bytes.
fn help(longest_file: Option<u64>) -> String {
    let help = "check that /dev/shm has free space and is writable";
    match longest_file {
        None => help.to_owned(),
        Some(bytes) => format!(
            "{help}; or raise the limit of the size of files, {bytes} bytes (`ulimit -f`), which shared memory has as well"
        ),
    }
}

impl From<LinkError> for crate::stage::StageError {
    fn from(error: LinkError) -> Self {
        Self::new("send a message", error)
    }
}

impl LinkError {
    /// An error of iceoryx2 while `doing` something.
    pub(crate) fn shared(doing: impl Into<String>) -> impl FnOnce(&dyn fmt::Debug) -> Self {
        let doing = doing.into();
        move |cause| {
            if are_files_used_up() {
                return Self::Files { doing };
            }
            let cause = format!("{cause:?}");
            match getrlimit(Resource::As).current {
                Some(limit) => Self::AddressSpace { doing, cause, limit },
                None => Self::Shared { doing, cause },
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::help;

    #[test]
    fn a_limit_of_the_size_of_files_is_named_beside_the_shared_memory() {
        assert_eq!(help(None), "check that /dev/shm has free space and is writable");
        assert!(help(Some(51_200)).contains("/dev/shm") && help(Some(51_200)).contains("51200 bytes (`ulimit -f`)"));
    }
}
