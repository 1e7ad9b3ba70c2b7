//! The stage kind `mcap_sink`: writes all that comes in to a log (MCAP, profile `ros2`).
//!
//! The log holds the results, each on the topic of its output, and, unless told otherwise, the messages of the input on
//! the channels that they were logged on. The same messages give the same bytes: nothing in the log tells when or where
//! it was written.
//!
//! A log that its run has finished holds the metadata record `gridweave` with `complete` = `true`. If the run has
//! failed, `complete` is `false` and `reason` says why. If the program was killed, there is no such record, and all
//! chunks but the last can be read.
//!
//! The records `gridweave_run` and `gridweave_inputs` explain the results: the version, the pipeline with all its parameters and
//! its seed as the text of a pipeline file, and the names, sizes and SHA-256 of the files that were read. Those that the logs of
//! the input bear are passed on under names that begin with `earlier_`, and so are all their other metadata records and their
//! attachments, as they are; but not the records `rosbag2`, which describe the file that they are in.

mod chunk_file;
mod close;
mod error;
pub(crate) mod given_frames;
mod log_writer;
mod provenance;
mod rewrite;
pub(crate) mod routing;
mod stage;

pub use close::{CloseError, close_log};
pub use error::LogWriteError;
pub use log_writer::{LogOptions, LogWriter, Outcome};
pub use provenance::InputFile;
pub(crate) use provenance::{INPUTS_RECORD, RUN_RECORD};
pub use rewrite::{RecoverError, Recovery, recover, write_supplement};
pub use routing::result_channel;

use gridweave_runtime::stage::{Output, Parameters, StageKind};
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
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SinkParameters {
    /// The log to write. A file that has this name is replaced. Set by `--output`.
    pub file: PathBuf,
    /// Whether what is in the input logs is written too, beside the results: messages, attachments and metadata records.
    pub pass_input: bool,
    /// The topics to write, `{robot}` standing for any one part of the path: `["/{robot}/map", "/tf"]`. All if none are
    /// given.
    pub only_topics: Vec<String>,
    /// How chunks are compressed.
    pub compression: Compression,
    /// A chunk is closed when it holds this many bytes before compression. If the program is killed, the open chunk is
    /// lost.
    #[schemars(range(min = 1 << 10, max = 1 << 29))]
    pub chunk_size: u64,
    /// The pipeline as the text of a pipeline file, to be recorded in the log. Set by the command.
    pub recorded_pipeline: String,
    /// The files that the run reads, of which names, sizes and hashes are recorded in the log. Set by the command.
    pub recorded_files: Vec<PathBuf>,
}

impl Default for SinkParameters {
    fn default() -> Self {
        let LogOptions { compression, chunk_size } = LogOptions::default();
        Self {
            file: PathBuf::new(),
            pass_input: true,
            only_topics: Vec::new(),
            compression,
            chunk_size,
            recorded_pipeline: String::new(),
            recorded_files: Vec::new(),
        }
    }
}

impl Parameters for SinkParameters {}

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
