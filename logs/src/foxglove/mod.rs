//! The stage kind `foxglove_sink`: shows all that comes in to the Foxglove app while the run goes on.
//!
//! It serves a WebSocket (`ws://HOST:PORT`), which Foxglove opens as "Foxglove WebSocket". The messages go there as they are,
//! ROS 2 messages in CDR with their definitions, on the topics that a log would have them on.
//!
//! Foxglove's protocol keeps nothing for those who come late. So the last message of each latched topic is kept here, and sent
//! to whoever subscribes to it; of `/tf_static` all transforms are, the last to each frame. A viewer that is too slow
//! gets fewer messages, the oldest of those that wait for it being dropped; nothing of the run waits for it.
//!
//! What the stages of the run have done so far is told on a topic of its own, `/gridweave/stages`, once a second, as JSON with a
//! schema; not with the engine `single`, which does not count while it runs.

mod kept;
mod stage;
mod statistics;

use gridweave_runtime::stage::{Output, ParameterError, Parameters, StageKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use stage::FoxgloveSink;

/// Where Foxglove looks for a server unless it is told otherwise.
pub const STANDARD_PORT: u16 = 8765;
/// Programs of this machine alone can reach it.
pub const STANDARD_HOST: &str = "127.0.0.1";

/// The parameters of `foxglove_sink`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct FoxgloveParameters {
    /// The address to serve on. Anybody who can reach it can read all that the run sends: `0.0.0.0` lets other machines in.
    host: String,
    /// The port to serve on; 0 for one that is free, which is told with `-v`.
    port: u16,
    /// For each viewer so many messages may wait; above that the oldest are dropped.
    #[schemars(range(min = 1, max = 100_000))]
    backlog: usize,
}

impl Default for FoxgloveParameters {
    fn default() -> Self {
        Self { host: STANDARD_HOST.to_owned(), port: STANDARD_PORT, backlog: 256 }
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
        "Shows messages of any type to the Foxglove app while the run goes on, over a WebSocket that it serves. Who comes late \
         gets the last message of each latched topic at once, and nobody slows the run.",
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
