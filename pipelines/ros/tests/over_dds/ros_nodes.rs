//! The stages, and the whole command, among real nodes of ROS 2: rclpy on Fast DDS, and programs on Cyclone DDS.
//!
//! `GRIDWEAVE_ROS_PYTHON` names a Python 3.12 with what is in `tests/python/ros_jazzy.txt` or `ros_kilted.txt`.

use crate::command::{GRIDWEAVE, Running, run};
use crate::domain::{Domain, map};
use crate::waiting::{give, sent, wait_for, warned};
use gridweave_logs::schemas::schema_names;
use gridweave_ros::key_expression::known_hash;
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{Header, MapMetaData, OccupancyGrid, PoseStamped, RosMessage, encode};
use gridweave_runtime::stage::StageHarness;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The packages whose types must all be there.
const PACKAGES: [&str; 6] =
    ["builtin_interfaces", "geometry_msgs", "nav_msgs", "sensor_msgs", "std_msgs", "visualization_msgs"];

pub(crate) fn script(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python").join(name)
}

/// The Python with rclpy.
#[track_caller]
pub(crate) fn python() -> String {
    std::env::var("GRIDWEAVE_ROS_PYTHON").expect("GRIDWEAVE_ROS_PYTHON names a Python with rclpy")
}

/// Starts a program of a script in a domain, on this machine alone.
#[track_caller]
fn start(name: &str, domain: &Domain, arguments: &[&str], folder: &Path) -> Running {
    let program = [python(), script(name).display().to_string()];
    let arguments = arguments.iter().map(|argument| (*argument).to_owned());
    let program: Vec<String> = program.into_iter().chain(arguments).collect();
    start_in(domain, &program, folder, &format!("{name}.log"))
}

/// Starts a program with the settings for a domain, on this machine alone.
#[track_caller]
pub(crate) fn start_in(domain: &Domain, program: &[String], folder: &Path, log: &str) -> Running {
    let settings = [
        format!("ROS_DOMAIN_ID={}", domain.number()),
        "ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST".to_owned(),
        "RMW_IMPLEMENTATION=rmw_fastrtps_cpp".to_owned(),
        format!("FASTRTPS_DEFAULT_PROFILES_FILE={}", script("loopback.xml").display()),
        format!("ROS_LOG_DIR={}", folder.display()),
    ];
    let all: Vec<String> = settings.into_iter().chain(program.iter().cloned()).collect();
    Running::start("env", &all, folder, log)
}

/// The same of one that says on its first line that it is ready.
#[track_caller]
fn start_ready(name: &str, domain: &Domain, arguments: &[&str], words: &str, folder: &Path) -> Running {
    let mut running = start(name, domain, arguments, folder);
    let mut line = String::new();
    BufReader::new(running.stdout()).read_line(&mut line).unwrap();
    assert_eq!(line.trim_end(), words, "{}", running.errors());
    running
}

/// Makes a log of two robots, `in.mcap`.
pub(crate) fn simulate(folder: &Path) {
    let building = ["width=12", "height=10", "drift=0", "overlap=0.9", "tags=24", "beams=180", "duration=60"];
    let building = building.into_iter().flat_map(|setting| ["--set", setting]);
    let simulate: Vec<&str> = ["simulate", "-o", "in.mcap", "--robots", "2"].into_iter().chain(building).collect();
    run(GRIDWEAVE, &simulate, folder);
}

fn rclpy(domain: &Domain, arguments: &[&str], folder: &Path) -> Running {
    start_ready("rclpy_nodes.py", domain, arguments, "all is sent", folder)
}

/// What a program prints until its good end, as JSON.
#[track_caller]
fn printed(mut running: Running) -> serde_json::Value {
    serde_json::from_str(&running.end_with(0)).unwrap()
}

