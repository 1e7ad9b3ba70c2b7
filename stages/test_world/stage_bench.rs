//! A stage from outside: messages in, alignments out.

use super::floor_plan::DrawnMap;
use gridweave_runtime::message::{FixedText, LogTime, Message, MessageHeader};
use gridweave_runtime::ros::{Alignment, Header, OccupancyGrid, RosMessage, encode};
use gridweave_runtime::stage::{CollectedOutputs, Context, Node, Stage, StageKind};
use serde::Serialize;

/// The input port of the maps.
const MAP: usize = 0;

/// A stage, and what it sends.
pub(crate) struct StageBench {
    pub(crate) stage: Box<dyn Stage>,
    pub(crate) outputs: CollectedOutputs,
    /// Messages that were given, one each second.
    pub(crate) time: u64,
}

impl StageBench {
    /// A stage of a kind, with parameters in TOML.
    pub(crate) fn new(kind: &StageKind, parameters: &str) -> Self {
        let made = kind.make(parameters.parse().unwrap(), &Context::default());
        let Ok(Node::Stage(stage)) = made else { panic!("no stage") };
        Self { stage, outputs: CollectedOutputs::new(kind), time: 0 }
    }

    pub(crate) fn give<T: RosMessage + Serialize>(&mut self, port: usize, robot: &str, message: &T) -> Vec<Alignment> {
        self.give_bytes(port, robot, encode(message).unwrap())
    }

    pub(crate) fn give_bytes(&mut self, port: usize, robot: &str, bytes: Vec<u8>) -> Vec<Alignment> {
        self.time += 1;
        let log_time = LogTime(self.time * 1_000_000_000);
        let header = MessageHeader { log_time, robot: FixedText::new(robot).unwrap(), ..Default::default() };
        let message = Message::from_vec(header, bytes);
        self.stage.receive(port, &message, &mut self.outputs.output(log_time)).unwrap();
        self.sent()
    }

    pub(crate) fn give_map(&mut self, robot: &str, map: &DrawnMap) -> Vec<Alignment> {
        let header = Header { frame_id: format!("{robot}/map"), ..Default::default() };
        self.give(MAP, robot, &OccupancyGrid { header, info: map.info(), data: &map.bytes() })
    }

    pub(crate) fn finish(&mut self) -> Vec<Alignment> {
        self.stage.finish(&mut self.outputs.output(LogTime(self.time))).unwrap();
        self.sent()
    }

    /// A number of the stage's report.
    pub(crate) fn reported(&self, field: &str) -> u64 {
        self.stage.report().unwrap()[field].as_u64().unwrap()
    }

    fn sent(&mut self) -> Vec<Alignment> {
        self.outputs.take(0).iter().map(|message| message.decode().unwrap()).collect()
    }
}
