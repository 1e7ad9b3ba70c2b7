//! The verb `bridge`: links of a run that goes on, carried to a base.

use crate::bridge::free_endpoint;
use crate::command::{GRIDWEAVE, Running, run, wait_until};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};
use tempfile::TempDir;

/// What robots send, as a log.
pub(crate) const ROBOT: &str = r#"
[pipeline]
name = "NAME"
mode = "live"

[stages.robots]
kind = "live_source"
topics = { pose = "/{robot}/pose" }

[stages.output]
kind = "mcap_sink"
inputs = ["robots.map", "robots.pose", "robots.tags"]
"#;

/// The same on a base.
pub(crate) const BASE: &str = r#"
[pipeline]
name = "NAME"
mode = "live"

[stages.robots]
kind = "bridge_source"

[stages.output]
kind = "mcap_sink"
inputs = ["robots.map", "robots.pose", "robots.tags"]
"#;

const LINKS: [&str; 3] = ["robots.map", "robots.pose", "robots.tags"];
const TOPICS: [&str; 3] = ["map", "pose", "tag_ranges"];
/// The buffer of an observer of a link, messages; a slow observer misses others.
const NEVER_MISSED: usize = 60;

/// A name that no run of another test has.
fn own_name(what: &str) -> String {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    format!("{what}_{}_{}", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed))
}

/// So many seconds of a drive are one log.
const PART: u64 = 20_000_000_000;
/// How much later than the rest of its log a message is which is never sent: who plays it stays, as a robot does.
const NEVER: u64 = 100_000_000_000_000;

/// The drive of two robots in a small building, in three logs, with so few poses and readings that nobody who looks on
/// misses one. Gives how many messages each holds.
fn simulate(folder: &Path) -> [u64; 3] {
    let building =
        ["width=12", "height=10", "drift=0", "overlap=0.9", "tags=24", "beams=180", "duration=60", "snapshots=9"];
    let building = building.into_iter().flat_map(|setting| ["--set", setting]);
    let simulate: Vec<&str> = ["simulate", "-o", "all.mcap", "--robots", "2"].into_iter().chain(building).collect();
    run(GRIDWEAVE, &simulate, folder);
    let bytes = fs::read(folder.join("all.mcap")).unwrap();
    let is_carried = |message: &mcap::Message<'_>| TOPICS.contains(&last_part(&message.channel.topic));
    let messages = || mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap).filter(is_carried);
    // Poses of all robots pass on one link, and so do readings.
    let mut counts = BTreeMap::<String, usize>::new();
    messages().for_each(|message| *counts.entry(last_part(&message.channel.topic).to_owned()).or_default() += 1);
    let mut seen = BTreeMap::<String, usize>::new();
    let log = |part: usize| fs::File::create(folder.join(format!("part{part}.mcap"))).unwrap();
    let mut logs = [0, 1, 2].map(|part| mcap::Writer::new(log(part)).unwrap());
    let (mut written, start) = ([0; 3], messages().next().unwrap().log_time);
    for message in messages() {
        let number = seen.entry(message.channel.topic.clone()).or_default();
        if number.is_multiple_of(counts[last_part(&message.channel.topic)].div_ceil(NEVER_MISSED)) {
            let part = ((message.log_time - start) / PART).min(2) as usize;
            logs[part].write(&message).unwrap();
            written[part] += 1;
        }
        *number += 1;
    }
    let last = messages().find(|message| message.channel.topic == "/robot1/pose").unwrap();
    for log in &mut logs {
        log.write(&mcap::Message { log_time: last.log_time + NEVER, ..last.clone() }).unwrap();
        log.finish().unwrap();
    }
    written
}

fn last_part(topic: &str) -> &str {
    topic.rsplit('/').next().unwrap_or_default()
}

/// The run of a robot.
pub(crate) struct Robot {
    pub(crate) name: String,
    run: Running,
    folder: TempDir,
    /// How many messages each of its logs holds, and how many were sent.
    holds: [u64; 3],
    sent: u64,
    players: Vec<Running>,
}

