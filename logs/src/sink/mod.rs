//! The stage kind `mcap_sink`: writes all that comes in to a log (MCAP, profile `ros2`).
//!
//! The log holds the results, each on the topic of its output, and, unless told otherwise, the messages of the input on
//! the channels that they were logged on. The same messages give the same bytes: nothing in the log tells when or where
//! it was written.
//!
//! A log that its run has finished holds the metadata record `gridweave` with `complete` = `true`. If the run has
//! failed, `complete` is `false` and `reason` says why. If the program was killed, there is no such record, and all
//! chunks but the last can be read.

mod close;
mod error;
mod log_writer;
mod routing;
mod stage;

pub use close::{CloseError, close_log};
pub use error::LogWriteError;
pub(crate) use log_writer::OUTCOME_RECORD;
pub use log_writer::{LogOptions, LogWriter, Outcome};
pub use routing::result_channel;

use gridweave_runtime::stage::{Output, ParameterError, Parameters, StageKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use stage::McapSink;
use std::path::PathBuf;

/// How the chunks of a log are compressed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Compression {
    /// Zstandard at its fastest level: the smallest logs.
    #[default]
    Zstd,
    /// LZ4: larger logs, written sooner.
    Lz4,
    /// No compression.
    None,
}

/// The parameters of `mcap_sink`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SinkParameters {
    /// The log to write. A file that has this name is replaced. Set by `--output`.
    pub file: PathBuf,
    /// Whether the messages of the input logs are written too, beside the results.
    pub pass_input: bool,
    /// The topics to write, `{robot}` standing for any one part of the path: `["/{robot}/map", "/tf"]`. All if none are
    /// given.
    pub only_topics: Vec<String>,
    /// How chunks are compressed.
    pub compression: Compression,
    /// A chunk is closed when it holds this many bytes before compression. If the program is killed, the open chunk is
    /// lost. 1 KiB to 512 MiB.
    pub chunk_size: u64,
}

impl Default for SinkParameters {
    fn default() -> Self {
        let LogOptions { compression, chunk_size } = LogOptions::default();
        Self { file: PathBuf::new(), pass_input: true, only_topics: Vec::new(), compression, chunk_size }
    }
}

impl Parameters for SinkParameters {
    fn check(&self) -> Vec<ParameterError> {
        let mut errors = Vec::new();
        if !(1 << 10..=1 << 29).contains(&self.chunk_size) {
            errors.push(ParameterError::new("chunk_size", "must be 1024 to 536870912 bytes"));
        }
        errors
    }
}

/// The stage kind.
pub fn kind() -> StageKind {
    StageKind::stage(
        "mcap_sink",
        "Writes messages of any type to a log (MCAP): each result on the topic of its output, and the messages of the \
         input as they were logged.",
        McapSink::new,
    )
    .any_inputs("messages", "what to write", McapSink::receive)
    .announce(McapSink::announce)
    .finish(|sink, _: &Output<()>| sink.end(Outcome::Complete))
    .abort(McapSink::abort)
    .build()
}
