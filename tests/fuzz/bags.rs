//! ROS 2 bags: a folder with a description and a log.

use super::input::Input;
use super::mcap_logs::small_log;
use super::target::Target;
use gridweave_logs::reader;
use mcap::WriteOptions;
use std::path::Path;

/// As `ros2 bag record` writes it.
const DESCRIPTION: &str = "rosbag2_bagfile_information:
  version: 5
  storage_identifier: mcap
  duration:
    nanoseconds: 3
  starting_time:
    nanoseconds_since_epoch: 1
  message_count: 8
  topics_with_message_count:
    - topic_metadata:
        name: /robot1/map
        type: nav_msgs/msg/OccupancyGrid
        serialization_format: cdr
        offered_qos_profiles: \"- history: 3\\n  depth: 0\"
      message_count: 2
  compression_format: \"\"
  compression_mode: \"\"
  relative_file_paths:
    - bag_0.mcap
  files:
    - path: bag_0.mcap
      starting_time:
        nanoseconds_since_epoch: 1
";

#[test]
fn every_bag_is_read_or_refused() {
    let log = small_log(WriteOptions::new().compression(None));
    Target {
        name: "bags",
        files: &["metadata.yaml", "bag_0.mcap"],
        seeds: vec![Input(vec![DESCRIPTION.into(), log])],
        words: &["relative_file_paths:\n", "- ", "&a [*a, *a]", "<<: *a", "[", "{", ".", "..", "/", "sqlite3", "\n  "],
        cases: 3000,
        read,
    }
    .check();
}

fn read(folder: &Path) {
    match reader::open(&[folder.to_owned()]) {
        Ok(mut log) => while log.next_message().is_some() {},
        Err(error) => drop(error.to_string()),
    }
}
