use super::*;
use crate::sink::{LogOptions, LogWriter, Outcome};
use crate::test_log::{Folder, TestLog, layouts};
use gridweave_runtime::ros::{Header, MapMetaData, OccupancyGrid, PoseStamped, RosMessage, TagRange};

fn reading(tag: &str) -> TagRange {
    TagRange { tag_id: tag.into(), range: 1.0, ..Default::default() }
}

/// A map without cells in a frame.
fn map_in(frame: &str) -> OccupancyGrid<'static> {
    let info = MapMetaData { resolution: 0.05, ..Default::default() };
    OccupancyGrid { header: Header::new(LogTime(1), frame), info, ..Default::default() }
}

fn two_robots() -> TestLog {
    let mut log = TestLog::new(layouts()[3].clone());
    let second = 1_000_000_000;
    for robot in ["robot1", "robot2"] {
        log.add(&format!("/{robot}/map"), OccupancyGrid::NAME, second, &map_in("map"))
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
fn topics_robots_and_times_are_reported() {
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
fn problems_for_a_merge_are_reported() {
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
fn maps_that_cannot_be_used_and_merged_maps_are_reported() {
    let mut log = two_robots();
    let unusable = OccupancyGrid { info: MapMetaData { width: 3, height: 1, ..map_in("").info }, ..map_in("map") };
    // The clock of the other program is an hour late.
    let late = OccupancyGrid { header: Header::new(LogTime(3_607_000_000_000), "world"), ..map_in("world") };
    log.add("/robot2/map", OccupancyGrid::NAME, 6_000_000_000, &unusable).add(
        "/map_merge/map",
        OccupancyGrid::NAME,
        7_000_000_000,
        &late,
    );
    let info = inspect_bytes(&log.finish());
    assert_eq!(info.robots.keys().collect::<Vec<_>>(), ["robot1", "robot2"]);
    for problem in [
        "1 of the maps of robot2 cannot be used: it has 0 cells, but its size is 3 x 1",
        "maps on `/map_merge/map` are merged ones of another program, and are not taken as a robot's; if they are a robot's, \
         give --robots map_merge,robot1,robot2",
    ] {
        assert!(info.problems.iter().any(|known| known == problem), "{:?}", info.problems);
    }
    let of_merged = info.problems.iter().filter(|problem| problem.contains("map_merge"));
    assert_eq!(of_merged.count(), 1, "nothing else of it is of interest: {:?}", info.problems);
}

#[test]
fn maps_of_types_that_are_not_read_are_named_with_what_to_record() {
    let mut log = TestLog::new(layouts()[0].clone());
    log.raw("/robot1/octomap_binary", "octomap_msgs/msg/Octomap", 1, b"");
    log.raw("/robot2/submap_list", "cartographer_ros_msgs/SubmapList", 2, b"");
    let problems = inspect_bytes(&log.finish()).problems.join("\n");
    for part in [
        "`/robot1/octomap_binary` has octomap_msgs/msg/Octomap, which is not read as a map: record the grid that octomap_server",
        "`/robot2/submap_list` has cartographer_ros_msgs/msg/SubmapList",
    ] {
        assert!(problems.contains(part), "{problems}");
    }
    let mut with_maps = two_robots();
    with_maps.raw("/robot1/octomap_binary", "octomap_msgs/msg/Octomap", 6_000_000_000, b"");
    assert_eq!(inspect_bytes(&with_maps.finish()).problems, [""; 0]);
}

#[test]
fn other_units_and_exchanged_values_are_reported_once() {
    let mut log = TestLog::new(layouts()[0].clone());
    let info = MapMetaData { width: 200, height: 100, resolution: 5.0, ..Default::default() };
    let cells: Vec<u8> = (0..20_000).map(|index| u8::from(index % 50 > 0)).collect();
    for second in 1..20 {
        let map = OccupancyGrid { info, data: &cells, ..map_in("map") };
        log.add("/r/map", OccupancyGrid::NAME, second, &map);
        log.add("/r/tag_ranges", TagRange::NAME, second, &TagRange { range: 5230.0, ..reading("a") });
    }
    let problems = inspect_bytes(&log.finish()).problems;
    for start in [
        "maps on `/r/map`: cells of 5 m make a map of 1000 m by 500 m",
        "maps on `/r/map`: 19600 cells have the value 1 and 400 the value 0",
        "tags on `/r/tag_ranges`: ranges of 5230 m are too long",
    ] {
        let found = problems.iter().filter(|problem| problem.starts_with(start));
        assert_eq!(found.count(), 1, "{start}: {problems:?}");
    }
}

#[test]
fn scans_of_two_robots_on_one_topic_are_a_problem() {
    use gridweave_runtime::ros::LaserScan;
    let mut log = TestLog::new(layouts()[3].clone());
    for (second, frame) in [(1, "robot1/laser"), (2, "robot2/laser")] {
        let scan = LaserScan { header: Header::new(LogTime(1), frame), ..Default::default() };
        log.add("/scan", LaserScan::NAME, second, &scan);
    }
    let problems = inspect_bytes(&log.finish()).problems;
    let expected = "`/scan` has the messages of several robots, by their frames robot1/laser and robot2/laser";
    assert!(problems.iter().any(|problem| problem.starts_with(expected)), "{problems:?}");
}

#[test]
fn the_option_that_renames_topics_of_maps_is_advised() {
    let mut log = TestLog::new(layouts()[0].clone());
    log.add("/fleet/a/map", OccupancyGrid::NAME, 1, &map_in("a/map"));
    log.add("/fleet/b/map", OccupancyGrid::NAME, 2, &map_in("b/map"));
    let problems = inspect_bytes(&log.finish()).problems;
    let advice = "maps on /fleet/a/map and /fleet/b/map do not fit `/{robot}/map`: give --rename '/fleet/{robot}/map=/{robot}/map'";
    assert_eq!(problems, [advice]);
}

#[test]
fn a_log_whose_run_ended_early_is_reported() {
    let folder = Folder::new();
    let path = folder.path().join("a.mcap");
    for (outcome, expected) in [
        (Outcome::Incomplete("it was late"), Some("ended early, and the log with it: it was late")),
        (Outcome::Complete, None),
    ] {
        let log = LogWriter::create(&path, LogOptions::default()).unwrap();
        log.finish(outcome).unwrap();
        let info = inspect(&[Input::new(&path)], &NameRules::default(), &RobotTopics::default()).unwrap();
        let text = info.problems.iter().any(|problem| problem.contains(expected.unwrap_or("ended early")));
        assert_eq!(text, expected.is_some(), "{:?}", info.problems);
    }
}

#[test]
fn the_source_of_poses_is_reported() {
    use gridweave_runtime::message::LogTime;
    use gridweave_runtime::ros::{Header, Odometry, PoseWithCovariance, TFMessage, TransformStamped};
    let mut log = TestLog::new(layouts()[3].clone());
    let header = |frame: &str| Header::new(LogTime(1), frame);
    for robot in ["robot1", "robot2", "robot3"] {
        let map = OccupancyGrid { header: header("map"), ..Default::default() };
        log.add(&format!("/{robot}/map"), OccupancyGrid::NAME, 1, &map);
    }
    let child_frame_id = "base_link".to_owned();
    let transforms = vec![TransformStamped { header: header("map"), child_frame_id, ..Default::default() }];
    log.add("/robot1/tf", TFMessage::NAME, 2, &TFMessage { transforms });
    for (robot, frame) in [("robot2", "map"), ("robot3", "odom")] {
        let pose = PoseWithCovariance::default();
        let odometry = Odometry { header: header(frame), pose, ..Default::default() };
        log.add(&format!("/{robot}/odom"), Odometry::NAME, 3, &odometry);
    }
    let info = inspect_bytes(&log.finish());
    let from =
        ["robot1", "robot2", "robot3"].map(|robot| (info.robots[robot].poses, info.robots[robot].poses_from.clone()));
    let text = |text: &str| Some(text.to_owned());
    assert_eq!(from, [(1, text("tf (robot1/map to robot1/base_link)")), (1, text("/robot2/odom")), (0, None)]);
    let problem = "`/robot3/odom` is in the frame `robot3/odom`, not in the map frame `robot3/map`";
    assert!(info.problems.iter().any(|text| text.contains(problem)), "{:?}", info.problems);
    assert_eq!(inspect_bytes(&two_robots().finish()).robots["robot1"].poses_from, text("/robot1/pose"));
}

#[test]
fn a_log_of_tags_without_maps_is_recognised() {
    let folder = Folder::new();
    let alone = |name: &str, fill: &dyn Fn(&mut TestLog)| {
        let mut log = TestLog::new(layouts()[3].clone());
        fill(&mut log);
        let input = Input { robot: None, path: folder.write(name, &log.finish()) };
        holds_tags_alone(&[input], &NameRules::default(), &RobotTopics::default()).unwrap()
    };
    let add_tags = |log: &mut TestLog| {
        log.add("/robot1/tag_ranges", TagRange::NAME, 1, &reading("a"));
    };
    let add_map = |log: &mut TestLog| {
        log.add("/robot2/map", OccupancyGrid::NAME, 1, &OccupancyGrid::default());
    };
    assert!(alone("tags.mcap", &add_tags));
    assert!(!alone("map.mcap", &add_map));
    assert!(!alone("both.mcap", &|log| {
        add_tags(log);
        add_map(log);
    }));
    assert!(!alone("nothing.mcap", &|_| ()));
    let nowhere = Input { robot: None, path: "/nowhere/a.mcap".into() };
    assert!(holds_tags_alone(&[nowhere], &NameRules::default(), &RobotTopics::default()).is_err());
}

#[test]
fn a_sampled_log_with_an_index_has_the_same_contents_as_a_completely_read_one() {
    let folder = Folder::new();
    let mut log = TestLog::new(mcap::WriteOptions::new().chunk_size(Some(2000)));
    for number in 0..400_u64 {
        let at = LogTime(1_000_000_000 * (10 + number + number / 200));
        let header = gridweave_runtime::ros::Header::new(at, "robot1/map");
        log.add("/robot1/pose", PoseStamped::NAME, at.0, &PoseStamped { header, ..Default::default() });
        if number % 100 == 50 {
            log.add("/robot2/map", OccupancyGrid::NAME, at.0, &OccupancyGrid::default());
        }
    }
    let path = folder.write("a.mcap", &log.finish());
    let inputs = [Input { robot: None, path: path.clone() }];
    let read = |large: u64| look(&inputs, &NameRules::default(), &RobotTopics::default(), large).unwrap();
    let (through, glance) = (read(u64::MAX), read(0));
    assert!(glance.is_sampled && !through.is_sampled);
    assert_eq!(glance.robots, through.robots);
    assert_eq!((glance.messages, glance.start, glance.end), (through.messages, through.start, through.end));
    let [map, pose] = [1, 0].map(|topic| (&glance.topics[topic], &through.topics[topic]));
    let nearly = |bytes: u64| (bytes + 5) / 10;
    for (glance, through) in [map, pose] {
        assert_eq!(nearly(glance.bytes), nearly(through.bytes));
        assert_eq!(&TopicInfo { bytes: through.bytes, clock: through.clock, ..glance.clone() }, through);
    }
    assert_eq!(pose.0.largest_gap, 2.0);

    // A truncated log has no index.
    let mut bytes = std::fs::read(&path).unwrap();
    bytes.truncate(bytes.len() - 20);
    std::fs::write(&path, bytes).unwrap();
    assert!(!read(0).is_sampled);
}

#[test]
fn scans_on_topics_of_another_name_are_advised_to_be_renamed() {
    let mut log = TestLog::new(layouts()[3].clone());
    for robot in ["robot1", "robot2"] {
        log.raw(&format!("/{robot}/sick/scan"), "sensor_msgs/msg/LaserScan", 1, b"");
    }
    let problems = inspect_bytes(&log.finish()).problems.join("\n");
    assert!(problems.contains("give --rename '/{robot}/sick/scan=/{robot}/scan'"), "{problems}");
}

#[test]
fn robots_that_localise_in_one_map_are_named_with_it() {
    use gridweave_runtime::ros::{Header, PoseWithCovarianceStamped};
    let problems = |robots: [(&str, &str); 2], fill: &dyn Fn(&mut TestLog)| {
        let mut log = TestLog::new(layouts()[3].clone());
        let header = |frame: &str| Header::new(LogTime(1), frame);
        log.add("/map", OccupancyGrid::NAME, 1, &OccupancyGrid { header: header("map"), ..Default::default() });
        for (robot, frame) in robots {
            let pose = PoseWithCovarianceStamped { header: header(frame), ..Default::default() };
            log.add(&format!("/{robot}/amcl_pose"), PoseWithCovarianceStamped::NAME, 1, &pose);
        }
        fill(&mut log);
        inspect_bytes(&log.finish()).problems.join("\n")
    };
    let localised = "robot1 and robot2 localise in one map, `/map`, in frame `map`";
    let both = [("robot1", "map"), ("robot2", "/map")];
    let text = problems(both, &|_| ());
    assert!(text.contains(&format!("{localised}: there is nothing to merge")), "{text}");
    assert!(!text.contains("no map was recognised"), "{text}");
    let text = problems([("robot1", "map"), ("robot2", "robot2/map")], &|_| ());
    assert!(!text.contains("localise in one map") && text.contains("no map was recognised"), "{text}");
    let text = problems(both, &|log| {
        log.raw("/robot1/scan", "sensor_msgs/msg/LaserScan", 1, b"");
    });
    assert!(text.contains(&format!("{localised}, and have one frame without a merge")), "{text}");
}
