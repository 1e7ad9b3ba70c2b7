//! Small stages and a builder of pipelines, for tests of the engines.
#![allow(dead_code, missing_docs, unreachable_pub, clippy::unwrap_used, clippy::panic)]

use gridweave_runtime::message::{LogTime, Message, MessageHeader};
use gridweave_runtime::pipeline::{DEFAULT_SAME_TIME_LIMIT, Mode, Overflow, Pipeline, Restart, StageSpec, Wire};
use gridweave_runtime::ros::{GridPrefix, MapMetaData, OccupancyGrid};
use gridweave_runtime::stage::{
    AnyMessage, Context, InputPort, Out, Output, OutputPorts, Outputs, Parameters, PortType, Received, Registry,
    Source, StageError, StageKind,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::time::Duration;

pub const TEXT: PortType = PortType::Ros("std_msgs/msg/String");

#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TestParameters {
    pub count: u64,
    pub start: u64,
    pub step: u64,
    pub size: usize,
    pub large_every: u64,
    pub large_size: usize,
    pub both: bool,
    pub backwards: bool,
    pub keep_every: u64,
    pub keep: bool,
    pub stall: u64,
    pub fail: bool,
    pub fail_at_start: bool,
    pub panic: bool,
    pub abort_file: PathBuf,
}

impl Default for TestParameters {
    fn default() -> Self {
        Self {
            count: 100,
            start: 0,
            step: 1,
            size: 8,
            large_every: 0,
            large_size: 0,
            both: false,
            backwards: false,
            keep_every: 1,
            keep: false,
            stall: 0,
            fail: false,
            fail_at_start: false,
            panic: false,
            abort_file: PathBuf::new(),
        }
    }
}

impl Parameters for TestParameters {}

/// Random waits that vary the scheduling of threads. They are seeded, and must not change any result.
struct Stall {
    most: u64,
    state: u64,
}

impl Stall {
    fn wait(&mut self) {
        self.state = self.state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        if self.most > 0 && (self.state >> 60) == 0 {
            std::thread::sleep(Duration::from_micros((self.state >> 33) % self.most * 10));
        }
    }
}

struct Counter {
    parameters: TestParameters,
    next: u64,
    stall: Stall,
}

/// All numbers, and some of them.
struct Counted {
    a: Out<AnyMessage>,
    b: Out<AnyMessage>,
}

impl Outputs for Counted {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self { a: ports.encoded_output(TEXT, "a", "all"), b: ports.encoded_output(TEXT, "b", "some") }
    }
}

/// The received messages.
struct Passed(Out<AnyMessage>);

impl Outputs for Passed {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self(ports.encoded_output(TEXT, "out", "what came in"))
    }
}

impl Source for Counter {
    type Outputs = Counted;

    fn next(&mut self, output: &Output<Counted>) -> Result<bool, StageError> {
        let p = &self.parameters;
        if self.next == p.count {
            return Ok(false);
        }
        let number = self.next;
        self.next += 1;
        self.stall.wait();
        if p.fail && number == 50 {
            return Err(StageError::new("count", "on purpose"));
        }
        let time = p.start + p.step * if p.backwards { p.count - number } else { number };
        let size = if p.large_every > 0 && number.is_multiple_of(p.large_every) { p.large_size } else { p.size };
        let bytes: Vec<u8> = (0..size).map(|place| (number as usize * 31 + place) as u8).collect();
        let header = MessageHeader { log_time: LogTime(time), publish_time: number, ..Default::default() };
        output.set_log_time(LogTime(time));
        output.a.send_encoded(header, &bytes)?;
        if p.both && number.is_multiple_of(3) {
            output.b.send_encoded(header, &bytes)?;
        }
        Ok(true)
    }
}

struct Relay {
    parameters: TestParameters,
    seen: u64,
    stall: Stall,
}

impl Relay {
    fn new(parameters: TestParameters, context: &Context) -> Result<Self, StageError> {
        if parameters.fail_at_start {
            return Err(StageError::new("start", "on purpose"));
        }
        Ok(Self { stall: Stall { most: parameters.stall, state: context.seed }, parameters, seen: 0 })
    }
}

impl Relay {
    fn receive(&mut self, message: &Message, output: &Output<Passed>) -> Result<(), StageError> {
        self.seen += 1;
        self.stall.wait();
        if self.seen == 20 && self.parameters.fail {
            return Err(StageError::new("relay", "on purpose"));
        }
        assert!(!(self.seen == 20 && self.parameters.panic), "on purpose");
        if self.parameters.keep_every > 0 && self.seen.is_multiple_of(self.parameters.keep_every) {
            let mut bytes = message.bytes().to_vec();
            bytes.push(message.wire() as u8);
            output.0.send_encoded(*message.header(), &bytes)?;
        }
        Ok(())
    }

    fn finish(&mut self, output: &Output<Passed>) -> Result<(), StageError> {
        let header = MessageHeader { log_time: output.log_time(), ..Default::default() };
        output.0.send_encoded(header, &self.seen.to_le_bytes())
    }
}

struct Recorder {
    parameters: TestParameters,
    hash: u64,
    count: u64,
    kept: Vec<Message>,
    stall: Stall,
}

impl Recorder {
    fn add(&mut self, bytes: impl IntoIterator<Item = u8>) {
        for byte in bytes {
            self.hash = (self.hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3);
        }
    }
}