/// The whole command merges what robots on Fast DDS publish. A viewer that comes late has the map, one on Cyclone the
/// frames, and robots that end and come again do no harm.
#[test]
#[ignore = "needs a Python with rclpy, named by GRIDWEAVE_ROS_PYTHON"]
fn robots_on_fast_dds_have_one_map() {
    let (folder, domain) = (TempDir::new().unwrap(), Domain::new());
    let folder = folder.path();
    simulate(folder);
    run(GRIDWEAVE, &["filter", "in.mcap", "-o", "robots.mcap", "--topics", "/{robot}/map,/{robot}/pose"], folder);

    let pipeline = Path::new(env!("CARGO_MANIFEST_DIR")).join("live_ros.toml");
    let number = domain.number();
    let settings = ["robots", "ros"].into_iter().flat_map(|stage| {
        ["middleware=\"dds\"".to_owned(), "discovery_range=\"localhost\"".to_owned(), format!("domain={number}")]
            .map(|setting| format!("{stage}.{setting}"))
    });
    let arguments = ["run".to_owned(), pipeline.display().to_string(), "--summary".into(), "summary.json".into()];
    let settings = settings.flat_map(|setting| ["--set".to_owned(), setting]);
    let arguments: Vec<String> = arguments.into_iter().chain(settings).collect();
    let mut merging = Running::start(GRIDWEAVE, &arguments, folder, "merging.log");

    let robots = rclpy(&domain, &["robots", "robots.mcap", "6"], folder);
    for _ in 0..2 {
        let seen = printed(start("rclpy_nodes.py", &domain, &["view", "30000", "200"], folder));
        assert_eq!(seen["map"]["frame"], "world");
        assert_eq!(seen["publisher"][0], "gridweave_ros");
        assert_eq!(seen["publisher"][1], "nav_msgs/msg/OccupancyGrid");
        assert_eq!(seen["publisher"][3], "TRANSIENT_LOCAL");
        let frames = printed(start("cyclone_nodes.py", &domain, &["frames", "2", "200"], folder));
        for robot in ["robot1/map", "robot2/map"] {
            assert_eq!(frames[robot]["parent"], "world", "{frames}");
        }
    }
    drop(robots);
    let _again = rclpy(&domain, &["robots", "robots.mcap", "6"], folder);
    merging.signal("INT");
    merging.end_with(0);
    assert!(!merging.errors().contains("warning"), "{}", merging.errors());
    run(GRIDWEAVE, &["evaluate", "summary.json", "--truth", "in.truth.json"], folder);
}

#[test]
#[ignore = "needs a Python with rclpy, named by GRIDWEAVE_ROS_PYTHON"]
fn maps_of_16_mb_go_both_ways() {
    let (folder, domain) = (TempDir::new().unwrap(), Domain::new());
    let mut source = domain.source("");
    let _robot = rclpy(&domain, &["publish_map", "/robot1/map", "4000", "7"], folder.path());
    let message = sent(&mut source, "map", 1).remove(0);
    let grid: OccupancyGrid<'_> = message.decode().unwrap();
    assert!(grid.data.len() == 16_000_000 && grid.data.iter().all(|cell| *cell == 7));

    let mut sink = domain.sink("gridweave_ros", &[(OccupancyGrid::NAME, "/map")]);
    give(&mut sink, 0, "/map", map(4000, 9));
    let seen = printed(start("rclpy_nodes.py", &domain, &["view", "16000000", "60"], folder.path()));
    assert_eq!((&seen["map"]["width"], &seen["map"]["known"]), (&4000.into(), &16_000_000.into()));
}

#[test]
#[ignore = "needs a Python with rclpy, named by GRIDWEAVE_ROS_PYTHON"]
fn transforms_on_cyclone_dds_are_poses() {
    let (folder, domain) = (TempDir::new().unwrap(), Domain::new());
    let mut source = domain.source("");
    let _robot = rclpy(&domain, &["publish_map", "/robot7/map", "20", "0"], folder.path());
    let _transforms = start("cyclone_nodes.py", &domain, &["tf", "robot7"], folder.path());
    let pose = sent(&mut source, "pose", 1).remove(0).decode::<PoseStamped>().unwrap();
    assert_eq!((pose.header.frame_id.as_str(), pose.pose.position.x), ("robot7/map", 3.0));
}

