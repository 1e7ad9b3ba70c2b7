//! What does not fit is reported once, and the rest goes on.

use crate::command::{GRIDWEAVE, Running, run};
use crate::domain::{Domain, map};
use crate::waiting::{give, sent, warned};
use gridweave_runtime::ros::{OccupancyGrid, PoseStamped, RosMessage, encode};

#[test]
fn two_robots_of_one_name_are_reported_with_the_names_of_their_nodes() {
    let domain = Domain::new();
    let mut source = domain.source("");
    let mut robots = ["slam_a", "slam_b"].map(|node| domain.sink(node, &[(OccupancyGrid::NAME, "/robot1/map")]));
    robots.iter_mut().for_each(|robot| give(robot, 0, "/robot1/map", map(20, 1)));
    let text = warned(&mut source, "2 programs at once");
    assert!(text.contains("/slam_a") && text.contains("/slam_b"), "{text}");
    sent(&mut source, "map", 1);
}

#[test]
fn a_topic_of_another_type_is_reported_and_the_others_received() {
    let domain = Domain::new();
    let mut source = domain.source("");
    let mut robot = domain.sink("slam", &[(PoseStamped::NAME, "/robot1/map"), (OccupancyGrid::NAME, "/robot2/map")]);
    give(&mut robot, 0, "/robot1/map", encode(&PoseStamped::default()).unwrap());
    give(&mut robot, 1, "/robot2/map", map(20, 1));
    warned(&mut source, "/robot1/map");
    assert_eq!(sent(&mut source, "map", 1)[0].robot(), "robot2");
}

#[test]
fn what_gridweave_publishes_is_no_map_of_a_robot() {
    let domain = Domain::new();
    let mut source = domain.source("");
    let wires = [(OccupancyGrid::NAME, "/fleet/map")];
    // Of this run, and of another one.
    let mut runs = [domain.sink_with("node = \"merger\"", &wires, None), domain.other_run("other", &wires)];
    runs.iter_mut().for_each(|run| give(run, 0, "/fleet/map", map(20, 1)));
    let mut same_topic = domain.other_run("same_topic", &[(OccupancyGrid::NAME, "/robot1/map")]);
    give(&mut same_topic, 0, "/robot1/map", map(40, 1));
    let text = warned(&mut source, "`/fleet/map`");
    assert!(text.contains("another run of Gridweave") && text.contains("/other"), "{text}");
    // What they have sent would have come before.
    let mut robot = domain.sink("slam", &[(OccupancyGrid::NAME, "/robot1/map")]);
    give(&mut robot, 0, "/robot1/map", map(20, 1));
    for value in 2..5 {
        for message in sent(&mut source, "map", 1) {
            let grid: OccupancyGrid<'_> = message.decode().unwrap();
            assert_eq!((message.robot(), grid.info.width), ("robot1", 20));
        }
        give(&mut robot, 0, "/robot1/map", map(20, value));
    }
    assert_eq!(source.warnings().len(), 2, "{:?}", source.warnings());

    let text = doctor(&domain, "robot1 has a map");
    assert!(
        !text.contains("fleet has") && text.contains("2 runs of Gridweave publish `/fleet/map`, by /merger and /other"),
        "{text}"
    );
}

#[test]
fn a_second_run_that_publishes_the_same_is_reported_by_name() {
    let domain = Domain::new();
    let wires = [(OccupancyGrid::NAME, "/map")];
    let mut other = domain.other_run("other", &wires);
    give(&mut other, 0, "/map", map(20, 1));
    let mut sink = domain.sink_with("", &wires, None);
    let until = std::time::Instant::now() + crate::wire::WATCHDOG;
    while sink.warnings().is_empty() {
        assert!(std::time::Instant::now() < until, "there is no warning");
        give(&mut sink, 0, "/map", map(20, 2));
        std::thread::yield_now();
    }
    doctor(&domain, "2 runs of Gridweave publish `/map`");
    give(&mut sink, 0, "/map", map(20, 3));
    let warnings: Vec<(String, u64)> = sink.warnings().into_iter().collect();
    let [(text, 1)] = warnings.as_slice() else { panic!("{warnings:?}") };
    assert!(
        text.contains("/other of another run of Gridweave publishes what this run publishes, at first `/map`"),
        "{text}"
    );
}

