//! Costs of a stage in Python compared with one in Rust that does the same: maps in, the same maps out.
//!
//!     cargo bench -p gridweave-stages --bench python_stage
//!
//! `python3` in PATH, or what `GRIDWEAVE_PYTHON` names, must have the package of `pipelines/python`.
//!
//! - Through a pipeline of a source, the stage and a sink, on the engine `threads`: how long a message takes from the
//!   source to the sink where the next is sent only then, and how many a second go through where the source sends as
//!   fast as it can.
//! - The call alone, without links.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

use gridweave_runtime::engine::{EngineKind, run};
use gridweave_runtime::message::LogTime;
use gridweave_runtime::pipeline::{DEFAULT_SAME_TIME_LIMIT, Mode, Overflow, Pipeline, Restart, StageSpec, Wire};
use gridweave_runtime::ros::{MapMetaData, OccupancyGrid, encode};
use gridweave_runtime::stage::{
    Context, Out, Output, OutputPorts, Outputs, Received, Source, StageError, StageHarness, StageKind,
};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

const MODULE: &str = "
from gridweave import stage
from gridweave.msg.nav_msgs import OccupancyGrid

@stage
def same(map: OccupancyGrid) -> OccupancyGrid:
    return map

@stage
def nothing(map: OccupancyGrid) -> OccupancyGrid | None:
    return None
";
/// The cells of the maps that the call alone is measured with.
const CELLS: [usize; 4] = [64, 64 << 10, 1 << 20, 16 << 20];
/// For so long each is measured.
const TIME: Duration = Duration::from_secs(3);
/// The messages that go through a pipeline: their cells, how many go one by one, and how many as fast as they can.
const MESSAGES: [(usize, u64, u64); 3] = [(0, 2000, 20_000), (10_000, 2000, 20_000), (1_000_000, 1000, 4000)];
/// At first nothing is warm.
const WARM_UP: usize = 100;

fn bytes_of(cells: usize) -> Vec<u8> {
    let data = vec![0; cells];
    let info = MapMetaData { width: cells as u32, height: 1, resolution: 0.05, ..Default::default() };
    encode(&OccupancyGrid { header: Default::default(), info, data: &data }).unwrap()
}

/// A stage: its kind, and its parameters.
type Stage = (StageKind, toml::Table);

/// A stage of the module.
fn in_python(file: &Path, name: &str) -> Stage {
    let module = format!("{}:{name}", file.display());
    let given = [("module".to_owned(), module.into())].into_iter().collect();
    let asked = gridweave_stages::python_stage::kind().resolve(&given, Path::new("")).unwrap().unwrap();
    (asked.kind.clone(), asked.parameters)
}

/// One in Rust that decodes a map and encodes it, as those in Python do.
fn in_rust() -> Stage {
    let kind = StageKind::stage("same", "", |(), _: &Context| Ok(())).input(
        "map",
        "",
        |_, map: Received<'_, OccupancyGrid<'_>>, output: &Output<Maps>| output.0.send(map.robot(), &map),
    );
    (kind.build(), toml::Table::new())
}

struct Maps(Out<OccupancyGrid<'static>>);

impl Outputs for Maps {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self(ports.output("out", ""))
    }
}

/// When the last message was sent, and when each was received.
#[derive(Default)]
struct Clock {
    sent: Mutex<Option<Instant>>,
    received: Mutex<Vec<(Instant, Duration)>>,
    count: AtomicU64,
}

struct Sender {
    clock: Arc<Clock>,
    bytes: Vec<u8>,
    one_by_one: bool,
    sent: u64,
    count: u64,
}

impl Source for Sender {
    type Outputs = Maps;

    fn next(&mut self, output: &Output<Maps>) -> Result<bool, StageError> {
        if self.one_by_one {
            while self.clock.count.load(Ordering::Acquire) < self.sent {
                std::thread::yield_now();
            }
            // All that wait for the next sleep by then.
            std::thread::sleep(Duration::from_micros(300));
        }
        self.sent += 1;
        output.set_log_time(LogTime(self.sent));
        *self.clock.sent.lock().unwrap() = Some(Instant::now());
        output.0.send_bytes("robot1", &self.bytes)?;
        Ok(self.sent < self.count)
    }
}

struct Receiver(Arc<Clock>);

impl Receiver {
    fn receive(&mut self, _: Received<'_, OccupancyGrid<'_>>, _: &Output<()>) -> Result<(), StageError> {
        let now = Instant::now();
        let sent = self.0.sent.lock().unwrap().unwrap();
        self.0.received.lock().unwrap().push((now, now - sent));
        self.0.count.fetch_add(1, Ordering::Release);
        Ok(())
    }
}

