//! What the tests of several stages share: buildings as robots draw them, and stages from outside.

pub(crate) mod floor_plan;
pub(crate) mod stage_bench;
