//! `gridweave top`: shows rates, queues and latencies of the stages of a run, redrawn in place.

use super::INTERRUPT_INTERVAL;
use super::other_machines::{Machine, OtherMachines};
use super::running::{RunChoice, Running, find_run};
use crate::interrupt::stop_on_interrupt;
use crate::status::{BadUse, Status};
use crate::table::Table;
use crate::terminal::{eprint_line, print, print_line, print_on_cleared_terminal, width};
use anyhow::Result;
use clap::Args;
use gridweave_runtime::engine::{memory_of_process, watch_stages};
use gridweave_runtime::link::Histogram;
use gridweave_runtime::link::{StageCounter, StageCounters, StageState, WireCounter};
use gridweave_runtime::pipeline::{Mode, Pipeline, Wire};
use gridweave_runtime::ros::StageProgress;
use gridweave_runtime::stage::Registry;
use serde_json::{Value, json};
use std::io::IsTerminal;
use std::sync::atomic::Ordering;
use std::thread;
use std::time::{Duration, Instant};

/// Arguments of `gridweave top`.
#[derive(Debug, Args)]
pub(crate) struct TopArgs {
    /// Measure and print one interval, and end.
    #[arg(long)]
    pub(crate) once: bool,
    /// Print JSON, an object for each interval.
    #[arg(long)]
    pub(crate) json: bool,
    /// Seconds from one measurement to the next.
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0)]
    pub(crate) interval: f64,
    #[command(flatten)]
    pub(crate) run: RunChoice,
}

/// Shows the stages until the run ends or the user interrupts it.
pub(crate) fn top(args: &TopArgs, registry: &Registry) -> Result<Status> {
    let interval = Duration::try_from_secs_f64(args.interval).ok().filter(|interval| !interval.is_zero());
    let Some(interval) = interval else { return Err(BadUse("--interval must be above 0 s".to_owned()).into()) };
    let running = find_run(&args.run, registry)?;
    let stop = stop_on_interrupt("the display ends");
    let counters = watch_stages(&running.run, &running.pipeline)?;
    let mut others = OtherMachines::watch(&running);
    let look = || counters.iter().map(Snapshot::new).collect::<Vec<_>>();
    let is_redrawn = std::io::stdout().is_terminal() && !args.once && !args.json;
    let (mut before, mut since) = (look(), Instant::now());
    loop {
        while since.elapsed() < interval && !stop.load(Ordering::Relaxed) && running.run.is_running() {
            thread::sleep(INTERRUPT_INTERVAL.min(interval));
        }
        if stop.load(Ordering::Relaxed) {
            return Ok(Status::Done);
        }
        let is_over = !running.run.is_running();
        let now = look();
        others.update()?;
        let stages = rates(&running.pipeline, &before, &now, since.elapsed().as_secs_f64());
        let is_read = match args.json {
            true => print_line(to_json(&running, &stages, &others))?,
            false if is_redrawn => print_on_cleared_terminal(to_text(&running, &stages, &others, is_redrawn))?,
            false => print(to_text(&running, &stages, &others, is_redrawn))?,
        };
        if is_over {
            eprint_line("the run has ended");
        }
        if args.once || is_over || !is_read {
            return Ok(Status::Done);
        }
        (before, since) = (now, Instant::now());
    }
}

/// Counters of a stage at one moment.
#[derive(Clone, Debug)]
struct Snapshot {
    state: StageState,
    process: u64,
    messages_in: u64,
    sent: Vec<u64>,
    busy: u64,
    restarts: u64,
    warnings: u64,
    /// For each wire: messages taken, dropped, and waiting in the stage.
    wires: Vec<[u64; 3]>,
    latency: Histogram,
}

impl Snapshot {
    fn new(counters: &StageCounters) -> Self {
        let wire = |wire: usize| {
            [WireCounter::Taken, WireCounter::Dropped, WireCounter::Waiting]
                .map(|number| counters.get_wire(wire, number))
        };
        Self {
            state: counters.state(),
            process: counters.get(StageCounter::Process),
            messages_in: counters.get(StageCounter::MessagesIn),
            sent: (0..counters.ports()).map(|port| counters.sent(port)).collect(),
            busy: counters.get(StageCounter::Busy),
            restarts: counters.get(StageCounter::Restarts),
            warnings: counters.get(StageCounter::Warnings),
            wires: (0..counters.wires()).map(wire).collect(),
            latency: counters.latency(),
        }
    }
}

/// Rates of a stage in an interval.
#[derive(Clone, Debug)]
struct StageRates {
    name: String,
    state: &'static str,
    messages_in: u64,
    messages_out: u64,
    /// Messages a second.
    rate_in: f64,
    rate_out: f64,
    queue: u64,
    dropped: u64,
    /// Latencies from the sending of a message to its handling: percentiles 50, 95 and 99, seconds.
    latency: [Option<f64>; 3],
    /// Share of the time in which the stage works, 0 to 1.
    busy: f64,
    /// Bytes.
    memory: Option<u64>,
    restarts: u64,
    warnings: u64,
}