impl Robot {
    #[track_caller]
    fn start() -> Self {
        Self::start_with(ROBOT)
    }

    /// Starts the run of a pipeline that is called NAME, and has [`ROBOT`]'s stages.
    #[track_caller]
    pub(crate) fn start_with(pipeline: &str) -> Self {
        let folder = TempDir::new().unwrap();
        let holds = simulate(folder.path());
        let name = own_name("robot");
        fs::write(folder.path().join("robot.toml"), pipeline.replace("NAME", &name)).unwrap();
        let args = ["run", "robot.toml", "--output", "robot.mcap"];
        let run = Running::start(GRIDWEAVE, &args, folder.path(), "robot.log");
        Self { name, run, folder, holds, sent: 0, players: Vec::new() }
    }

    pub(crate) fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Begins to carry its links to a base.
    #[track_caller]
    fn bridge(&self, endpoint: &str, more: &[&str]) -> Running {
        let named = ["--to", endpoint, "--run", &self.name, "--wait", "60", "--set", "sender=robot"];
        let args: Vec<&str> = ["bridge"].into_iter().chain(LINKS).chain(named).chain(more.iter().copied()).collect();
        let bridge = Running::start(GRIDWEAVE, &args, self.path(), "bridge.log");
        bridge.wait_for("carries 3 links");
        bridge
    }

    /// Lets the robots send a part of what they have, and waits until their own log has it.
    #[track_caller]
    pub(crate) fn play(&mut self, part: usize) {
        let log = format!("part{part}.mcap");
        let play = ["play", &log, "--rate", "50", "--run", &self.name, "--wait", "60"];
        let player = Running::start(GRIDWEAVE, &play, self.path(), &format!("{log}.log"));
        self.sent += self.holds[part];
        wait_until(&log, || self.messages(&self.name, "output") == self.sent, || player.errors() + &self.run.errors());
        self.players.push(player);
    }

    /// Ends the run as a user does.
    #[track_caller]
    pub(crate) fn end(&mut self) {
        for player in &mut self.players {
            player.signal("INT");
            player.end_with(0);
        }
        self.run.signal("INT");
        self.run.end_with(0);
    }

    /// How many messages a stage of a run was given.
    #[track_caller]
    fn messages(&self, run_name: &str, stage: &str) -> u64 {
        let top = ["top", "--once", "--json", "--interval", "0.05", "--run", run_name, "--wait", "60"];
        let top: serde_json::Value = serde_json::from_str(&run(GRIDWEAVE, &top, self.path())).unwrap();
        let stages = top["stages"].as_array().unwrap();
        stages.iter().find(|entry| entry["name"] == stage).unwrap()["messages_in"].as_u64().unwrap()
    }

    /// The messages of a log by topic: log times and bytes.
    #[track_caller]
    fn messages_of(&self, log: &str) -> Vec<Vec<(u64, Vec<u8>)>> {
        let bytes = fs::read(self.path().join(log)).unwrap();
        let mut topics = BTreeMap::<String, Vec<(u64, Vec<u8>)>>::new();
        for message in mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap) {
            topics
                .entry(message.channel.topic.clone())
                .or_default()
                .push((message.log_time, message.data.into_owned()));
        }
        let names = ["robot1", "robot2"].into_iter().flat_map(|robot| TOPICS.map(|topic| format!("/{robot}/{topic}")));
        names.map(|name| topics.remove(&name).unwrap_or_default()).collect()
    }

    /// The map that comes of what robots have said in a log.
    #[track_caller]
    fn merged_map(&self, log: &str) -> Vec<u8> {
        let topics = TOPICS.map(|topic| format!("/{{robot}}/{topic}"));
        let mut filter = vec!["filter", log, "-o", "said.mcap", "--topics"];
        let topics = topics.join(",");
        filter.push(&topics);
        run(GRIDWEAVE, &filter, self.path());
        run(GRIDWEAVE, &["merge", "said.mcap", "-o", "said.merged.mcap", "--map", "said.yaml"], self.path());
        for file in ["said.mcap", "said.merged.mcap", "said.yaml"] {
            fs::remove_file(self.path().join(file)).unwrap();
        }
        let map = self.path().join("said.pgm");
        let cells = fs::read(&map).unwrap();
        fs::remove_file(map).unwrap();
        cells
    }
}

