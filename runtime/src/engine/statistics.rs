//! The statistics of the stages of a run, from its shared counters.

use crate::link::{SharedCounters, StageCounter, StageCounters, WireCounter};
use crate::pipeline::Pipeline;
use crate::stage::{RunStatistics, StageStatistics};
use std::sync::Arc;

/// The statistics of each stage, in the order of the pipeline.
pub fn stage_statistics(pipeline: &Pipeline, counters: &[StageCounters]) -> Vec<StageStatistics> {
    pipeline.stages.iter().zip(counters).map(|(stage, counters)| of_stage(&stage.name, counters)).collect()
}

/// The statistics of a run with these counters, for a stage that shows them.
pub(super) fn run_statistics(pipeline: &Pipeline, counters: &Arc<SharedCounters>) -> RunStatistics {
    let named = |(index, stage): (usize, &crate::pipeline::StageSpec)| (stage.name.clone(), counters.stage(index));
    let stages: Vec<(String, StageCounters)> = pipeline.stages.iter().enumerate().map(named).collect();
    RunStatistics::new(move || stages.iter().map(|(name, counters)| of_stage(name, counters)).collect())
}

fn of_stage(name: &str, counters: &StageCounters) -> StageStatistics {
    StageStatistics {
        name: name.to_owned(),
        state: counters.state().name(),
        messages_in: counters.get(StageCounter::MessagesIn),
        messages_out: (0..counters.ports()).map(|port| counters.sent(port)).sum(),
        busy_ms: counters.get(StageCounter::Busy) as f64 * 1e-6,
        dropped: (0..counters.wires()).map(|wire| counters.get_wire(wire, WireCounter::Dropped)).sum(),
        restarts: counters.get(StageCounter::Restarts),
        warnings: counters.get(StageCounter::Warnings),
    }
}
