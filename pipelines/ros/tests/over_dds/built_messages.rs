//! The package `gridweave_msgs`, built as a user of ROS builds it, and what nodes of ROS read with it and others.

use crate::command::{GRIDWEAVE, Running, run};
use crate::domain::Domain;
use crate::ros_nodes::{
    assert_alike, assert_has_walls, by_updates, compare_hashes, lines, python, script, simulate, start_in,
};
use crate::waiting::give;
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{Header, OccupancyGrid, RosMessage, TFMessage, TransformStamped, encode};
use std::collections::BTreeSet;
use std::path::Path;
use tempfile::TempDir;

#[test]
#[ignore = "needs a Python with what is in ros_jazzy_build.txt, named by GRIDWEAVE_ROS_PYTHON, and compilers of C and C++"]
fn built_messages_are_read_by_ros_as_cat_prints_them() {
    let python = python();
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let build = script("build_messages.py").display().to_string();
    run(&python, &[&build, "ros"], folder);
    let compared = compare_hashes(&folder.join("ros/install/share"), &["gridweave_msgs", "map_msgs", "tf2_msgs"]);
    let ours = compared.iter().filter(|name| name.starts_with("gridweave_msgs/")).count();
    let definitions = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../logs/msg/gridweave_msgs/msg");
    assert_eq!(ours, std::fs::read_dir(definitions).unwrap().count());

    simulate(folder);
    run(GRIDWEAVE, &["merge", "in.mcap", "-o", "merged.mcap"], folder);

    let nodes = script("rclpy_nodes.py");
    let read = format!(". ros/install/local_setup.sh && exec {python} {} read_log merged.mcap", nodes.display());
    let mut reading = Running::start("sh", &["-c", &read], folder, "reading.log");
    let is_ours = |line: &serde_json::Value| line["type"].as_str().unwrap().starts_with("gridweave_msgs/");
    let read: Vec<_> = lines(&reading.end_with(0)).into_iter().filter(is_ours).collect();
    let printed: Vec<_> = lines(&run(GRIDWEAVE, &["cat", "merged.mcap"], folder)).into_iter().filter(is_ours).collect();
    assert_alike(&read, &printed);
    let kinds: BTreeSet<&str> = read.iter().map(|line| line["type"].as_str().unwrap()).collect();
    for kind in ["TagRange", "RobotFrames", "Verdicts", "MapDeformation"] {
        assert!(kinds.contains(format!("gridweave_msgs/msg/{kind}").as_str()), "{kinds:?}");
    }
    updates_and_transforms_are_read(folder);
}

/// A node of ROS follows the merged map by its updates, and has the frames.
#[track_caller]
fn updates_and_transforms_are_read(folder: &Path) {
    let domain = Domain::new();
    let mut sink = domain.sink("gridweave_ros", &[(OccupancyGrid::NAME, "/map"), (TFMessage::NAME, "/tf_static")]);
    let mut transform = TransformStamped { child_frame_id: "robot1/map".into(), ..Default::default() };
    transform.header = Header::new(LogTime(1_000_000_000), "world");
    (transform.transform.translation.x, transform.transform.rotation.w) = (2.5, 1.0);
    give(&mut sink, 1, "/tf_static", encode(&TFMessage { transforms: vec![transform] }).unwrap());
    let (python, nodes) = (python(), script("rclpy_nodes.py"));
    let follow = format!(". ros/install/local_setup.sh && exec {python} {} follow 3 300 60", nodes.display());
    let mut viewer = start_in(&domain, &["sh".into(), "-c".into(), follow], folder, "following.log");
    let seen: serde_json::Value = serde_json::from_str(&by_updates(&mut sink, &mut viewer)).unwrap();
    assert_has_walls(&seen[0]);
    assert_eq!(seen[1], serde_json::json!({ "robot1/map": ["world", 2.5, 0.0] }));
}
