//! The verb `bridge`: links of a run that goes on, carried to a base.

use crate::command::{GRIDWEAVE, Running, run, wait_until};
use std::collections::BTreeMap;
use std::fs;
use std::net::TcpListener;
use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};
use tempfile::TempDir;

/// What robots send, as a log.
const ROBOT: &str = r#"
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
const BASE: &str = r#"
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
/// A program that looks on at a link has room for so many messages, and misses others if it is slow.
const NEVER_MISSED: usize = 60;

/// A name that no run of another test has.
fn own_name(what: &str) -> String {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    format!("{what}_{}_{}", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed))
}

fn free_endpoint() -> String {
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    format!("tcp/127.0.0.1:{port}")
}

/// A log of two robots in a small building, with so few poses and readings that nobody who looks on misses one.
fn simulate(folder: &Path) {
    let building = ["width=12", "height=10", "drift=0", "overlap=0.9", "tags=24", "beams=180", "duration=60"];
    let building = building.into_iter().flat_map(|setting| ["--set", setting]);
    let simulate: Vec<&str> = ["simulate", "-o", "all.mcap", "--robots", "2"].into_iter().chain(building).collect();
    run(GRIDWEAVE, &simulate, folder);
    let bytes = fs::read(folder.join("all.mcap")).unwrap();
    let messages = || mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap);
    // Poses of all robots pass on one link, and so do readings.
    let last_part = |topic: &str| topic.rsplit('/').next().unwrap().to_owned();
    let mut counts = BTreeMap::<String, usize>::new();
    messages().for_each(|message| *counts.entry(last_part(&message.channel.topic)).or_default() += 1);
    let mut seen = BTreeMap::<String, usize>::new();
    let mut log = mcap::Writer::new(fs::File::create(folder.join("in.mcap")).unwrap()).unwrap();
    for message in messages() {
        let (number, name) =
            (seen.entry(message.channel.topic.clone()).or_default(), last_part(&message.channel.topic));
        if *number % counts[&name].div_ceil(NEVER_MISSED) == 0 {
            log.write(&message).unwrap();
        }
        *number += 1;
    }
    log.finish().unwrap();
}

/// The run of a robot.
struct Robot {
    name: String,
    run: Running,
    folder: TempDir,
}

impl Robot {
    #[track_caller]
    fn start() -> Self {
        let folder = TempDir::new().unwrap();
        simulate(folder.path());
        let name = own_name("robot");
        fs::write(folder.path().join("robot.toml"), ROBOT.replace("NAME", &name)).unwrap();
        let args = ["run", "robot.toml", "--output", "robot.mcap"];
        let run = Running::start(GRIDWEAVE, &args, folder.path(), "robot.log");
        Self { name, run, folder }
    }

