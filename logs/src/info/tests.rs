use super::*;
use crate::sink::{LogOptions, LogWriter, Outcome};
use crate::test_log::{Folder, TestLog, layouts};
use gridweave_runtime::ros::{OccupancyGrid, PoseStamped, RosMessage, TagRange};

fn reading(tag: &str) -> TagRange {
    TagRange { tag_id: tag.into(), range: 1.0, ..Default::default() }
}

fn two_robots() -> TestLog {
    let mut log = TestLog::new(layouts()[3].clone());
    let second = 1_000_000_000;
    for robot in ["robot1", "robot2"] {
        log.add(&format!("/{robot}/map"), OccupancyGrid::NAME, second, &OccupancyGrid::default())
            .add(&format!("/{robot}/pose"), PoseStamped::NAME, 2 * second, &PoseStamped::default())
            .add(&format!("/{robot}/tag_ranges"), TagRange::NAME, 3 * second, &reading("a"))
            .add(&format!("/{robot}/tag_ranges"), TagRange::NAME, 4 * second, &reading("b"))
            .add(&format!("/{robot}/tag_ranges"), TagRange::NAME, 5 * second, &reading("a"));
    }
    log
}

fn inspect_bytes(bytes: &[u8]) -> LogInfo {
    let folder = Folder::new();
    let log = Input { robot: None, path: folder.write("a.mcap", bytes) };
    inspect(&[log], &NameRules::default(), &RobotTopics::default()).unwrap()
}

#[test]
fn topics_robots_and_times_are_told() {
    let info = inspect_bytes(&two_robots().finish());
    assert_eq!((info.messages, info.start, info.end, info.duration), (10, Some(1.0), Some(5.0), 4.0));
    assert_eq!(info.topics.len(), 6);
    let tags = &info.topics[2];
    assert_eq!((tags.topic.as_str(), tags.messages, tags.first, tags.last), ("/robot1/tag_ranges", 3, 3.0, 5.0));
    let robot = &info.robots["robot2"];
    assert_eq!((robot.maps, robot.poses, robot.readings), (1, 1, 3));
    assert_eq!(robot.tags, BTreeMap::from([("a".into(), 2), ("b".into(), 1)]));
    assert_eq!(robot.topics.len(), 3);
    assert_eq!(info.files[0].compression, ["zstd"]);
    assert_eq!(info.problems, [""; 0]);
    assert!(serde_json::to_string(&info).unwrap().contains("\"type\":\"nav_msgs/msg/OccupancyGrid\""));
}

#[test]
fn what_stands_in_the_way_of_a_merge_is_told() {
    let mut log = TestLog::new(layouts()[0].clone());
    log.add("/r/slam/map", OccupancyGrid::NAME, 1, &OccupancyGrid::default())
        .add("/r/tag_ranges", TagRange::NAME, 2, &reading("a"))
        .raw("/r/tag_ranges", TagRange::NAME, 3, b"cut")
        .raw("/r/pose", "p/msg/Other", 4, b"");
    let mut bytes = log.finish();
    bytes.truncate(bytes.len() - 30);
    let problems = inspect_bytes(&bytes).problems.join("\n");
    for part in [
        "has no end",
        "carries p/msg/Other",
        "1 messages on `/r/tag_ranges`",
        "`robots.map`",
        "one robot only, r",
        "no pose of r",
    ] {
        assert!(problems.contains(part), "{part} is not in\n{problems}");
    }
    let empty = inspect_bytes(&TestLog::new(layouts()[0].clone()).finish());
    assert_eq!(empty.problems, ["there are no messages"]);
}

#[test]
fn a_log_whose_run_ended_early_says_so() {
    let folder = Folder::new();
    let path = folder.path().join("a.mcap");
    for (outcome, expected) in [
        (Outcome::Incomplete("it was late"), Some("ended early, and the log with it: it was late")),
        (Outcome::Complete, None),
    ] {
        let log = LogWriter::create(&path, LogOptions::default()).unwrap();
        log.finish(outcome).unwrap();
        let info = inspect(&[Input::new(&path)], &NameRules::default(), &RobotTopics::default()).unwrap();
        let said = info.problems.iter().any(|problem| problem.contains(expected.unwrap_or("ended early")));
        assert_eq!(said, expected.is_some(), "{:?}", info.problems);
    }
}
