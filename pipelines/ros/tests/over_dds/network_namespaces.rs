//! Robots on one machine and the merge on another, each in a network namespace of its own: they find each other by
//! multicast, as ROS 2 does where nothing is set.

use crate::command::{GRIDWEAVE, run};
use crate::ros_nodes::{python, script, simulate};
use std::path::Path;
use tempfile::TempDir;

#[test]
#[ignore = "needs the right to make network namespaces, and a Python with rclpy, named by GRIDWEAVE_ROS_PYTHON"]
fn network_namespaces_of_robots_and_a_merge_find_each_other_by_multicast() {
    let python = python();
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    simulate(folder);
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    let (nodes, pipeline) = (script("rclpy_nodes.py"), tests.join("../live_ros.toml"));
    let (nodes, pipeline) = (nodes.display(), pipeline.display());
    // Neither knows an address of the other.
    let environment = "env -u ROS_LOCALHOST_ONLY -u ROS_STATIC_PEERS ROS_DOMAIN_ID=7 ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET ROS_LOG_DIR=.";
    let rclpy = format!("{environment} RMW_IMPLEMENTATION=rmw_fastrtps_cpp {python} {nodes}");
    // The robots stay until their standard input ends.
    let robots = format!(
        "mkfifo hold && {{ {rclpy} robots in.mcap 6 < hold & }} && exec 3> hold && \
         {rclpy} view 30000 200 > seen.json; status=$?; exec 3>&-; wait; exit $status"
    );
    let dds = ["robots", "ros"].map(|stage| format!("--set {stage}.middleware=dds")).join(" ");
    let merge =
        format!("exec {environment} {GRIDWEAVE} run {pipeline} {dds} --summary summary.json > merging.txt 2>&1");
    let link = tests.join("network/two_machines.py");
    let arguments = ["--user", "--map-root-user", "--net", "python3", link.to_str().unwrap(), &robots, &merge];
    run("unshare", &arguments, folder);

    let seen: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(folder.join("seen.json")).unwrap()).unwrap();
    assert_eq!((&seen["map"]["frame"], &seen["publisher"][0]), (&"world".into(), &"gridweave_ros".into()), "{seen}");
    let text = std::fs::read_to_string(folder.join("merging.txt")).unwrap();
    // Where the machine is busy, the robots start late, and the run rightly says that it hears none so far.
    let is_unexpected = |line: &str| line.starts_with("warning") && !line.contains("nobody publishes");
    assert!(!text.lines().any(is_unexpected), "{text}");
    run(GRIDWEAVE, &["evaluate", "summary.json", "--truth", "in.truth.json"], folder);
}
