//! The package `gridweave_msgs`, built as a user of ROS builds it.

use crate::command::{GRIDWEAVE, Running, run};
use crate::ros_nodes::{assert_alike, compare_hashes, lines, script, simulate};
use std::collections::BTreeSet;
use std::path::Path;
use tempfile::TempDir;

#[test]
#[ignore = "needs a Python with what is in ros_jazzy_build.txt, named by GRIDWEAVE_ROS_PYTHON, and compilers of C and C++"]
fn built_messages_are_read_by_ros_as_cat_prints_them() {
    let python = std::env::var("GRIDWEAVE_ROS_PYTHON").expect("GRIDWEAVE_ROS_PYTHON names a Python with rclpy");
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let build = script("build_messages.py").display().to_string();
    run(&python, &[&build, "ros"], folder);
    let compared = compare_hashes(&folder.join("ros/install/gridweave_msgs/share"), &["gridweave_msgs"]);
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
}