/// A base that takes what robots send as a log, until one has said that nothing follows.
#[track_caller]
pub(crate) fn log_base(robot: &Robot, base: &str, endpoint: &str, log: &str) -> (String, Running) {
    let (name, pipeline) = (own_name("base"), format!("{log}.toml"));
    fs::write(robot.path().join(&pipeline), base.replace("NAME", &name)).unwrap();
    let listen = format!("robots.listen=[\"{endpoint}\"]");
    let args = ["run", &pipeline, "--output", log, "--set", &listen, "--set", "robots.end_after=1"];
    (name, Running::start(GRIDWEAVE, &args, robot.path(), &format!("{log}.log")))
}

#[test]
fn a_run_that_is_carried_to_a_base_ends_in_the_same_map_as_where_it_was() {
    let mut robot = Robot::start();
    let endpoint = free_endpoint().0;
    let pipeline = Path::new(env!("CARGO_MANIFEST_DIR")).join("../bridge/bridge_base.toml");
    let listen = format!("robots.listen=[\"{endpoint}\"]");
    let args = ["run", pipeline.to_str().unwrap(), "--output", "base.mcap", "--summary", "summary.json"];
    let args = [&args[..], &["--set", &listen, "--set", "robots.end_after=1"]].concat();
    let mut base = Running::start(GRIDWEAVE, &args, robot.path(), "base.log");
    let mut bridge = robot.bridge(&endpoint, &[]);
    (0..3).for_each(|part| robot.play(part));
    let sent = robot.sent;
    let base_name = base.run_name();
    let came = || ["maps", "tags"].map(|stage| robot.messages(&base_name, stage)).iter().sum::<u64>() == sent;
    wait_until("all of it", came, || bridge.errors() + &base.errors());
    robot.end();
    let carried = bridge.end_with(0);
    assert!(carried.contains(&format!("carried {sent} of {sent} messages of 3 links")), "{carried}");
    base.end_with(0);
    let said = robot.messages_of("robot.mcap");
    assert_eq!(said.iter().map(Vec::len).sum::<usize>() as u64, sent);
    assert!(robot.messages_of("base.mcap") == said);
    // While it went on the base merged them rightly, and what it has logged merges as what the robots have logged.
    run(GRIDWEAVE, &["evaluate", "summary.json", "--truth", "all.truth.json"], robot.path());
    let map = robot.merged_map("robot.mcap");
    assert!(map.len() > 10_000 && map == robot.merged_map("base.mcap"), "{} bytes", map.len());
}

#[test]
fn a_restart_of_a_killed_base_is_reported_and_it_gets_later_messages() {
    let mut robot = Robot::start();
    let endpoint = free_endpoint().0;
    let (first_name, first) = log_base(&robot, BASE, &endpoint, "first.mcap");
    let mut bridge = robot.bridge(&endpoint, &["-v"]);
    robot.play(0);
    let before = robot.sent;
    let taken = || robot.messages(&first_name, "output") == before;
    wait_until("the first part", taken, || bridge.errors() + &first.errors());
    first.signal("KILL");
    bridge.wait_for("the receiver `base` is gone");
    drop(first);
    // This waits.
    robot.play(1);
    let (_, mut second) = log_base(&robot, BASE, &endpoint, "second.mcap");
    let times_there = || bridge.errors().matches("the receiver `base` is there").count();
    wait_until("another base", || times_there() == 2, || bridge.errors());
    robot.play(2);
    let sent = robot.sent;
    // It takes what has passed until then.
    bridge.signal("INT");
    let (status, carried) = bridge.end();
    second.end_with(0);
    robot.end();
    // All that followed has come; of the maps that waited the last one.
    let (mut came, mut superseded) = (0, 0);
    let topics = robot.messages_of("robot.mcap").into_iter().zip(robot.messages_of("second.mcap"));
    for ((said, second), is_map) in topics.zip([true, false, false].into_iter().cycle()) {
        assert!(said.ends_with(&second) && !second.is_empty() && second.len() < said.len());
        came += second.len() as u64;
        superseded += u64::from(is_map);
    }
    let errors = bridge.errors();
    let lost = sent - before - came;
    assert!(lost >= superseded, "{lost} {errors}");
    assert!(carried.contains(&format!("carried {} of {sent} messages", sent - lost)), "{carried}{errors}");
    assert_eq!(status, 1, "{errors}");
    assert!(
        errors.contains("warning: the receiver `base` is gone: what follows waits until it is there again (1 times)"),
        "{errors}"
    );
    assert!(
        errors.contains("warning: only the last of the pending maps were sent, as the receiver was restarted"),
        "{errors}"
    );
    // What the killed run has left.
    run(GRIDWEAVE, &["clean"], robot.path());
}

