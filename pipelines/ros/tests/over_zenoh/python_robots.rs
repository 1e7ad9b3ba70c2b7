//! The whole command between programs that others have written: robots and a viewer in Python, by `eclipse-zenoh` and
//! `rosbags`, which have type hashes and an encoding of their own; and by `zenoh-ros2-sdk`, which has keys, tokens and
//! attachments of its own, too.

use crate::command::{GRIDWEAVE, Running, run};
use crate::wire::Router;
use std::ffi::OsStr;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

fn script(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python").join(name)
}

/// The interpreter of a virtual environment with the libraries.
fn python(folder: &Path) -> PathBuf {
    let environment = folder.join("python");
    run("python3", &["-m", "venv", environment.to_str().unwrap()], folder);
    let python = environment.join("bin/python");
    let requirements = script("requirements.txt");
    let install = ["-m", "pip", "install", "--quiet", "--only-binary", ":all:", "--requirement"];
    let install: Vec<&str> = install.into_iter().chain([requirements.to_str().unwrap()]).collect();
    run(&python, &install, folder);
    python
}

#[test]
#[ignore = "needs python3 with venv, and the network"]
fn robots_and_a_viewer_of_others_have_one_map() {
    one_map("live_ros.toml", "/{robot}/map,/{robot}/pose,/{robot}/tag_ranges", ["robots.py", "viewer.py"], &[]);
}

#[test]
#[ignore = "needs python3 with venv, and the network"]
fn robots_and_a_viewer_of_zenoh_ros2_sdk_have_one_map() {
    let topics = "/{robot}/map,/{robot}/pose,/{robot}/tag_ranges";
    one_map("live_ros.toml", topics, ["sdk_robots.py", "sdk_viewer.py"], &[]);
}

#[test]
#[ignore = "needs python3 with venv, and the network"]
fn robots_with_scans_and_without_maps_have_one_map() {
    let wait = ["--set", "robots.wait_for_map=1"];
    let topics = "/{robot}/scan,/{robot}/pose,/{robot}/tag_ranges";
    one_map("live_ros_scans.toml", topics, ["robots.py", "viewer.py"], &wait);
}

/// Plays two simulated robots, which publish these topics, to a pipeline, and holds what a viewer sees and what was
/// found against the truth. The scripts are that of the robots and that of the viewer.
fn one_map(pipeline: &str, topics: &str, scripts: [&str; 2], more: &[&str]) {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let python = python(folder);
    let building =
        ["width=12", "height=10", "drift=0", "overlap=0.9", "tags=24", "beams=180", "duration=60", "scans=true"];
    let building = building.into_iter().flat_map(|setting| ["--set", setting]);
    let simulate: Vec<&str> = ["simulate", "-o", "in.mcap", "--robots", "2"].into_iter().chain(building).collect();
    run(GRIDWEAVE, &simulate, folder);
    run(GRIDWEAVE, &["filter", "in.mcap", "-o", "robots.mcap", "--topics", topics], folder);

    let router = Router::start();
    let connect = ["robots", "ros"].into_iter().flat_map(|stage| {
        [format!("{stage}.middleware=\"zenoh\""), format!("{stage}.connect=[\"{}\"]", router.endpoint())]
    });
    let connect: Vec<String> = connect.collect();
    let pipeline = Path::new(env!("CARGO_MANIFEST_DIR")).join(pipeline);
    let arguments: Vec<&OsStr> = ["run".as_ref(), pipeline.as_os_str()]
        .into_iter()
        .chain(["--summary".as_ref(), "summary.json".as_ref()])
        .chain(connect.iter().flat_map(|set| ["--set".as_ref(), OsStr::new(set.as_str())]))
        .chain(more.iter().map(OsStr::new))
        .collect();
    let mut merging = Running::start(GRIDWEAVE, &arguments, folder, "merging.log");
    let words =
        |what: &str| format!("{what}: {}", std::fs::read_to_string(folder.join("merging.log")).unwrap_or_default());

    let [robots, viewer] = scripts.map(script);
    let definitions = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../logs/msg");
    let play = |log: &str| {
        let (endpoint, definitions) = (router.endpoint().as_ref(), definitions.as_os_str());
        let args = [robots.as_os_str(), endpoint, "robots.mcap".as_ref(), "4".as_ref(), definitions];
        Running::start(&python, &args, folder, log)
    };
    let mut playing = play("robots.log");
    let mut line = String::new();
    BufReader::new(playing.stdout()).read_line(&mut line).unwrap();
    assert_eq!(line, "all is sent\n", "{}", std::fs::read_to_string(folder.join("robots.log")).unwrap());

    // One who comes when all was sent sees the map and the frames all the same, and so does one who comes later still.
    for _ in 0..2 {
        let (endpoint, definitions) = (router.endpoint().as_ref(), definitions.as_os_str());
        let args = [viewer.as_os_str(), endpoint, "2".as_ref(), "200".as_ref(), definitions];
        let (status, seen) = Running::start(&python, &args, folder, "viewer.log").end();
        let errors = std::fs::read_to_string(folder.join("viewer.log")).unwrap();
        assert_eq!(status, 0, "{}", words(&errors));
        let seen: serde_json::Value = serde_json::from_str(&seen).unwrap();
        assert_eq!(seen["map"]["frame"], "world");
        assert!(seen["map"]["known"].as_u64().unwrap() > 1000, "{seen}");
        let frame = |robot: &str| seen["frames"][format!("{robot}/map")].clone();
        assert_eq!(
            (frame("robot1")["parent"].as_str(), frame("robot2")["parent"].as_str()),
            (Some("world"), Some("world"))
        );
        assert_eq!(seen["publishers"]["/map"], "nav_msgs::msg::dds_::OccupancyGrid_");
        assert_eq!(seen["publishers"]["/tf_static"], "tf2_msgs::msg::dds_::TFMessage_");
    }
    // Robots that end and come again do no harm.
    drop(playing);
    let mut again = play("again.log");
    let mut line = String::new();
    BufReader::new(again.stdout()).read_line(&mut line).unwrap();
    assert_eq!(line, "all is sent\n");

    merging.signal("INT");
    merging.end_with(0);
    let summary = folder.join("summary.json");
    run(GRIDWEAVE, &["evaluate", summary.to_str().unwrap(), "--truth", "in.truth.json"], folder);
}