fn rates(pipeline: &Pipeline, before: &[Snapshot], now: &[Snapshot], seconds: f64) -> Vec<StageRates> {
    let sent_on =
        |wire: &Wire| now.get(wire.from_stage).and_then(|from| from.sent.get(wire.from_port)).copied().unwrap_or(0);
    let stages = pipeline.stages.iter().zip(before.iter().zip(now));
    let rates = stages.map(|(spec, (before, now))| {
        let out = |snapshot: &Snapshot| snapshot.sent.iter().sum::<u64>();
        let rate = |before: u64, now: u64| now.saturating_sub(before) as f64 / seconds;
        let wires = spec.inputs.iter().zip(&now.wires);
        let queue = wires.map(|(wire, [taken, dropped, waiting])| match pipeline.mode {
            Mode::Replay => *waiting,
            Mode::Live => waiting + sent_on(wire).saturating_sub(taken + dropped),
        });
        let latency = now.latency.since(&before.latency);
        StageRates {
            name: spec.name.clone(),
            state: now.state.name(),
            messages_in: now.messages_in,
            messages_out: out(now),
            rate_in: rate(before.messages_in, now.messages_in),
            rate_out: rate(out(before), out(now)),
            queue: queue.sum(),
            dropped: now.wires.iter().map(|[_, dropped, _]| dropped).sum(),
            latency: [0.5, 0.95, 0.99].map(|share| latency.quantile(share)),
            busy: (rate(before.busy, now.busy) * 1e-9).min(1.0),
            memory: u32::try_from(now.process)
                .ok()
                .filter(|_| now.state == StageState::Running)
                .and_then(memory_of_process),
            restarts: now.restarts,
            warnings: now.warnings,
        }
    });
    rates.collect()
}

fn to_json(running: &Running, stages: &[StageRates], others: &OtherMachines) -> Value {
    let stage = |stage: &StageRates| {
        json!({
            "name": stage.name,
            "state": stage.state,
            "messages_in": stage.messages_in,
            "messages_out": stage.messages_out,
            "in_per_s": stage.rate_in,
            "out_per_s": stage.rate_out,
            "queue": stage.queue,
            "dropped": stage.dropped,
            "latency_s": { "p50": stage.latency[0], "p95": stage.latency[1], "p99": stage.latency[2] },
            "busy": stage.busy,
            "memory": stage.memory,
            "restarts": stage.restarts,
            "warnings": stage.warnings,
        })
    };
    json!({
        "run": running.run.prefix,
        "pipeline": running.pipeline.name,
        "stages": stages.iter().map(stage).collect::<Vec<_>>(),
        "machines": others.machines().map(|machine| machine_to_json(&machine)).collect::<Vec<_>>(),
    })
}

fn machine_to_json(machine: &Machine<'_>) -> Value {
    json!({
        "machine": machine.report.machine,
        "silent_s": machine.silent.map(|silent| silent.as_secs_f64()),
        "stages": machine.report.stages,
    })
}

/// Columns of the display, and those that a narrow terminal is not shown, the least important first.
const HEADS: [&str; 14] = [
    "MACHINE", "STAGE", "STATE", "IN/S", "OUT/S", "QUEUE", "DROPPED", "P50 MS", "P95 MS", "P99 MS", "BUSY", "MB",
    "STARTS", "WARNINGS",
];
const LEFT_OUT_FIRST: [&str; 8] = ["P50 MS", "P99 MS", "MB", "OUT/S", "STATE", "STARTS", "WARNINGS", "P95 MS"];

/// Name of this machine, where there are others.
const HERE: &str = "(here)";
/// An unknown value.
const UNKNOWN: &str = "-";

/// Formats the display. On a terminal where it is redrawn each stage has one line, and columns that do not fit are left
/// out.
fn to_text(running: &Running, stages: &[StageRates], others: &OtherMachines, is_redrawn: bool) -> String {
    // Without other machines, the column of machines is left out.
    let hidden = usize::from(others.machines().next().is_none());
    let mut table = Table::new(HEADS.into_iter().skip(hidden));
    for stage in stages {
        let milliseconds =
            |seconds: Option<f64>| seconds.map_or_else(|| UNKNOWN.to_owned(), |time| format!("{:.2}", time * 1e3));
        let [p50, p95, p99] = stage.latency.map(milliseconds);
        let cells = [
            HERE.to_owned(),
            stage.name.clone(),
            stage.state.to_owned(),
            format!("{:.1}", stage.rate_in),
            format!("{:.1}", stage.rate_out),
            stage.queue.to_string(),
            stage.dropped.to_string(),
            p50,
            p95,
            p99,
            format!("{:.1} %", stage.busy * 100.0),
            stage.memory.map_or_else(|| UNKNOWN.to_owned(), |bytes| format!("{:.1}", bytes as f64 * 1e-6)),
            (stage.restarts + u64::from(stage.state != "absent")).to_string(),
            stage.warnings.to_string(),
        ];
        table.row(cells.into_iter().skip(hidden));
    }
    for machine in others.machines() {
        machine.report.stages.iter().for_each(|stage| table.row(of_other_machine(&machine, stage)));
    }
    let width = width();
    if let Some(width) = width.filter(|_| is_redrawn) {
        table.narrow_to(width, &LEFT_OUT_FIRST);
    }
    format!("{}\n{}", running.name(), table.fit(width))
}

/// Makes the row of a stage on another machine, in the columns of [`HEADS`].
fn of_other_machine(machine: &Machine<'_>, stage: &StageProgress) -> [String; 14] {
    let state = match machine.silent {
        Some(silent) => format!("silent {} s", silent.as_secs()),
        None => stage.state.clone(),
    };
    let unknown = || UNKNOWN.to_owned();
    [
        machine.report.machine.clone(),
        stage.name.clone(),
        state,
        format!("{:.1}", stage.in_per_s),
        format!("{:.1}", stage.out_per_s),
        unknown(),
        stage.dropped.to_string(),
        unknown(),
        unknown(),
        unknown(),
        format!("{:.1} %", stage.busy * 100.0),
        unknown(),
        (stage.restarts + u64::from(stage.state != StageState::Absent.name())).to_string(),
        stage.warnings.to_string(),
    ]
}