#[test]
#[ignore = "needs a Python with rclpy, named by GRIDWEAVE_ROS_PYTHON"]
fn a_request_for_more_than_is_offered_is_reported_with_both_settings() {
    let (folder, domain) = (TempDir::new().unwrap(), Domain::new());
    let mut sink = domain.sink("gridweave_ros", &[(PoseStamped::NAME, "/odd")]);
    let pose = || encode(&PoseStamped::default()).unwrap();
    give(&mut sink, 0, "/odd", pose());
    let _picky = start_ready("rclpy_nodes.py", &domain, &["ask_for_more"], "incompatible", folder.path());
    go_on_sending(&mut sink, "cannot match");
    let warnings = sink.warnings();
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    let (text, count) = warnings.into_iter().next().unwrap();
    assert_eq!(count, 1);
    for words in ["/picky subscribes to `/odd`", "reliable, transient local", "reliable, volatile", "durability"] {
        assert!(text.contains(words), "{text}");
    }
}

/// Nodes of Humble state no hashes of types, and crash by the names of nodes as later releases write them; bridges state
/// none, and have these. Each gets its own.
#[test]
#[ignore = "needs a Python with rclpy, named by GRIDWEAVE_ROS_PYTHON"]
fn robots_without_hashes_of_types_are_heard_and_read_the_names_of_nodes() {
    let (folder, domain) = (TempDir::new().unwrap(), Domain::new());
    let mut source = domain.source("node = \"listener\"");
    let mut sink = domain.sink("gridweave_ros", &[(OccupancyGrid::NAME, "/map")]);
    give(&mut sink, 0, "/map", map(20, 1));
    let start_robot =
        |size, robot| start("cyclone_nodes.py", &domain, &["without_hashes", size, robot, "60"], folder.path());
    let mut robots = [start_robot("24", "robot8"), start_robot("16", "robot9")];
    let mut heard = BTreeSet::new();
    wait_for(&mut source, "maps of both", |source| {
        heard.extend(source.take_messages("map").iter().map(|message| message.robot().to_owned()));
        heard.contains("robot8") && heard.contains("robot9")
    });
    let seen = printed(start("rclpy_nodes.py", &domain, &["view", "400", "60"], folder.path()));
    assert_eq!(seen["publisher"][0], "gridweave_ros");
    for robot in &mut robots {
        let named: serde_json::Value = serde_json::from_str(&robot.end_with(0)).unwrap();
        assert_eq!(named, serde_json::json!(["listener", "gridweave_ros"]));
    }
}

/// A map whose first cells are walls, and the others free.
fn walls_up_to(count: usize) -> Vec<u8> {
    const WIDTH: u32 = 40;
    let info = MapMetaData { width: WIDTH, height: WIDTH, resolution: 0.05, ..Default::default() };
    let cells: Vec<u8> = (0..(WIDTH * WIDTH) as usize).map(|at| if at < count { 100 } else { 0 }).collect();
    encode(&OccupancyGrid { header: Header::new(LogTime(1_000_000_000), "map"), info, data: &cells }).unwrap()
}

#[test]
#[ignore = "needs a Python with rclpy, named by GRIDWEAVE_ROS_PYTHON"]
fn subscribers_get_the_map_by_updates() {
    let (folder, domain) = (TempDir::new().unwrap(), Domain::new());
    let mut sink = domain.sink("gridweave_ros", &[(OccupancyGrid::NAME, "/map")]);
    let mut viewer = start("cyclone_nodes.py", &domain, &["updates", "3", "300", "60"], folder.path());
    let cells = serde_json::from_str(&by_updates(&mut sink, &mut viewer)).unwrap();
    assert_has_walls(&cells);
}

