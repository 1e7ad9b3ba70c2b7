//! The latency of one hop between two processes by message size, and the throughput of small messages.
//!
//!     cargo bench -p gridweave-runtime --bench processes
//!
//! A hop is from the last byte written by the sender to the delivery of the message to the reader, including the
//! wake-up. The reference is bare iceoryx2 between two processes in the same run: the same payload, a listener.

// A bench that fails just stops.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use gridweave_runtime::engine::processes::{Launch, run, run_process};
use gridweave_runtime::link::monotonic_nanoseconds;
use gridweave_runtime::message::LogTime;
use gridweave_runtime::pipeline::{Overrides, Pipeline};
use gridweave_runtime::ros::{GridPrefix, MapMetaData, OccupancyGrid};
use gridweave_runtime::stage::{
    AnyMessage, Context, InputPort, Out, Output, OutputPorts, Outputs, Parameters, PortType, Registry, Source,
    StageError, StageKind,
};
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

const SIZES: [usize; 4] = [64, 64 << 10, 1 << 20, 16 << 20];
const HOPS: u64 = 100;
/// The number of runs of each kind, alternating: the result depends on the cores on which the kernel places the
/// processes.
const ROUNDS: usize = 9;
/// The pause between hops, after which the reader sleeps.
const PAUSE: Duration = Duration::from_millis(2);
const GRID: PortType = PortType::of::<OccupancyGrid<'static>>();
const SMALL: usize = 64;
const MANY: u64 = 300_000;
const DEPTH: usize = 64;

/// The size of the time of writing in the last bytes of a message.
fn stamp(bytes: &mut [u8]) {
    let end = bytes.len() - 8;
    bytes[end..].copy_from_slice(&monotonic_nanoseconds().to_le_bytes());
}

type Report = BTreeMap<String, u64>;

/// When each message was written and read, nanoseconds.
#[derive(Default)]
struct Times {
    first: u64,
    last: u64,
    hops: Vec<u64>,
}

impl Times {
    fn note(&mut self, bytes: &[u8]) {
        let now = monotonic_nanoseconds();
        let written = u64::from_le_bytes(bytes[bytes.len() - 8..].try_into().unwrap());
        if self.first == 0 {
            self.first = written;
        }
        self.last = now;
        self.hops.push(now.saturating_sub(written));
    }

    /// The number of messages, the median and the 99th percentile of their latencies in nanoseconds, and messages per
    /// second.
    fn report(&self) -> Report {
        let mut hops = self.hops.clone();
        hops.sort_unstable();
        let at = |share: f64| hops[((hops.len() - 1) as f64 * share) as usize];
        let rate = hops.len() as f64 / ((self.last - self.first) as f64 * 1e-9);
        [("count", hops.len() as u64), ("p50", at(0.5)), ("p99", at(0.99)), ("rate", rate as u64)]
            .map(|(what, number)| (what.to_owned(), number))
            .into()
    }
}

#[derive(Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
struct Load {
    size: usize,
    count: u64,
    pause: bool,
}

impl Parameters for Load {}

struct Writer(Load, u64);

struct Written {
    grids: Out<OccupancyGrid<'static>>,
    small: Out<AnyMessage>,
}

impl Outputs for Written {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self { grids: ports.output("grids", ""), small: ports.encoded_output(GRID, "small", "") }
    }
}

impl Source for Writer {
    type Outputs = Written;

    fn next(&mut self, output: &Output<Written>) -> Result<bool, StageError> {
        let Self(load, sent) = self;
        if load.pause {
            std::thread::sleep(PAUSE);
        }
        output.set_log_time(LogTime(*sent));
        if load.pause {
            let info = MapMetaData { width: load.size as u32, height: 1, ..Default::default() };
            output.grids.send_grid("", &GridPrefix { info, ..Default::default() }, |blank| {
                let mut filled = blank.fill_with(1);
                stamp(&mut filled);
                Ok(filled)
            })?;
        } else {
            let mut bytes = [1; SMALL];
            stamp(&mut bytes);
            output.small.send_bytes("", &bytes)?;
        }
        *sent += 1;
        Ok(*sent < load.count)
    }
}

fn registry() -> Registry {
    let input = InputPort { name: "in", port_type: GRID, many: false, optional: false, summary: "" };
    Registry::new([
        StageKind::source("writer", "", |load: Load, _: &Context| Ok(Writer(load, 0))),
        StageKind::stage("reader", "", |_: Load, _| Ok(Times::default()))
            .encoded_input(input, |times: &mut Times, message, _: &Output<()>| {
                times.note(message.bytes());
                Ok(())
            })
            .finish(|times, output| {
                let report = times.report();
                ["count", "p50", "p99", "rate"].into_iter().for_each(|what| output.count(what, report[what]));
                Ok(())
            })
            .build(),
    ])
}

/// The report of the reader of a pipeline of two processes.
fn pipeline(settings: &str, load: &str) -> Report {
    let port = if load.contains("pause") { "grids" } else { "small" };
    let text = format!(
        "[pipeline]\n{settings}\n[stages.a]\nkind = \"writer\"\n{load}\n[stages.b]\nkind = \"reader\"\ninputs = [\"a.{port}\"]\n"
    );
    let pipeline = Pipeline::parse("bench", &text, &registry(), &Overrides::default()).unwrap();
    let report = run(&pipeline, &Launch::this_program().unwrap().with("stage"), &()).unwrap();
    report.stages[1].counts.clone()
}

