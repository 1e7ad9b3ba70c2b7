//! The stage kind `foxglove_sink`: shows all input messages in the Foxglove app during a run.
//!
//! It serves a WebSocket (`ws://HOST:PORT`), which Foxglove opens as "Foxglove WebSocket". The messages are sent
//! unchanged: ROS 2 messages in CDR with their definitions, on the topics that they would have in a log.
//!
//! Foxglove's protocol has no latched topics. So the latest message of each latched topic is retained here, and sent to
//! each client that subscribes to it; for `/tf_static`, the latest transform of each frame. The run never waits for a
//! client. At most 32 MiB wait for one, and 256 MiB for all together; a message that is larger is sent where nothing
//! waits. A slow client gets fewer messages, and of a latched topic the latest.
//!
//! At most 32 clients are let in, and no pages of foreign sites.
//!
//! The progress of the stages is published on the topic `/gridweave/stages`, once a second, as JSON with a schema; not
//! with the engine `single`, which does not count during the run.

mod front;
mod retained;
mod servers;
mod stage;
mod statistics;
mod viewers;
mod waiting;

use gridweave_runtime::stage::{Output, ParameterError, Parameters, StageKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use stage::FoxgloveSink;

/// The port that Foxglove connects to by default.
pub const STANDARD_PORT: u16 = 8765;
/// Only programs on this machine can connect.
pub const STANDARD_HOST: &str = "127.0.0.1";

/// The parameters of `foxglove_sink`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct FoxgloveParameters {
    /// The address to serve on. Anybody who can connect can read all messages of the run; `0.0.0.0` allows connections
    /// from other machines.
    host: String,
    /// The port to serve on; 0 for a free port, which `-v` prints.
    port: u16,
    /// The maximum number of queued messages per client; beyond it the oldest are dropped.
    #[schemars(range(min = 1, max = 100_000))]
    backlog: usize,
    /// The sites whose pages may connect, such as `https://viewer.example`, beside those of this machine and of
    /// Foxglove.
    origins: Vec<String>,
}

impl Default for FoxgloveParameters {
    fn default() -> Self {
        Self { host: STANDARD_HOST.to_owned(), port: STANDARD_PORT, backlog: 256, origins: Vec::new() }
    }
}

impl Parameters for FoxgloveParameters {
    fn check_together(&self) -> Vec<ParameterError> {
        let problem = || ParameterError::new("host", "must be an address or the name of a host");
        self.host.is_empty().then(problem).into_iter().collect()
    }
}

/// The stage kind.
pub fn kind() -> StageKind {
    StageKind::stage(
        "foxglove_sink",
        "Shows messages of any type in the Foxglove app during the run, over a WebSocket server. A client that joins late \
         gets the latest message of each latched topic at once, and no client slows the run.",
        FoxgloveSink::new,
    )
    .any_inputs("messages", "what to show", FoxgloveSink::receive)
    .announce(FoxgloveSink::announce)
    .finish(|sink, _: &Output<()>| {
        sink.close();
        Ok(())
    })
    .abort(|sink, _| sink.close())
    .build()
}