/// Sends a viewer a map in so many parts until it hears updates, and then one with 300 walls. Gives what it prints of that.
#[track_caller]
pub(crate) fn by_updates(sink: &mut StageHarness, viewer: &mut Running) -> String {
    let mut lines = BufReader::new(viewer.take_stdout()).lines();
    let hears = std::thread::spawn(move || (lines.next().unwrap().unwrap(), lines));
    let mut given = 0;
    while !hears.is_finished() {
        given += 1;
        give(sink, 0, "/map", walls_up_to(given % 300));
        std::thread::yield_now();
    }
    let (line, mut lines) = hears.join().unwrap();
    assert_eq!(line, "hears updates", "{}", viewer.errors());
    // Whatever has come in which order before, the last map counts.
    give(sink, 0, "/map", walls_up_to(300));
    lines.next().unwrap_or_else(|| panic!("{}", viewer.errors())).unwrap()
}

/// The first 300 cells of the map are walls, and no others.
#[track_caller]
pub(crate) fn assert_has_walls(cells: &serde_json::Value) {
    let cells = cells.as_array().unwrap();
    let is_wall: Vec<bool> = cells.iter().map(|cell| *cell == 100).collect();
    assert!(cells.len() == 1600 && is_wall.iter().enumerate().all(|(at, is_wall)| *is_wall == (at < 300)), "{cells:?}");
}

/// The libraries of ROS 2 read each message of an output log as `gridweave cat` prints it.
#[test]
#[ignore = "needs a Python with rclpy, named by GRIDWEAVE_ROS_PYTHON"]
fn messages_of_a_log_are_what_ros_reads() {
    let (folder, domain) = (TempDir::new().unwrap(), Domain::new());
    let folder = folder.path();
    simulate(folder);
    run(GRIDWEAVE, &["merge", "in.mcap", "-o", "merged.mcap"], folder);
    let read = lines(&start("rclpy_nodes.py", &domain, &["read_log", "merged.mcap"], folder).end_with(0));
    let kinds: BTreeSet<&str> = read.iter().map(|line| line["type"].as_str().unwrap()).collect();
    for kind in [OccupancyGrid::NAME, PoseStamped::NAME, "nav_msgs/msg/Path", "visualization_msgs/msg/MarkerArray"] {
        assert!(kinds.contains(kind), "{kinds:?}");
    }
    let printed = lines(&run(GRIDWEAVE, &["cat", "merged.mcap"], folder));
    let printed: Vec<_> = printed.into_iter().filter(|line| kinds.contains(line["type"].as_str().unwrap())).collect();
    assert_alike(&read, &printed);
}