    fn path(&self) -> &Path {
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

    /// Lets the robots send what they have.
    #[track_caller]
    fn play(&self, more: &[&str]) {
        let play = ["play", "in.mcap", "--rate", "0", "--run", &self.name, "--wait", "60"];
        run(GRIDWEAVE, &[&play, more].concat(), self.path());
    }

    /// Ends the run as a user does.
    #[track_caller]
    fn end(&mut self) {
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
fn log_base(robot: &Robot, endpoint: &str, log: &str) -> (String, Running) {
    let (name, pipeline) = (own_name("base"), format!("{log}.toml"));
    fs::write(robot.path().join(&pipeline), BASE.replace("NAME", &name)).unwrap();
    let listen = format!("robots.listen=[\"{endpoint}\"]");
    let args = ["run", &pipeline, "--output", log, "--set", &listen, "--set", "robots.end_after=1"];
    (name, Running::start(GRIDWEAVE, &args, robot.path(), &format!("{log}.log")))
}

#[test]
fn a_run_that_is_carried_to_a_base_ends_in_the_same_map_as_where_it_was() {
    let mut robot = Robot::start();
    let endpoint = free_endpoint();
    let pipeline = Path::new(env!("CARGO_MANIFEST_DIR")).join("bridge_base.toml");
    let listen = format!("robots.listen=[\"{endpoint}\"]");
    let args = ["run", pipeline.to_str().unwrap(), "--output", "base.mcap", "--summary", "summary.json"];
    let args = [&args[..], &["--set", &listen, "--set", "robots.end_after=1"]].concat();
    let mut base = Running::start(GRIDWEAVE, &args, robot.path(), "base.log");
    let mut bridge = robot.bridge(&endpoint, &[]);
    robot.play(&[]);
    let sent: usize = robot.messages(&robot.name, "output") as usize;
    // What has passed before the run ended is carried.
    robot.end();
    let carried = bridge.end_with(0);
    assert!(carried.contains(&format!("carried {sent} of {sent} messages of 3 links")), "{carried}");
    base.end_with(0);
    let said = robot.messages_of("robot.mcap");
    assert_eq!(said.iter().map(Vec::len).sum::<usize>(), sent);
    assert!(robot.messages_of("base.mcap") == said);
    // While it went on the base merged them rightly, and what it has logged merges as what the robots have logged.
    run(GRIDWEAVE, &["evaluate", "summary.json", "--truth", "all.truth.json"], robot.path());
    let map = robot.merged_map("robot.mcap");
    assert!(map.len() > 10_000 && map == robot.merged_map("base.mcap"), "{} bytes", map.len());
}

#[test]
fn a_base_that_is_killed_and_started_again_is_told_and_gets_what_follows() {
    let mut robot = Robot::start();
    let endpoint = free_endpoint();
    let (first_name, first) = log_base(&robot, &endpoint, "first.mcap");
    let mut bridge = robot.bridge(&endpoint, &["-v"]);
    robot.play(&["--end", "20"]);
    let before = robot.messages(&robot.name, "output");
    let taken = || robot.messages(&first_name, "output") == before;
    wait_until("the first part", taken, || bridge.errors() + &first.errors());
    first.signal("KILL");
    bridge.wait_for("the receiver `base` is gone");
    drop(first);
    // This waits.
    robot.play(&["--start", "20", "--end", "40"]);
    let (_, mut second) = log_base(&robot, &endpoint, "second.mcap");
    let times_there = || bridge.errors().matches("the receiver `base` is there").count();
    wait_until("another base", || times_there() == 2, || bridge.errors());
    robot.play(&["--start", "40"]);
    let sent = robot.messages(&robot.name, "output");
    robot.end();
    let (status, carried) = bridge.end();
    second.end_with(0);
    // All that followed has come; of the maps that waited the last one.
    let (mut came, mut superseded) = (0, 0);
    let topics = robot.messages_of("robot.mcap").into_iter().zip(robot.messages_of("second.mcap"));
    for ((said, second), is_map) in topics.zip([true, false, false].into_iter().cycle()) {
        assert!(said.ends_with(&second) && !second.is_empty() && second.len() < said.len());
        came += second.len() as u64;
        superseded += u64::from(is_map);
    }
    let told = bridge.errors();
    let lost = sent - before - came;
    assert!(lost >= superseded, "{lost} {told}");
    assert!(carried.contains(&format!("carried {} of {sent} messages", sent - lost)), "{carried}{told}");
    assert_eq!(status, 1, "{told}");
    assert!(
        told.contains("warning: the receiver `base` is gone: what follows waits until it is there again (1 times)"),
        "{told}"
    );
    assert!(
        told.contains("warning: of the maps that waited for a receiver that began anew the last were sent alone"),
        "{told}"
    );
    // What the killed run has left.
    run(GRIDWEAVE, &["clean"], robot.path());
}

#[test]
fn without_a_base_a_bridge_says_so_and_ends_with_status_1() {
    let mut robot = Robot::start();
    let endpoint = free_endpoint();
    let mut bridge = robot.bridge(&endpoint, &["--set", "linger=0.1"]);
    robot.play(&[]);
    let sent = robot.messages(&robot.name, "output");
    bridge.wait_for(&format!("there is no receiver of the bridge `base` at {endpoint} ({endpoint}: "));
    bridge.wait_for("nothing listens there");
    bridge.signal("INT");
    let carried = bridge.end_with(1);
    assert!(carried.contains(&format!("carried 0 of {sent} messages")), "{carried}");
    let told = bridge.errors();
    assert!(told.contains("the other end of the bridge has not taken the end within 0.1 s"), "{told}");
    robot.end();
}
