//! What the stages of a run have done so far, by its board.

use crate::link::{Board, StageBoard, StageNumber, WireNumber};
use crate::pipeline::Pipeline;
use crate::stage::{RunStatistics, StageStatistics};
use std::sync::Arc;

/// What each stage of a pipeline has done, by what it shows of itself; in their order.
pub fn stage_statistics(pipeline: &Pipeline, boards: &[StageBoard]) -> Vec<StageStatistics> {
    pipeline.stages.iter().zip(boards).map(|(stage, board)| of_stage(&stage.name, board)).collect()
}

/// The same of a run that has this board, for its stages.
pub(super) fn run_statistics(pipeline: &Pipeline, board: &Arc<Board>) -> RunStatistics {
    let named = |(index, stage): (usize, &crate::pipeline::StageSpec)| (stage.name.clone(), board.stage(index));
    let stages: Vec<(String, StageBoard)> = pipeline.stages.iter().enumerate().map(named).collect();
    RunStatistics::new(move || stages.iter().map(|(name, board)| of_stage(name, board)).collect())
}

fn of_stage(name: &str, board: &StageBoard) -> StageStatistics {
    StageStatistics {
        name: name.to_owned(),
        state: board.state().word(),
        messages_in: board.get(StageNumber::MessagesIn),
        messages_out: (0..board.ports()).map(|port| board.sent(port)).sum(),
        busy_ms: board.get(StageNumber::Busy) as f64 * 1e-6,
        dropped: (0..board.wires()).map(|wire| board.get_wire(wire, WireNumber::Dropped)).sum(),
        restarts: board.get(StageNumber::Restarts),
        warnings: board.get(StageNumber::Warnings),
    }
}