fn service(node: &Node<ipc::Service>, name: &str, depth: usize) -> Bare {
    let of = |what: &str| format!("bench/{name}/{what}");
    let data = node
        .service_builder(&of("data").as_str().try_into().unwrap())
        .publish_subscribe::<[u8]>()
        .enable_safe_overflow(false)
        .subscriber_max_buffer_size(depth)
        .open_or_create()
        .unwrap();
    let events = node.service_builder(&of("event").as_str().try_into().unwrap()).event().open_or_create().unwrap();
    Bare { data, events }
}

struct Bare {
    data: iceoryx2::service::port_factory::publish_subscribe::PortFactory<ipc::Service, [u8], ()>,
    events: iceoryx2::service::port_factory::event::PortFactory<ipc::Service>,
}

/// Bare iceoryx2: the process that reads. It prints a line when it is ready, and then its report.
fn bare_reader(name: &str, depth: usize, count: u64) {
    let node = NodeBuilder::new().create::<ipc::Service>().unwrap();
    let bare = service(&node, name, depth);
    let listener = bare.events.listener_builder().create().unwrap();
    let subscriber = bare.data.subscriber_builder().create().unwrap();
    subscriber.update_connections().unwrap();
    println!("ready");
    let mut times = Times::default();
    while (times.hops.len() as u64) < count {
        listener.timed_wait(|_| {}, Duration::from_secs(1)).unwrap();
        while let Some(sample) = subscriber.receive().unwrap() {
            times.note(sample.payload());
        }
    }
    println!("{}", serde_json::to_string(&times.report()).unwrap());
}

/// Bare iceoryx2 between this process, which sends, and another.
fn bare(name: &str, size: usize, depth: usize, count: u64, pause: bool) -> Report {
    let name = format!("{}_{name}", std::process::id());
    let node = NodeBuilder::new().create::<ipc::Service>().unwrap();
    let bare = service(&node, &name, depth);
    let publisher = bare
        .data
        .publisher_builder()
        .initial_max_slice_len(size)
        .backpressure_strategy(BackpressureStrategy::RetryUntilDelivered)
        .create()
        .unwrap();
    let notifier = bare.events.notifier_builder().create().unwrap();
    let mut reader = Command::new(std::env::current_exe().unwrap())
        .args(["bare", &name, &depth.to_string(), &count.to_string()])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(reader.stdout.take().unwrap()).lines();
    assert_eq!(lines.next().unwrap().unwrap(), "ready");
    for _ in 0..count {
        if pause {
            std::thread::sleep(PAUSE);
        }
        let mut sample = publisher.loan_slice(size).unwrap();
        sample.payload_mut().fill(1);
        stamp(sample.payload_mut());
        sample.send().unwrap();
        notifier.notify().unwrap();
    }
    let report = serde_json::from_str(&lines.next().unwrap().unwrap()).unwrap();
    reader.wait().unwrap();
    report
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments[1..] {
        ["stage", folder, process] => {
            let load = |path: &Path, registry: &Registry| {
                Pipeline::load(path, registry, &Overrides::default()).map_err(|errors| errors.render(false))
            };
            run_process(Path::new(folder), process, &registry(), load).unwrap();
        }
        ["bare", name, depth, count] => bare_reader(name, depth.parse().unwrap(), count.parse().unwrap()),
        _ => bench(),
    }
}

fn bench() {
    let number = |report: &Report, name: &str| report[name] as f64;
    println!("| message | bare iceoryx2, us (p99) | replay, us (p99) | ratio | live, us (p99) | ratio |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for size in SIZES {
        let load = format!("size = {size}\ncount = {HOPS}\npause = true");
        let mut rounds: [Vec<Report>; 3] = Default::default();
        for round in 0..ROUNDS {
            rounds[0].push(bare(&format!("{size}_{round}"), size, 2, HOPS, true));
            rounds[1].push(pipeline("batch = false\ndepth = 2", &load));
            rounds[2].push(pipeline("mode = \"live\"\ndepth = 2", &load));
        }
        let median = |reports: &[Report], name: &str| {
            let mut values: Vec<f64> = reports.iter().map(|report| number(report, name)).collect();
            values.sort_by(f64::total_cmp);
            values[values.len() / 2]
        };
        let [bare, replay, live] = rounds;
        let cell =
            |reports: &[Report]| format!("{:.1} ({:.0})", median(reports, "p50") * 1e-3, median(reports, "p99") * 1e-3);
        let ratio = |reports: &[Report]| format!("{:.2}", median(reports, "p50") / median(&bare, "p50"));
        println!(
            "| {size} B | {} | {} | {} | {} | {} |",
            cell(&bare),
            cell(&replay),
            ratio(&replay),
            cell(&live),
            ratio(&live)
        );
    }
    println!("\n| {SMALL} B, depth {DEPTH} | messages/s | x bare |");
    println!("| --- | --- | --- |");
    let load = format!("size = {SMALL}\ncount = {MANY}");
    let reference = bare("many", SMALL, DEPTH, MANY, false);
    let rows = [
        ("bare iceoryx2", reference.clone()),
        ("replay, in batches", pipeline(&format!("depth = {DEPTH}"), &load)),
        ("replay, one by one", pipeline(&format!("depth = {DEPTH}\nbatch = false"), &load)),
        ("live", pipeline(&format!("mode = \"live\"\ndepth = {DEPTH}"), &load)),
    ];
    for (name, report) in rows {
        assert_eq!(number(&report, "count"), MANY as f64, "{name}");
        let rate = number(&report, "rate");
        println!("| {name} | {rate:.0} | {:.2} |", rate / number(&reference, "rate"));
    }
}