impl Recorder {
    fn receive(&mut self, message: &Message, _: &Output<()>) -> Result<(), StageError> {
        self.stall.wait();
        self.count += 1;
        self.add(message.header().log_time.0.to_le_bytes());
        self.add([message.wire() as u8]);
        self.add(message.bytes().to_vec());
        if self.parameters.keep {
            self.kept.push(message.clone());
        }
        Ok(())
    }

    fn finish(&mut self, output: &Output<()>) -> Result<(), StageError> {
        for message in std::mem::take(&mut self.kept) {
            self.add(message.bytes().to_vec());
        }
        output.count("messages", self.count);
        output.count("hash", self.hash);
        Ok(())
    }

    fn abort(&mut self, reason: &str) {
        if !self.parameters.abort_file.as_os_str().is_empty() {
            std::fs::write(&self.parameters.abort_file, reason).unwrap();
        }
    }
}

/// Writes messages in place and records their addresses.
struct Writer {
    size: usize,
    sent: u64,
}

struct Written(Out<OccupancyGrid<'static>>);

impl Outputs for Written {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self(ports.output("out", "grids"))
    }
}

impl Source for Writer {
    type Outputs = Written;

    fn next(&mut self, output: &Output<Written>) -> Result<bool, StageError> {
        let info = MapMetaData { width: self.size as u32, height: 1, ..Default::default() };
        output.set_log_time(LogTime(self.sent));
        output.0.send_grid("", &GridPrefix { info, ..Default::default() }, |blank| {
            let mut filled = blank.fill_with(7);
            note_place(filled.cells_mut(), output);
            Ok(filled)
        })?;
        self.sent += 1;
        Ok(self.sent < 5)
    }
}

/// Records the addresses of the cells that it reads.
fn read(_: &mut (), grid: Received<'_, OccupancyGrid<'_>>, output: &Output<()>) -> Result<(), StageError> {
    assert!(grid.cells().iter().all(|cell| *cell == 7));
    note_place(grid.cells(), output);
    Ok(())
}

/// Counts the addresses of messages: the sums are equal where the reader sees the memory that the writer has filled.
fn note_place<O>(cells: &[i8], output: &Output<O>) {
    output.count("places", cells.as_ptr() as u64 >> 4);
}

/// The kinds `writer`, `reader`, `counter`, `relay`, `filter` and `join` (a relay of one and of many), and `recorder`.
pub fn registry() -> Registry {
    let input = |many| InputPort { name: "in", port_type: TEXT, many, optional: false, summary: "anything" };
    let relay = |name, summary, many| {
        let kind = StageKind::stage(name, summary, Relay::new).encoded_input(input(many), Relay::receive);
        kind.finish(Relay::finish).build()
    };
    let recorder = |parameters: TestParameters, context: &Context| {
        let stall = Stall { most: parameters.stall, state: context.seed };
        Ok(Recorder { parameters, hash: 0x2325, count: 0, kept: Vec::new(), stall })
    };
    Registry::new([
        StageKind::source("counter", "Counts.", |parameters: TestParameters, context: &Context| {
            let stall = Stall { most: parameters.stall, state: context.seed };
            Ok(Counter { parameters, next: 0, stall })
        }),
        StageKind::source("writer", "Writes grids.", |parameters: TestParameters, _: &Context| {
            Ok(Writer { size: parameters.size, sent: 0 })
        }),
        StageKind::stage("reader", "Reads grids.", |_: TestParameters, _| Ok(())).input("in", "grids", read).build(),
        relay("relay", "Passes on.", false),
        relay("filter", "Passes some on.", false),
        relay("join", "Passes on what comes on any.", true),
        StageKind::stage("recorder", "Hashes.", recorder)
            .encoded_input(input(true), Recorder::receive)
            .finish(Recorder::finish)
            .abort(Recorder::abort)
            .build(),
    ])
}

/// A builder of pipelines, whose stages are added after those that feed them.
pub struct PipelineBuilder {
    registry: Registry,
    stages: Vec<StageSpec>,
}

impl PipelineBuilder {
    pub fn new(registry: Registry) -> Self {
        Self { registry, stages: Vec::new() }
    }

    pub fn stage(&mut self, name: &str, kind: &str, parameters: &str, inputs: &[&str]) {
        let kind = self.registry.get(kind).unwrap().clone();
        let inputs = inputs.iter().map(|input| {
            let (stage, port) = input.split_once('.').unwrap();
            let from_stage = self.stages.iter().position(|spec| spec.name == stage).unwrap();
            let outputs = &self.stages[from_stage].kind.outputs;
            Wire { port: 0, from_stage, from_port: outputs.iter().position(|output| output.name == port).unwrap() }
        });
        let inputs = inputs.collect();
        let topics = kind.outputs.iter().map(|output| format!("/{name}/{}", output.name)).collect();
        let parameters = parameters.parse().unwrap();
        let overflow = kind.outputs.iter().map(|_| Overflow::default()).collect();
        self.stages.push(StageSpec {
            name: name.into(),
            kind,
            parameters,
            inputs,
            topics,
            depth: 1,
            process: name.into(),
            overflow,
            restart: Restart::default(),
        });
    }

    pub fn build(&self, depth: usize) -> Pipeline {
        let mut stages = self.stages.clone();
        stages.iter_mut().for_each(|stage| stage.depth = depth);
        Pipeline {
            name: "test".into(),
            mode: Mode::Replay,
            reference: None,
            seed: 1,
            batch: depth > 2,
            stall_timeout: None,
            memory_limit: None,
            same_time_limit: DEFAULT_SAME_TIME_LIMIT,
            robots: Default::default(),
            initial_poses: Default::default(),
            stages,
        }
    }
}
