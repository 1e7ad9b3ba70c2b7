//! For tests and benches of stages, here and in other crates: robots' maps of buildings, and a stage on a bench.
//!
//! An error here is a test that fails: functions panic where a map or a stage cannot be made.

#![allow(clippy::unwrap_used, reason = "only tests and benches use it")]

pub mod building;
pub mod floor_plan;
pub mod stage_bench;