#[test]
fn maps_that_fit_no_robot_are_reported_with_advice() {
    let domain = Domain::new();
    let mut source = domain.source("discovery_timeout = 0.2");
    let mut robot = domain.sink("slam", &[(OccupancyGrid::NAME, "/map")]);
    give(&mut robot, 0, "/map", map(20, 1));
    let text = warned(&mut source, "no robot publishes a map on `/{robot}/map`");
    assert!(text.contains("-r /map:=map") && text.contains("/slam"), "{text}");
}

#[test]
fn an_empty_domain_is_reported() {
    let domain = Domain::new();
    let mut source = domain.source("discovery_timeout = 0.2");
    let text = warned(&mut source, "nobody publishes over DDS");
    assert!(text.contains(&format!("domain {}", domain.number())), "{text}");
}

/// What the doctor says, once it says these words.
#[track_caller]
fn doctor(domain: &Domain, words: &str) -> String {
    let folder = tempfile::TempDir::new().unwrap();
    let number = format!("domain={}", domain.number());
    let settings = ["middleware=dds", "discovery_range=localhost", &number].into_iter().flat_map(|set| ["--set", set]);
    let arguments: Vec<&str> = ["doctor", "--seconds", "0.5"].into_iter().chain(settings).collect();
    let until = std::time::Instant::now() + crate::wire::WATCHDOG;
    loop {
        let text = run(GRIDWEAVE, &arguments, folder.path());
        if text.contains(words) {
            return text;
        }
        assert!(std::time::Instant::now() < until, "{text}");
    }
}

#[test]
fn the_doctor_lists_the_publishers_and_what_a_merge_lacks() {
    let domain = Domain::new();
    let mut first = domain.sink("slam_a", &[(OccupancyGrid::NAME, "/robot1/map")]);
    give(&mut first, 0, "/robot1/map", map(20, 1));
    let text = doctor(&domain, "robot1 has a map");
    for words in ["/robot1/map", OccupancyGrid::NAME, "reliable, transient local", "/slam_a", "DDS", "there are 1"] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let mut second = domain.sink("slam_b", &[(OccupancyGrid::NAME, "/robot2/map")]);
    give(&mut second, 0, "/robot2/map", map(20, 1));
    let text = doctor(&domain, "robot2 has a map");
    assert!(text.contains("gridweave-ros run live_ros"), "{text}");
}

#[test]
fn the_doctor_says_how_to_name_maps_on_other_topics() {
    let domain = Domain::new();
    let topics = [(OccupancyGrid::NAME, "/fleet/a/map"), (OccupancyGrid::NAME, "/fleet/b/map")];
    let mut robots = domain.sink("slam", &topics);
    give(&mut robots, 0, "/fleet/a/map", map(20, 1));
    give(&mut robots, 1, "/fleet/b/map", map(20, 1));
    let text = doctor(&domain, "/fleet/b/map");
    assert!(text.contains("map = \"/fleet/{robot}/map\""), "{text}");
}

#[test]
fn arguments_of_ros_are_refused_with_what_to_write_instead() {
    let folder = tempfile::TempDir::new().unwrap();
    let mut running =
        Running::start(GRIDWEAVE, &["run", "a.toml", "--ros-args", "-r", "/map:=/b"], folder.path(), "log");
    running.end_with(2);
    let errors = running.errors();
    assert!(errors.contains("--set ros.rename='[\"/map=/b\"]'") && errors.lines().count() <= 3, "{errors}");
}
