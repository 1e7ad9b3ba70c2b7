//! The latency of one hop between two stages by message size: from the last byte written by the sender to the delivery
//! of the message to the reader, including the wake-up.
//!
//!     cargo bench -p gridweave-runtime --bench hop
//!
//! The reference is bare iceoryx2 in the same run: the same payload, a listener, two threads. A hop that copied would
//! grow with the size; one that does not costs the same for 64 B and 16 MiB.

// A bench that fails just stops.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use gridweave_runtime::engine::{EngineKind, run};
use gridweave_runtime::message::LogTime;
use gridweave_runtime::pipeline::{DEFAULT_SAME_TIME_LIMIT, Mode, Overflow, Pipeline, Restart, StageSpec, Wire};
use gridweave_runtime::ros::{GridPrefix, MapMetaData, OccupancyGrid};
use gridweave_runtime::stage::{
    Context, Out, Output, OutputPorts, Outputs, Parameters, Received, Source, StageError, StageKind,
};
use iceoryx2::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

const SIZES: [usize; 4] = [64, 64 << 10, 1 << 20, 16 << 20];
const HOPS: u64 = 300;

/// The times of writing, the number of messages read, and the latencies.
#[derive(Default)]
struct Clock {
    written: Mutex<Option<Instant>>,
    read: AtomicU64,
    hops: Mutex<Vec<Duration>>,
}

impl Clock {
    fn note_written(&self) {
        *self.written.lock().unwrap() = Some(Instant::now());
    }

    fn note_read(&self) {
        let hop = self.written.lock().unwrap().unwrap().elapsed();
        self.hops.lock().unwrap().push(hop);
        self.read.fetch_add(1, Ordering::Release);
    }

    /// Waits until the reader has received `count` messages and sleeps again.
    fn wait_for(&self, count: u64) {
        while self.read.load(Ordering::Acquire) < count {
            std::thread::yield_now();
        }
        std::thread::sleep(Duration::from_micros(300));
    }

    fn median(&self) -> f64 {
        let mut hops = self.hops.lock().unwrap().clone();
        hops.sort();
        hops[hops.len() / 2].as_secs_f64() * 1e6
    }
}

#[derive(Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
struct Size {
    size: usize,
}

impl Parameters for Size {}

struct Writer {
    clock: Arc<Clock>,
    size: usize,
    sent: u64,
}

struct Written(Out<OccupancyGrid<'static>>);

impl Outputs for Written {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self(ports.output("out", ""))
    }
}

impl Source for Writer {
    type Outputs = Written;

    fn next(&mut self, output: &Output<Written>) -> Result<bool, StageError> {
        self.clock.wait_for(self.sent);
        let info = MapMetaData { width: self.size as u32, height: 1, ..Default::default() };
        output.set_log_time(LogTime(self.sent));
        output.0.send_grid("", &GridPrefix { info, ..Default::default() }, |blank| {
            let filled = blank.fill_with(1);
            self.clock.note_written();
            Ok(filled)
        })?;
        self.sent += 1;
        Ok(self.sent < HOPS)
    }
}

struct Reader(Arc<Clock>);

impl Reader {
    fn receive(&mut self, _: Received<'_, OccupancyGrid<'_>>, _: &Output<()>) -> Result<(), StageError> {
        self.0.note_read();
        Ok(())
    }
}

/// The median of a hop of a pipeline, microseconds.
fn pipeline_hop(size: usize, engine: EngineKind) -> f64 {
    let clock = Arc::new(Clock::default());
    let (writer, reader) = (Arc::clone(&clock), Arc::clone(&clock));
    let source = StageKind::source("writer", "", move |parameters: Size, _: &Context| {
        Ok(Writer { clock: Arc::clone(&writer), size: parameters.size, sent: 0 })
    });
    let sink = StageKind::stage("reader", "", move |_: Size, _| Ok(Reader(Arc::clone(&reader))));
    let sink = sink.input("in", "", Reader::receive).build();
    let spec = |name: &str, kind: StageKind, inputs: Vec<Wire>| StageSpec {
        name: name.into(),
        topics: kind.outputs.iter().map(|_| "/out".into()).collect(),
        overflow: kind.outputs.iter().map(|_| Overflow::default()).collect(),
        kind,
        parameters: format!("size = {size}").parse().unwrap(),
        inputs,
        depth: 2,
        process: name.into(),
        restart: Restart::default(),
    };
    let stages =
        vec![spec("writer", source, vec![]), spec("reader", sink, vec![Wire { port: 0, from_stage: 0, from_port: 0 }])];
    let pipeline = Pipeline {
        name: "hop".into(),
        mode: Mode::Replay,
        reference: None,
        seed: 0,
        batch: false,
        stall_timeout: None,
        memory_limit: None,
        same_time_limit: DEFAULT_SAME_TIME_LIMIT,
        robots: Default::default(),
        initial_poses: Default::default(),
        stages,
    };
    run(&pipeline, engine, &()).unwrap();
    clock.median()
}

/// The median of a hop of bare iceoryx2 between two threads, microseconds.
fn bare_hop<S: iceoryx2::service::Service>(size: usize) -> f64 {
    let clock = Arc::new(Clock::default());
    let names = |what: &str| format!("hop/{}/{size}/{what}", std::process::id());
    let events = |node: &Node<S>| {
        node.service_builder(&names("event").as_str().try_into().unwrap()).event().open_or_create().unwrap()
    };
    let data = |node: &Node<S>| {
        node.service_builder(&names("data").as_str().try_into().unwrap())
            .publish_subscribe::<[u8]>()
            .enable_safe_overflow(false)
            .open_or_create()
            .unwrap()
    };
    let ready = AtomicU64::new(0);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let node = NodeBuilder::new().create::<S>().unwrap();
            let listener = events(&node).listener_builder().create().unwrap();
            let subscriber = data(&node).subscriber_builder().create().unwrap();
            ready.store(1, Ordering::Release);
            let mut count = 0;
            while count < HOPS {
                listener.timed_wait(|_| {}, Duration::from_secs(1)).unwrap();
                while let Some(sample) = subscriber.receive().unwrap() {
                    clock.note_read();
                    count += 1;
                    drop(sample);
                }
            }
        });
        let node = NodeBuilder::new().create::<S>().unwrap();
        let notifier = events(&node).notifier_builder().create().unwrap();
        let publisher = data(&node).publisher_builder().initial_max_slice_len(size).create().unwrap();
        while ready.load(Ordering::Acquire) == 0 {
            std::thread::yield_now();
        }
        for sent in 0..HOPS {
            clock.wait_for(sent);
            let mut sample = publisher.loan_slice(size).unwrap();
            sample.payload_mut().fill(1);
            clock.note_written();
            sample.send().unwrap();
            notifier.notify().unwrap();
        }
        clock.wait_for(HOPS);
    });
    clock.median()
}

fn main() {
    println!("| message | bare iceoryx2, us | threads, us | ratio | threads-ipc, us | bare ipc, us | ratio |");
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    for size in SIZES {
        let (bare, own) = (bare_hop::<local::Service>(size), pipeline_hop(size, EngineKind::Threads));
        let (bare_ipc, own_ipc) = (bare_hop::<ipc::Service>(size), pipeline_hop(size, EngineKind::ThreadsIpc));
        println!(
            "| {size} B | {bare:.1} | {own:.1} | {:.2} | {own_ipc:.1} | {bare_ipc:.1} | {:.2} |",
            own / bare,
            own_ipc / bare_ipc
        );
    }
}
