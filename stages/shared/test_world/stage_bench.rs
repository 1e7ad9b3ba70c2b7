//! A stage as a whole: maps and alignments in, alignments out.

use super::floor_plan::DrawnMap;
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{Alignment, Header, OccupancyGrid};
use gridweave_runtime::stage::{Context, StageHarness, StageKind};

/// A stage that receives a message each second. Its inputs are `map` and `alignment`, its output is `alignment`.
pub struct StageBench {
    /// The stage itself, for what the methods here do not give.
    pub stage: StageHarness,
    seconds: u64,
}

impl StageBench {
    /// A stage of a kind, with parameters in TOML.
    pub fn new(kind: &StageKind, parameters: &str) -> Self {
        Self { stage: StageHarness::new(kind, parameters).unwrap(), seconds: 0 }
    }

    /// The same, with the context of a pipeline.
    pub fn with_context(kind: &StageKind, parameters: &str, context: &Context) -> Self {
        Self { stage: StageHarness::with_context(kind, parameters, context).unwrap(), seconds: 0 }
    }

    /// Sends an alignment to the stage; returns what the stage sends then.
    pub fn give(&mut self, alignment: &Alignment) -> Vec<Alignment> {
        let log_time = self.next();
        self.stage.give::<Alignment>("alignment", "", log_time, alignment).unwrap();
        self.sent()
    }

    /// Sends the map of a robot to the stage; returns what the stage sends then.
    pub fn give_map(&mut self, robot: &str, map: &DrawnMap) -> Vec<Alignment> {
        let header = Header { frame_id: format!("{robot}/map"), ..Default::default() };
        self.give_grid(robot, &OccupancyGrid { header, info: map.info(), data: &map.bytes() })
    }

    /// The same, for a map as a message.
    pub fn give_grid(&mut self, robot: &str, map: &OccupancyGrid<'_>) -> Vec<Alignment> {
        let log_time = self.next();
        self.stage.give::<OccupancyGrid<'_>>("map", robot, log_time, map).unwrap();
        self.sent()
    }

    /// Ends the inputs of the stage; returns what the stage sends then.
    pub fn finish(&mut self) -> Vec<Alignment> {
        self.stage.finish(LogTime(self.seconds)).unwrap();
        self.sent()
    }

    /// A counter of the stage.
    pub fn counted(&self, what: &str) -> u64 {
        self.stage.counts()[what]
    }

    fn next(&mut self) -> LogTime {
        self.seconds += 1;
        LogTime(self.seconds * 1_000_000_000)
    }

    fn sent(&mut self) -> Vec<Alignment> {
        self.stage.take("alignment").unwrap()
    }
}