#[test]
fn top_at_the_base_shows_the_stages_of_the_robot_with_its_name() {
    let mut robot = Robot::start();
    let endpoint = free_endpoint().0;
    let (name, mut base) =
        log_base(&robot, &BASE.replace("robots.tags\"", "robots.tags\", \"robots.stages\""), &endpoint, "base.mcap");
    let mut bridge = robot.bridge(&endpoint, &["--set", "report_stages=0.1"]);
    (0..3).for_each(|part| robot.play(part));
    let sent = robot.sent;
    let top = |more: &[&str]| {
        let args = ["top", "--once", "--interval", "0.3", "--run", &name, "--wait", "60"];
        run(GRIDWEAVE, &[&args, more].concat(), robot.path())
    };
    let mut machine = serde_json::Value::Null;
    let is_shown = || {
        let shown: serde_json::Value = serde_json::from_str(&top(&["--json"])).unwrap();
        machine = shown["machines"][0].clone();
        machine["stages"][1]["messages_in"] == sent
    };
    wait_until("the robot's stages", is_shown, || bridge.errors() + &base.errors());
    let names = machine["stages"].as_array().unwrap().iter().map(|stage| stage["name"].as_str().unwrap());
    assert_eq!(
        (machine["machine"].as_str(), names.collect::<Vec<_>>()),
        (Some("robot"), vec!["robots", "output"]),
        "{machine}"
    );
    assert_eq!(machine["stages"][0]["state"], "running", "{machine}");
    let shown = top(&[]);
    let words = |line: &str| line.split_whitespace().take(2).map(str::to_owned).collect::<Vec<_>>().join(" ");
    let rows: Vec<String> = shown.lines().skip(1).map(words).collect();
    assert_eq!(rows, ["MACHINE STAGE", "(here) robots", "(here) output", "robot robots", "robot output"], "{shown}");
    // A run without reports of other machines looks as ever.
    let alone = run(GRIDWEAVE, &["top", "--once", "--interval", "0.1", "--run", &robot.name], robot.path());
    assert!(!alone.contains("MACHINE"), "{alone}");
    robot.end();
    // The reports of the bridge itself are not counted with the messages that it carries.
    let carried = bridge.end_with(0);
    assert!(carried.contains(&format!("carried {sent} of {sent} messages of 3 links")), "{carried}");
    base.end_with(0);
}

#[test]
fn without_a_base_a_bridge_says_so_and_ends_with_status_1() {
    let mut robot = Robot::start();
    let endpoint = free_endpoint().0;
    let mut bridge = robot.bridge(&endpoint, &["--set", "linger=0.1"]);
    robot.play(0);
    bridge.wait_for(&format!("there is no receiver of the bridge `base` at {endpoint} ({endpoint}: "));
    bridge.wait_for("nothing listens there");
    bridge.signal("INT");
    let carried = bridge.end_with(1);
    assert!(carried.contains("carried 0 of "), "{carried}");
    let errors = bridge.errors();
    assert!(errors.contains("the other end of the bridge has not acknowledged the end within 0.1 s"), "{errors}");
    robot.end();
}
