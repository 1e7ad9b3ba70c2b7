//! Processor time of an idle live pipeline, and latency from a map to the merged map.
//!
//!     GRIDWEAVE_LOGS=FOLDER cargo bench -p gridweave --bench live
//!
//! It starts `pipelines/live.toml` with a second sink, ten stages in all. Idle: the processor time of all its processes
//! over ten seconds, before and after messages were sent. Latency: `FOLDER/intel-2.mcap` (a simulated log, without a
//! folder) is played repeatedly; the time from when a map is sent on `robots.map` to when the merged map from it is
//! sent on `fuser.map`.

// A bench that cannot go on may panic.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use gridweave_runtime::engine::{RunningRun, WatchedLink, running_runs};
use gridweave_runtime::pipeline::{Overrides, Pipeline};
use gridweave_runtime::stage::Registry;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

const IDLE: Duration = Duration::from_secs(10);
const PLAY: Duration = Duration::from_secs(90);
/// Rate at which the log is played, relative to the recording.
const RATE: &str = "100";
const LIVE: &str = include_str!("../live.toml");

fn main() {
    let folder = tempfile::TempDir::new().unwrap();
    let log = match std::env::var_os("GRIDWEAVE_LOGS") {
        Some(logs) => Path::new(&logs).join("intel-2.mcap"),
        None => simulated(folder.path()),
    };
    let output = |name: &str| folder.path().join(name).display().to_string();
    let second =
        format!("\n[stages.second]\nkind = \"mcap_sink\"\nfile = \"{}\"\ninputs = [\"fuser.map\"]\n", output("b.mcap"));
    let text = LIVE.replace("kind = \"mcap_sink\"", &format!("kind = \"mcap_sink\"\nfile = \"{}\"", output("a.mcap")));
    std::fs::write(folder.path().join("ten.toml"), text + &second).unwrap();
    let supervisor = command(&["run", &output("ten.toml")]).spawn().unwrap();
    let run = find(&supervisor);
    sleep(Duration::from_secs(1));
    println!("| ten stages | share of one core |\n| --- | --- |");
    println!("| before anything was sent | {:.3} % |", idle(&run, supervisor.id()));
    let latencies = latencies(&run, &log);
    println!("| after the log was played | {:.3} % |", idle(&run, supervisor.id()));
    let at = |share: f64| latencies[((latencies.len() - 1) as f64 * share) as usize] * 1e3;
    let name = log.file_stem().unwrap().to_string_lossy();
    println!(
        "\n| log | maps that led to a merged one | p50, ms | p95, ms | p99, ms | most, ms |\n| --- | --- | --- | --- | --- | --- |"
    );
    println!(
        "| {name}, {RATE} x | {} | {:.1} | {:.1} | {:.1} | {:.1} |",
        latencies.len(),
        at(0.5),
        at(0.95),
        at(0.99),
        at(1.0)
    );
    interrupt(supervisor);
}

fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gridweave"));
    command.args(arguments).stdout(Stdio::null()).stderr(Stdio::null());
    command
}

fn simulated(folder: &Path) -> PathBuf {
    let log = folder.join("simulated.mcap");
    assert!(command(&["simulate", "-o", &log.display().to_string(), "--robots", "2"]).status().unwrap().success());
    log
}

/// Finds the run that a process supervises.
fn find(supervisor: &Child) -> RunningRun {
    let prefix = format!("gw{}_", supervisor.id());
    loop {
        match running_runs().unwrap_or_default().into_iter().find(|run| run.prefix.starts_with(&prefix)) {
            Some(run) => return run,
            None => sleep(Duration::from_millis(20)),
        }
    }
}

fn interrupt(mut program: Child) {
    assert!(Command::new("kill").args(["-INT", &program.id().to_string()]).status().unwrap().success());
    program.wait().unwrap();
}

/// Measures the share of one core that all processes of a run take, percent.
fn idle(run: &RunningRun, supervisor: u32) -> f64 {
    let (before, start) = (ticks(run, supervisor), Instant::now());
    sleep(IDLE);
    (ticks(run, supervisor) - before) as f64 / start.elapsed().as_secs_f64()
}

/// Processor time of all processes of a run, hundredths of a second.
fn ticks(run: &RunningRun, supervisor: u32) -> u64 {
    let folder = run.folder.display().to_string();
    let processes = std::fs::read_dir("/proc").unwrap().flatten();
    let of_process = |process: std::fs::DirEntry| {
        let id: u32 = process.file_name().to_str()?.parse().ok()?;
        let line = String::from_utf8_lossy(&std::fs::read(process.path().join("cmdline")).ok()?).into_owned();
        if id != supervisor && !line.split('\0').any(|word| word == folder) {
            return None;
        }
        let stat = std::fs::read_to_string(process.path().join("stat")).ok()?;
        // The state and the numbers follow the name, which may contain any character.
        let fields: Vec<&str> = stat.rsplit(')').next()?.split_whitespace().collect();
        Some(fields.get(11)?.parse::<u64>().ok()? + fields.get(12)?.parse::<u64>().ok()?)
    };
    processes.filter_map(of_process).sum()
}

/// Plays the log, and returns the latencies from each map to the merged one, seconds, sorted.
fn latencies(run: &RunningRun, log: &Path) -> Vec<f64> {
    let registry = Registry::new(gridweave_logs::kinds().into_iter().chain(gridweave_stages::kinds()));
    let pipeline = Pipeline::load(&run.pipeline(), &registry, &Overrides::default()).unwrap();
    let watch = |stage: &str, port: &str| {
        let place = pipeline.stages.iter().position(|spec| spec.name == stage).unwrap();
        let ports = &pipeline.stages[place].kind.outputs;
        let port = ports.iter().position(|output| output.name == port).unwrap();
        WatchedLink::open(run, &pipeline, place, port).unwrap()
    };
    let (mut maps, mut merged) = (watch("robots", "map"), watch("fuser", "map"));
    let player = command(&["play", &log.display().to_string(), "--rate", RATE, "--loop", "--run", &run.prefix]);
    let player = { player }.spawn().unwrap();
    let (mut sent, mut latencies, start) = (BTreeMap::new(), Vec::new(), Instant::now());
    while start.elapsed() < PLAY {
        maps.take(|sample, message| {
            sent.insert(message.header().log_time, sample.sent_at);
        })
        .unwrap();
        merged
            .take(|sample, message| {
                // Only the first of several merged maps from one map counts.
                if let Some(since) = sent.remove(&message.header().log_time) {
                    latencies.push((sample.sent_at - since) as f64 * 1e-9);
                }
            })
            .unwrap();
        sleep(Duration::from_millis(2));
    }
    interrupt(player);
    latencies.sort_by(f64::total_cmp);
    latencies
}