/// Sends `count` messages through a stage. When each was received, and how long after one was sent.
fn through((kind, parameters): &Stage, bytes: &[u8], one_by_one: bool, count: u64) -> Vec<(Instant, Duration)> {
    let clock = Arc::new(Clock::default());
    let (sends, receives, bytes) = (Arc::clone(&clock), Arc::clone(&clock), bytes.to_vec());
    let source = StageKind::source("sender", "", move |(), _: &Context| {
        Ok(Sender { clock: Arc::clone(&sends), bytes: bytes.clone(), one_by_one, sent: 0, count })
    });
    let sink = StageKind::stage("receiver", "", move |(), _: &Context| Ok(Receiver(Arc::clone(&receives))));
    let sink = sink.input("in", "", Receiver::receive).build();
    let spec = |name: &str, kind: &StageKind, parameters: &toml::Table, from: Option<usize>| StageSpec {
        name: name.into(),
        topics: kind.outputs.iter().map(|_| "/out".into()).collect(),
        overflow: kind.outputs.iter().map(|_| Overflow::default()).collect(),
        kind: kind.clone(),
        parameters: parameters.clone(),
        inputs: from.map(|from_stage| Wire { port: 0, from_stage, from_port: 0 }).into_iter().collect(),
        depth: 64,
        process: name.into(),
        restart: Restart::default(),
    };
    let none = toml::Table::new();
    let stages = vec![
        spec("sender", &source, &none, None),
        spec("same", kind, parameters, Some(0)),
        spec("receiver", &sink, &none, Some(1)),
    ];
    let pipeline = Pipeline {
        name: "same".into(),
        mode: Mode::Replay,
        reference: None,
        seed: 0,
        batch: !one_by_one,
        stall_timeout: None,
        memory_limit: None,
        same_time_limit: DEFAULT_SAME_TIME_LIMIT,
        robots: Default::default(),
        initial_poses: Default::default(),
        stages,
    };
    run(&pipeline, EngineKind::Threads, &()).unwrap();
    std::mem::take(&mut *clock.received.lock().unwrap())
}

/// Microseconds that a share of all times is not above.
fn at(times: &mut [Duration], share: f64) -> f64 {
    times.sort();
    times[((times.len() - 1) as f64 * share) as usize].as_secs_f64() * 1e6
}

fn through_pipelines(file: &Path) {
    println!(
        "| message, B | stage in | p50, us | p99, us | messages/s | MB/s |\n| --- | --- | --- | --- | --- | --- |"
    );
    for (cells, one_by_one, fast) in MESSAGES {
        let bytes = bytes_of(cells);
        for (language, stage) in [("Rust", in_rust()), ("Python", in_python(file, "same"))] {
            let received = through(&stage, &bytes, true, one_by_one);
            let mut times: Vec<Duration> = received.into_iter().skip(WARM_UP).map(|(_, time)| time).collect();
            let received = through(&stage, &bytes, false, fast);
            let [(first, _), .., (last, _)] = received[WARM_UP..] else { unreachable!("there are more") };
            let per_second = (received.len() - WARM_UP - 1) as f64 / (last - first).as_secs_f64();
            println!(
                "| {} | {language} | {:.0} | {:.0} | {per_second:.0} | {:.0} |",
                bytes.len(),
                at(&mut times, 0.5),
                at(&mut times, 0.99),
                per_second * bytes.len() as f64 * 1e-6
            );
        }
    }
}

fn calls_alone(file: &Path) {
    println!("| cells | stage | calls/s | p50, us | p99, us |\n| --- | --- | --- | --- | --- |");
    for (cells, name) in CELLS.iter().flat_map(|cells| [(*cells, "nothing"), (*cells, "same")]) {
        let (kind, parameters) = in_python(file, name);
        let mut stage = StageHarness::new(&kind, &parameters.to_string()).unwrap();
        let bytes = bytes_of(cells);
        let mut times = Vec::new();
        let begin = Instant::now();
        for number in 0.. {
            // What a message costs before it is given is not that of the call.
            let message = bytes.clone();
            let start = Instant::now();
            stage.give_bytes("map", "robot1", LogTime(number), message).unwrap();
            times.push(start.elapsed());
            assert_eq!(stage.take_messages("out").len(), usize::from(name == "same"));
            if begin.elapsed() > TIME && times.len() > 2 * WARM_UP {
                break;
            }
        }
        times.drain(..WARM_UP);
        let per_second = times.len() as f64 / times.iter().sum::<Duration>().as_secs_f64();
        println!("| {cells} | {name} | {per_second:.0} | {:.0} | {:.0} |", at(&mut times, 0.5), at(&mut times, 0.99));
    }
}

fn main() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("bench.py");
    std::fs::write(&file, MODULE).unwrap();
    through_pipelines(&file);
    println!();
    calls_alone(&file);
}
