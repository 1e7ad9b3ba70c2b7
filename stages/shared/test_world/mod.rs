//! Buildings and stages that the tests of several modules share.

pub(crate) mod floor_plan;
pub(crate) mod stage_bench;
