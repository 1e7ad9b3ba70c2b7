//! `live_source`: what robots send into a live pipeline.

use super::ports;
use gridweave_runtime::stage::{Parameters, StageKind};
use schemars::JsonSchema;
use serde::Deserialize;

/// The parameters of `live_source`: none.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct LiveSourceParameters {}

impl Parameters for LiveSourceParameters {}

/// The kind `live_source`.
pub fn live_kind() -> StageKind {
    StageKind::external::<LiveSourceParameters>(
        "live_source",
        "Takes what robots send into a live pipeline while it runs: `gridweave play`, or a program of theirs. Keeps the last \
         message of each topic for stages that are started again",
        ports(),
    )
}
