//! A fleet of simulated robots, each with a bridge to a base that merges their maps: how much goes over the network,
//! how long it takes from a robot's map to the merged map, what the base needs, and what it drops.
//!
//!     cargo run --release --example fleet -- measure 4,8,16,32,64 fleet.csv
//!     cargo run --release --example fleet -- floors 16 floors.csv      # two bases, and one above that merges theirs
//!     cargo run --release --example fleet -- plot fleet.csv fleet.svg
//!
//! Each robot sends a pose ten times a second and a map every five seconds for a minute. Everything runs on one
//! machine: give the robots, which are threads here, less of it with `nice`. Any other arguments are those of the
//! command `gridweave-ros`, which this program is, too, for the bases that it starts.

use anyhow::{Context as _, Result, bail};
use gridweave_runtime::message::{FixedText, LogTime, Message, MessageFlags, MessageHeader};
use gridweave_runtime::ros::{OccupancyGrid, PoseWithCovarianceStamped, RosMessage, TagRange};
use gridweave_runtime::stage::{Context, InputWire, Registry, StageHarness};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

#[allow(dead_code)]
#[path = "../../../tests/experiments/plot.rs"]
mod plot;

/// How long the robots drive, seconds.
const DURATION: u32 = 60;
/// A map every five seconds.
const MAPS: u32 = DURATION / 5;
/// After the last message the base gets so long to finish.
const AFTERWARDS: Duration = Duration::from_secs(20);
/// The columns of the table.
const HEAD: &str = "robots,bases,sent_mb,messages_mb,kbit_per_s_robot,maps_sent,merged_maps,latency_p50_s,latency_p95_s,cells_known,\
                    memory_mb,busy_stages,dropped_on_the_way,dropped_in_the_base";

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = args.iter().map(String::as_str).collect();
    let result = match words.as_slice() {
        ["measure", robots, file] => measure_all(robots, 1, Path::new(file)),
        ["floors", robots, file] => measure_all(robots, 2, Path::new(file)),
        ["plot", from, to] => draw(Path::new(from), Path::new(to)),
        _ => return gridweave::command(gridweave_ros::kinds()),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let _ = writeln!(std::io::stderr(), "error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn measure_all(robots: &str, floors: usize, file: &Path) -> Result<()> {
    let mut table = format!("{HEAD}\n");
    for robots in robots.split(',') {
        let row = measure(robots.parse().with_context(|| format!("`{robots}` is no number of robots"))?, floors)?;
        writeln!(table, "{row}")?;
        writeln!(std::io::stdout(), "{row}")?;
        std::fs::write(file, &table)?;
    }
    Ok(())
}

/// What a robot is to send.
struct Robot {
    name: String,
    /// By log time: the wire, the topic, the log time, and the message.
    messages: Vec<(usize, String, u64, Vec<u8>)>,
}

/// What each robot of a simulation sends, by log time.
fn simulate(robots: usize, overlap: f64, registry: &Registry) -> Result<Vec<Robot>> {
    let kind = registry.get("simulator").context("there is no simulator")?;
    // As much floor for each robot, whatever the number.
    let scale = (robots as f64 / 3.0).sqrt().max(1.0);
    let parameters = format!(
        "robots = {robots}\nduration = {DURATION}.0\nsnapshots = {MAPS}\nwidth = {:.1}\nheight = {:.1}\noverlap = {overlap}",
        (20.0 * scale).min(300.0),
        (15.0 * scale).min(300.0)
    );
    let mut simulator = StageHarness::new(kind, &parameters)?;
    while simulator.node().advance()? {}
    let mut by_robot: BTreeMap<String, Vec<_>> = BTreeMap::new();
    for (wire, output) in ["map", "pose", "tags"].into_iter().enumerate() {
        let is_data = |message: &Message| message.header().flags.contains(MessageFlags::DATA);
        for message in simulator.take_messages(output).into_iter().filter(is_data) {
            let (topic, time) = (message.header().topic.as_str().to_owned(), message.header().log_time.0);
            let entry = by_robot.entry(message.robot().to_owned()).or_default();
            entry.push((wire, topic, time, message.bytes().to_vec()));
        }
    }
    let sorted = by_robot.into_iter().map(|(name, mut messages)| {
        messages.sort_by_key(|(_, _, time, _)| *time);
        Robot { name, messages }
    });
    Ok(sorted.collect())
}

fn port() -> Result<u16> {
    Ok(TcpListener::bind("127.0.0.1:0")?.local_addr()?.port())
}

/// A base, as a run of this program.
struct Base {
    child: Child,
    name: String,
    log: PathBuf,
}

impl Base {
    /// Merges what comes to the port `listen`, and sends the merged map to the port `to`, as the map of the robot
    /// `name`.
    fn start(folder: &Path, name: &str, listen: u16, to: u16) -> Result<Self> {
        let text = include_str!("../../bridge/bridge_base.toml");
        let text = text.replace("tcp/localhost:7448", &format!("tcp/127.0.0.1:{listen}"));
        let text = text.replace("name = \"bridge_base\"", &format!("name = \"{name}\""));
        let sink = format!(
            "[stages.next]\nkind = \"bridge_sink\"\ninputs = [\"fuser.map\"]\nrobot = \"{name}\"\nsender = \"{name}\"\n\
             connect = [\"tcp/127.0.0.1:{to}\"]\n"
        );
        let file = folder.join(format!("{name}.toml"));
        std::fs::write(&file, format!("{text}\n{sink}"))?;
        let path = folder.join(format!("{name}.log"));
        let log = std::fs::File::create(&path)?;
        let program = std::env::current_exe()?;
        let output = folder.join(format!("{name}.mcap"));
        let mut command = Command::new(program);
        command.arg("run").arg(&file).arg("--output").arg(output);
        let child = command.stdout(log.try_clone()?).stderr(log).spawn()?;
        Ok(Self { child, name: name.to_owned(), log: path })
    }

    /// What its stages take: memory in bytes, how many of them work at a time (or wait for a processor to), and what
    /// they have dropped.
    fn look(&self) -> Result<(f64, f64, f64)> {
        let args = ["top", "--once", "--json", "--interval", "2", "--run", &self.name];
        let top = Command::new(std::env::current_exe()?).args(args).stderr(Stdio::null()).output()?;
        let seen: Value = serde_json::from_slice(&top.stdout).with_context(|| {
            let said = std::fs::read_to_string(&self.log).unwrap_or_default();
            format!("the base `{}` is not there any more: {said}", self.name)
        })?;
        let stages = seen["stages"].as_array().cloned().unwrap_or_default();
        let sum = |key: &str| stages.iter().filter_map(|stage| stage[key].as_f64()).sum::<f64>();
        Ok((sum("memory"), sum("busy"), sum("dropped")))
    }
}

impl Drop for Base {
    fn drop(&mut self) {
        let _ = Command::new("kill").args(["-INT", &self.child.id().to_string()]).status();
        let until = Instant::now() + Duration::from_secs(30);
        while matches!(self.child.try_wait(), Ok(None)) && Instant::now() < until {
            thread::sleep(Duration::from_millis(50));
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// What the robots have sent.
#[derive(Default)]
struct Sending {
    /// When the map of each log time was sent.
    maps: BTreeMap<u64, Instant>,
    counts: BTreeMap<String, u64>,
}

/// Sends what a robot has to send, each message at its time.
fn drive(robot: &Robot, to: u16, start: Instant, all: &Mutex<Sending>) -> Result<()> {
    let Robot { name, messages } = robot;
    let wires = [("map", OccupancyGrid::NAME), ("pose", PoseWithCovarianceStamped::NAME), ("tags", TagRange::NAME)];
    let wire = |(output, ros_type): (&'static str, &str)| InputWire {
        port: "in",
        from: "robot".into(),
        output,
        ros_type: ros_type.to_owned(),
        ..Default::default()
    };
    let context = Context { stage: "base".into(), inputs: wires.map(wire).to_vec(), ..Default::default() };
    let parameters = format!("connect = [\"tcp/127.0.0.1:{to}\"]\nsender = \"{name}\"");
    let mut sink = StageHarness::with_context(&gridweave_bridge::sink::kind(), &parameters, &context)?;
    let first = messages.first().map_or(0, |(_, _, time, _)| *time);
    for (wire, topic, time, bytes) in messages {
        let at = start + Duration::from_nanos(time - first);
        thread::sleep(at.saturating_duration_since(Instant::now()));
        let header = MessageHeader {
            log_time: LogTime(*time),
            publish_time: *time,
            robot: FixedText::new(name)?,
            topic: FixedText::new(topic)?,
            ..Default::default()
        };
        if *wire == 0 {
            all.lock().unwrap_or_else(PoisonError::into_inner).maps.entry(*time).or_insert_with(Instant::now);
        }
        sink.give_message("in", Message::from_vec(header, bytes.clone()).on_wire(*wire))?;
    }
    sink.finish(LogTime(messages.last().map_or(0, |(_, _, time, _)| *time)))?;
    let mut all = all.lock().unwrap_or_else(PoisonError::into_inner);
    for (what, count) in sink.counts() {
        *all.counts.entry(what).or_default() += count;
    }
    Ok(())
}

/// Draws a table.
fn draw(from: &Path, to: &Path) -> Result<()> {
    let text = std::fs::read_to_string(from).with_context(|| format!("cannot read {}", from.display()))?;
    let column = |name: &str| -> Result<Vec<(f64, f64)>> {
        let at = HEAD.split(',').position(|head| head == name).context("there is no such column")?;
        let row = |line: &str| {
            let number = |at: usize| line.split(',').nth(at)?.parse().ok();
            Some((number(0)?, number(at)?))
        };
        Ok(text.lines().skip(1).filter_map(row).collect())
    };
    let curves = [
        ("latency of half of the maps, s", "latency_p50_s"),
        ("latency of 95 of 100, s", "latency_p95_s"),
        ("memory of the base, GB", "memory_mb"),
        ("to the base, Mbit/s", "sent_mb"),
        ("maps that the base drops, share of those sent", "dropped_in_the_base"),
    ];
    let series = curves.map(|(name, column_name)| {
        let scale = match column_name {
            "memory_mb" => 1e-3,
            "sent_mb" => 8.0 / f64::from(DURATION),
            _ => 1.0,
        };
        let points = column(column_name)?.into_iter().map(|(x, y)| match column_name {
            // Each robot sends as many maps.
            "dropped_in_the_base" => (x, y / (x * f64::from(MAPS))),
            _ => (x, y * scale),
        });
        Ok(plot::Series::new(name, points.collect()))
    });
    let plot = plot::Plot {
        title: "Robots that send to one base".to_owned(),
        x: plot::Axis::new("robots").logarithmic(),
        y: plot::Axis::new("s, GB, Mbit/s, share").logarithmic(),
        shape: plot::Shape::Lines(series.into_iter().collect::<Result<_>>()?),
    };
    std::fs::write(to, plot.to_svg()?).with_context(|| format!("cannot write {}", to.display()))
}

/// The bases, the one above the others first, and the ports to which robots send.
fn start_bases(folder: &Path, floors: usize, to: u16) -> Result<(Vec<Base>, Vec<u16>)> {
    if floors == 1 {
        let port = port()?;
        return Ok((vec![Base::start(folder, "base", port, to)?], vec![port]));
    }
    let above = port()?;
    let (mut bases, mut ports) = (vec![Base::start(folder, "above", above, to)?], Vec::new());
    for floor in 1..=floors {
        let port = port()?;
        bases.push(Base::start(folder, &format!("floor{floor}"), port, above)?);
        ports.push(port);
    }
    Ok((bases, ports))
}

/// What comes from the bases, and what they need.
#[derive(Default)]
struct Came {
    /// The number of merged maps.
    merged: u64,
    /// The known cells of the last one.
    cells: usize,
    /// From a robot's map to the merged map, seconds.
    latencies: Vec<f64>,
    /// The most memory, bytes, the most stages that work at a time, and the most dropped messages.
    memory: f64,
    busy: f64,
    dropped: f64,
}

impl Came {
    /// Adds a message of the topic of merged maps.
    fn add(&mut self, message: &Message, sent: &Mutex<Sending>) {
        if !message.header().flags.contains(MessageFlags::DATA) {
            return;
        }
        self.merged += 1;
        if let Ok(grid) = message.decode::<OccupancyGrid<'_>>() {
            self.cells = grid.data.iter().filter(|cell| **cell <= 100).count();
        }
        let sent = sent.lock().unwrap_or_else(PoisonError::into_inner).maps.get(&message.header().log_time.0).copied();
        self.latencies.extend(sent.map(|sent| sent.elapsed().as_secs_f64()));
    }

    /// Looks at what the bases need now.
    fn look(&mut self, bases: &[Base]) -> Result<()> {
        let seen: Vec<_> = bases.iter().map(Base::look).collect::<Result<_>>()?;
        let sum = |of: fn(&(f64, f64, f64)) -> f64| seen.iter().map(of).sum::<f64>();
        self.memory = self.memory.max(sum(|seen| seen.0));
        self.busy = self.busy.max(sum(|seen| seen.1));
        self.dropped = self.dropped.max(sum(|seen| seen.2));
        Ok(())
    }

    /// The latency of this share of the maps, seconds.
    fn latency(&self, share: f64) -> String {
        let mut latencies = self.latencies.clone();
        latencies.sort_by(f64::total_cmp);
        let at = ((latencies.len() as f64 - 1.0) * share).round().max(0.0) as usize;
        latencies.get(at).map_or_else(String::new, |latency| format!("{latency:.2}"))
    }
}

/// One row of the table.
fn measure(robots: usize, floors: usize) -> Result<String> {
    let registry = gridweave::shipped::registry(gridweave_ros::kinds());
    // A map of a floor is merged with another only where both show enough of the same.
    let overlap = if floors == 1 { 0.3 } else { 0.65 };
    let mut fleet = simulate(robots, overlap, &registry)?;
    // Robots differ in when they send: with one time for all, maps could not be distinguished.
    for (number, robot) in fleet.iter_mut().enumerate() {
        robot.messages.iter_mut().for_each(|(_, _, time, _)| *time += number as u64);
    }
    let folder = tempfile::tempdir()?;
    let last = port()?;
    let mut collector = StageHarness::new(
        &gridweave_bridge::source::kind(),
        &format!("listen = [\"tcp/127.0.0.1:{last}\"]\nclock_tolerance = 1e9"),
    )?;
    let (bases, ports) = start_bases(folder.path(), floors, last)?;
    thread::sleep(Duration::from_secs(3));
    let all = Arc::new(Mutex::new(Sending::default()));
    let start = Instant::now() + Duration::from_secs(2);
    let threads: Vec<_> = fleet
        .into_iter()
        .enumerate()
        .map(|(number, robot)| {
            let (all, to) = (Arc::clone(&all), ports[number * ports.len() / robots]);
            thread::spawn(move || drive(&robot, to, start, &all))
        })
        .collect();
    let mut came = Came::default();
    let mut next_look = start + Duration::from_secs(u64::from(DURATION) / 2);
    let end = start + Duration::from_secs(DURATION.into()) + AFTERWARDS;
    while Instant::now() < end {
        collector.node().wait(Duration::from_millis(20));
        collector.node().advance()?;
        for message in collector.take_messages("map") {
            came.add(&message, &all);
        }
        if Instant::now() >= next_look {
            next_look += Duration::from_secs(15);
            came.look(&bases)?;
        }
    }
    for thread in threads {
        match thread.join() {
            Ok(result) => result?,
            Err(_) => bail!("a robot has failed"),
        }
    }
    let last = bases.first().map(|base| base.log.clone()).unwrap_or_default();
    drop(bases);
    let said = std::fs::read_to_string(last).unwrap_or_default();
    writeln!(std::io::stderr(), "{said}")?;
    let all = all.lock().unwrap_or_else(PoisonError::into_inner);
    let count = |what: &str| all.counts.get(what).copied().unwrap_or_default() as f64;
    let sent = count("bytes sent");
    Ok(format!(
        "{robots},{},{:.2},{:.2},{:.1},{},{},{},{},{},{:.0},{:.2},{},{}",
        if floors == 1 { 1 } else { floors + 1 },
        sent * 1e-6,
        count("bytes of the messages in them") * 1e-6,
        sent * 8e-3 / f64::from(DURATION) / robots as f64,
        all.maps.len(),
        came.merged,
        came.latency(0.5),
        came.latency(0.95),
        came.cells,
        came.memory * 1e-6,
        came.busy,
        count("messages dropped because the bridge does not keep up"),
        came.dropped,
    ))
}
