//! What a source counts, for the summary of a run.

use serde::Serialize;
use std::collections::BTreeMap;

/// What was read of one robot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub(crate) struct RobotCount {
    /// Occupancy grids.
    pub(crate) maps: u64,
    /// Poses, those that were made from transforms among them.
    pub(crate) poses: u64,
    /// Range readings of tags.
    pub(crate) readings: u64,
}

/// What was read.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct SourceCount {
    pub(crate) files: usize,
    pub(crate) messages: u64,
    /// Bytes of the messages, uncompressed.
    pub(crate) bytes: u64,
    pub(crate) chunks: usize,
    pub(crate) chunks_skipped: u64,
    pub(crate) robots: BTreeMap<String, RobotCount>,
}