/// Lines of JSON.
pub(crate) fn lines(text: &str) -> Vec<serde_json::Value> {
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// Messages as ROS reads them are what `gridweave cat` prints.
#[track_caller]
pub(crate) fn assert_alike(read: &[serde_json::Value], printed: &[serde_json::Value]) {
    assert_eq!(read.len(), printed.len());
    for (read, printed) in read.iter().zip(printed) {
        assert_eq!(read["topic"], printed["topic"]);
        assert!(is_alike(&read["message"], &printed["message"]), "{read}\n{printed}");
    }
}

/// Whether two messages have the same values. Of a number of 32 bits Python prints more digits.
fn is_alike(one: &serde_json::Value, other: &serde_json::Value) -> bool {
    use serde_json::Value::{Array, Number, Object};
    match (one, other) {
        (Number(a), Number(b)) => a == b || a.as_f64() == b.as_f64() || is_equal_in_32_bits(a.as_f64(), b.as_f64()),
        (Array(a), Array(b)) => a.len() == b.len() && a.iter().zip(b).all(|(a, b)| is_alike(a, b)),
        (Object(a), Object(b)) => {
            a.len() == b.len() && a.iter().all(|(key, a)| b.get(key).is_some_and(|b| is_alike(a, b)))
        }
        (a, b) => a == b,
    }
}

fn is_equal_in_32_bits(a: Option<f64>, b: Option<f64>) -> bool {
    // Only one of them is a number of 32 bits: the other has fewer digits.
    a.zip(b).is_some_and(|(a, b)| a as f32 == b as f32 && f64::from(a as f32) == a)
}

/// The packages state the hash of each type beside its definition.
#[test]
#[ignore = "needs a Python with rclpy, named by GRIDWEAVE_ROS_PYTHON"]
fn hashes_of_types_are_those_of_the_packages() {
    let python = python();
    let share = Path::new(&python).parent().unwrap().join("../share");
    let compared = compare_hashes(&share, &PACKAGES);
    assert!(compared.len() > PACKAGES.len(), "{compared:?}");
}

/// Compares the hashes that packages in a folder state with those of the types that are known here, and gives the names
/// of these. Which types no package there has is printed; of `needed` packages each type must be there.
#[track_caller]
pub(crate) fn compare_hashes(share: &Path, needed: &[&str]) -> BTreeSet<String> {
    let stated = stated_hashes(share);
    let (mut compared, mut skipped) = (BTreeSet::new(), BTreeSet::new());
    // The built-in definition is that of logs before Iron; `ros_source` knows both.
    for name in schema_names().filter(|name| name != "sensor_msgs/msg/Range") {
        match stated.get(&name) {
            Some(stated) => {
                assert_eq!(known_hash(&name).as_ref(), Some(stated), "{name}");
                compared.insert(name);
            }
            None => _ = skipped.insert(name),
        }
    }
    // What a macro prints is not shown of a test that passes.
    let mut shown = std::io::stderr();
    writeln!(shown, "in no package in {}: {skipped:?}", share.display()).unwrap();
    for package in needed {
        let is_of = |name: &&String| name.split('/').next() == Some(*package);
        assert!(compared.iter().any(|name| is_of(&name)), "{package}: {compared:?}");
        assert_eq!(skipped.iter().find(is_of), None, "{package} lacks a type that is known here");
    }
    compared
}

/// The hashes of types that packages in a folder state.
fn stated_hashes(share: &Path) -> BTreeMap<String, String> {
    let mut hashes = BTreeMap::new();
    for package in std::fs::read_dir(share).unwrap() {
        let Ok(types) = std::fs::read_dir(package.unwrap().path().join("msg")) else { continue };
        let files =
            types.map(|file| file.unwrap().path()).filter(|path| path.extension().is_some_and(|end| end == "json"));
        for file in files {
            let stated: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(file).unwrap()).unwrap();
            let text = |value: &serde_json::Value| value.as_str().unwrap().to_owned();
            let of_file = stated["type_hashes"].as_array().unwrap().iter();
            hashes.extend(of_file.map(|stated| (text(&stated["type_name"]), text(&stated["hash_string"]))));
        }
    }
    hashes
}

/// Publishes until there is a warning.
#[track_caller]
fn go_on_sending(sink: &mut StageHarness, words: &str) {
    let until = std::time::Instant::now() + crate::wire::WATCHDOG;
    while !sink.warnings().keys().any(|text| text.contains(words)) {
        assert!(std::time::Instant::now() < until, "{:?}", sink.warnings());
        give(sink, 0, "/odd", encode(&PoseStamped::default()).unwrap());
        std::thread::yield_now();
    }
}

#[test]
#[ignore = "needs a Python with rclpy, named by GRIDWEAVE_ROS_PYTHON"]
fn a_topic_without_maps_is_reported_and_the_others_received() {
    let (folder, domain) = (TempDir::new().unwrap(), Domain::new());
    let mut source = domain.source("");
    let _odd = rclpy(&domain, &["publish_strings", "/robot1/map"], folder.path());
    assert!(warned(&mut source, "/robot1/map").contains("std_msgs/msg/String"));
    let _robot = rclpy(&domain, &["publish_map", "/robot2/map", "20", "0"], folder.path());
    let mut robots = Vec::new();
    wait_for(&mut source, "map of robot2", |source| {
        robots.extend(source.take_messages("map").iter().map(|message| message.robot().to_owned()));
        robots.contains(&"robot2".to_owned())
    });
}
