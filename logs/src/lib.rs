//! Logs for Gridweave: MCAP files in and out, and what they hold.

pub mod info;
pub mod reader;
pub mod source;
pub mod tf;

#[cfg(test)]
mod test_log;

use gridweave_runtime::stage::StageKind;

/// The stage kinds that read and write logs.
pub fn kinds() -> Vec<StageKind> {
    vec![source::kind()]
}
