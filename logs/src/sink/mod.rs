//! The stage kind `mcap_sink`: writes all input messages to a log (MCAP, profile `ros2`; or, if its name ends in
//! `.bag`, a ROS 1 bag).
//!
//! The log contains the results, each on the topic of its output, and by default the messages of the input on the
//! channels that they were logged on. The same messages give the same bytes: the log does not contain when or where it
//! was written.
//!
//! A log of a completed run has the metadata record `gridweave` with `complete` = `true`. If the run failed, `complete`
//! is `false` and `reason` says why. If the program was killed, there is no such record, and all chunks but the last
//! can be read.
//!
//! The records `gridweave_run` and `gridweave_inputs` document the results: the version, the pipeline with all
//! parameters and the seed as the text of a pipeline file, and the names, sizes and SHA-256 of the files that were
//! read. Such records of the input logs are passed on under names that begin with `earlier_`. All other metadata
//! records and attachments of the input are passed on unchanged, except the records `rosbag2`, which describe the file
//! that they are in.

mod chunk_file;
mod close;
mod error;
pub(crate) mod given_frames;
mod log_writer;
mod output_log;
mod provenance;
mod rewrite;
mod ros1;
pub(crate) mod routing;
mod stage;

pub use close::{CloseError, close_log};
pub use error::LogWriteError;
pub use log_writer::{LogOptions, LogWriter, Outcome};
pub use output_log::is_ros1_bag;
pub use provenance::InputFile;
pub(crate) use provenance::{INPUTS_RECORD, RUN_RECORD};
pub use rewrite::{RecoverError, Recovery, recover, write_supplement};
pub use routing::result_channel;

use gridweave_runtime::stage::{Output, Parameters, StageKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use stage::McapSink;
use std::path::PathBuf;

/// The compression of a log's chunks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Compression {
    /// Zstandard at its fastest level: the smallest logs.
    #[default]
    Zstd,
    /// LZ4: larger logs, faster to write.
    Lz4,
    /// No compression.
    None,
}

/// The parameters of `mcap_sink`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SinkParameters {
    /// The log to write; one whose name ends in `.bag` is a ROS 1 bag. An existing file of that name is replaced. Set
    /// by `--output`.
    pub file: PathBuf,
    /// Whether the content of the input logs is written beside the results: messages, attachments and metadata records.
    pub pass_input: bool,
    /// The topics to write, in which `{robot}` matches one part of the path: `["/{robot}/map", "/tf"]`. Empty for all.
    pub only_topics: Vec<String>,
    /// The compression of chunks; a ROS 1 bag has `lz4` for `zstd`.
    pub compression: Compression,
    /// The size before compression at which a chunk is closed, bytes. If the program is killed, the open chunk is lost.
    #[schemars(range(min = 1 << 10, max = 1 << 29))]
    pub chunk_size: u64,
    /// The pipeline as the text of a pipeline file, to be recorded in the log. Set by the command.
    pub recorded_pipeline: String,
    /// The input files whose names, sizes and hashes are recorded in the log. Set by the command.
    pub recorded_files: Vec<PathBuf>,
    /// Whether the file is left as `FILE.part` when it is whole: the command renames the files of all stages together.
    /// Set by the command.
    pub leave_part: bool,
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
            leave_part: false,
        }
    }
}

impl Parameters for SinkParameters {}

/// The stage kind.
pub fn kind() -> StageKind {
    StageKind::stage(
        "mcap_sink",
        "Writes messages of any type to a log (MCAP, or a ROS 1 bag if its name ends in .bag): each result on the topic of its output, and the messages of the \
         input as they were logged.",
        McapSink::new,
    )
    .any_inputs("messages", "what to write", McapSink::receive)
    .announce(McapSink::announce)
    .finish(|sink, _: &Output<()>| sink.end(Outcome::Complete))
    .abort(McapSink::abort)
    .build()
}
