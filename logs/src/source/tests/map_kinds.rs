//! Maps that are not those of map servers: other cell values, merged maps of other programs.

use super::*;
use gridweave_runtime::ros::Quaternion;
use std::collections::BTreeSet;

fn map<'a>(frame: &str, data: &'a [u8]) -> OccupancyGrid<'a> {
    let info = MapMetaData { width: data.len() as u32, height: 1, resolution: 0.05, ..Default::default() };
    OccupancyGrid { header: Header::new(LogTime(1), frame), info, data }
}

fn read(log: &dyn Fn(&mut TestLog), more: &str) -> Run {
    let (_folder, files) = write(|file| log(file));
    try_run(files, more, RobotTopics::default()).unwrap()
}

fn cells(run: &Run) -> Vec<Vec<u8>> {
    run.on("map").iter().map(|message| message.decode::<OccupancyGrid<'_>>().unwrap().data.to_vec()).collect()
}

#[test]
fn cells_of_0_and_1_are_free_and_occupied_unless_the_pipeline_keeps_them() {
    let binary = [255, 0, 0, 1, 0];
    let log = |log: &mut TestLog| {
        log.add("/a/map", OccupancyGrid::NAME, 1, &map("map", &binary));
        log.add("/b/map", OccupancyGrid::NAME, 2, &map("map", &[255, 0, 0, 100, 0]));
    };
    let converted = read(&log, "");
    assert_eq!(cells(&converted), [[255, 0, 0, 100, 0], [255, 0, 0, 100, 0]]);
    let warning = "maps on `/a/map`: values about 0 are read as free, values about 1 as occupied";
    assert_eq!(converted.warnings.get(warning), Some(&1), "{:?}", converted.warnings);
    assert!(!converted.warnings.keys().any(|warning| warning.contains("/b/map")), "{:?}", converted.warnings);
    assert_eq!(cells(&read(&log, "map_values = \"occupancy\""))[0], binary);
    assert_eq!(cells(&read(&log, "names = \"as_logged\""))[0], binary, "a log that keeps its names keeps its bytes");
}

#[test]
fn the_pixels_of_an_image_are_read_as_such_and_other_values_out_of_range_are_named() {
    let log = |log: &mut TestLog| {
        log.add("/a/map", OccupancyGrid::NAME, 1, &map("map", &[205, 205, 254, 254, 0]));
        log.add("/b/map", OccupancyGrid::NAME, 2, &map("map", &[0, 150, 0, 1, 0]));
    };
    let converted = read(&log, "");
    assert_eq!(cells(&converted), [[255, 255, 0, 0, 100], [0, 255, 0, 100, 0]]);
    let warnings = [
        "maps on `/a/map`: cells have the values of an image: 0 is read as occupied, 205 as unknown, 254 and 255 as free",
        "maps on `/b/map`: cells with values outside -1 to 100 are read as unknown",
        "maps on `/b/map`: values about 0 are read as free, values about 1 as occupied",
    ];
    assert!(warnings.iter().all(|warning| converted.warnings.contains_key(*warning)), "{:?}", converted.warnings);
}

#[test]
fn maps_have_the_resolution_that_the_user_sets() {
    let log = |log: &mut TestLog| {
        for (second, robot) in (1..).zip(["a", "b"]) {
            log.add(&format!("/{robot}/map"), OccupancyGrid::NAME, second, &map("map", &[0, 100, 0]));
        }
    };
    for more in ["resolutions = { b = 0.0625 }", "resolutions = { b = 0.0625 }\nstart = 1e-9"] {
        let maps = read(&log, more);
        let resolution = |message: &Message| message.decode::<OccupancyGrid<'_>>().unwrap().info.resolution;
        let by_robot: BTreeMap<String, f32> =
            maps.on("map").iter().map(|message| (message.robot().to_owned(), resolution(message))).collect();
        assert_eq!(by_robot, BTreeMap::from([("a".to_owned(), 0.05), ("b".to_owned(), 0.0625)]), "{more}");
    }
    let (_folder, files) = write(|file| log(file));
    for (wrong, problem) in [("c = 0.05", "`resolutions` names `c`, which has no map"), ("b = 0.0", "wider than 0 m")] {
        let error =
            try_run(files.clone(), &format!("resolutions = {{ {wrong} }}"), RobotTopics::default()).err().unwrap();
        assert!(error.to_string().contains(problem), "{error}");
    }
}

#[test]
fn a_robot_whose_maps_are_of_a_type_that_is_not_read_is_reported_beside_others() {
    let log = |log: &mut TestLog| {
        log.add("/a/map", OccupancyGrid::NAME, 1, &map("map", &[0, 100, 0]));
        log.raw("/b/octomap_binary", "octomap_msgs/msg/Octomap", 2, b"");
    };
    let sent = read(&log, "");
    let unmerged: Vec<UnmergedRobot> =
        sent.on("localised").iter().map(|message| message.decode::<UnmergedRobot>().unwrap()).collect();
    assert_eq!(unmerged.iter().map(|unmerged| &*unmerged.robot).collect::<Vec<_>>(), ["b"]);
    assert!(unmerged[0].reason.contains("`projected_map` (nav_msgs/msg/OccupancyGrid), on `/b/map`"), "{unmerged:?}");
    assert!(read(&log, "only_robots = ['a']").on("localised").is_empty(), "the user leaves it out");
}

#[test]
fn maps_of_two_robots_on_one_topic_are_an_error() {
    let (_folder, files) = write(|log| {
        log.add("/a/map", OccupancyGrid::NAME, 1, &map("r1/map", &[0, 100, 0]));
        log.add("/a/map", OccupancyGrid::NAME, 2, &map("r2/map", &[0, 100, 0]));
    });
    let error = try_run(files, "", RobotTopics::default()).err().unwrap();
    assert!(error.to_string().contains("by their frames r1/map and r2/map"), "{error}");
}

#[test]
fn a_merged_map_of_another_program_is_no_robot_wherever_it_comes() {
    let grid = [0, 0, 100, 0];
    let all = [("/map_merge/map", "world"), ("/a/map", "map"), ("/b/map", "b/map")];
    for first in 0..3 {
        let log = |log: &mut TestLog| {
            for (second, index) in (1..).zip([first, first + 1, first + 2]) {
                let (topic, frame) = all[index % 3];
                log.add(topic, OccupancyGrid::NAME, second, &map(frame, &grid));
            }
        };
        let read = read(&log, "");
        let robots: BTreeSet<String> = read.on("map").iter().map(|message| message.robot().to_owned()).collect();
        assert_eq!(robots, BTreeSet::from(["a".to_owned(), "b".to_owned()]), "{first}");
        assert_eq!(read.on("other").len(), 1, "it stays in the log");
        assert!(read.warnings.keys().any(|warning| warning.starts_with("maps on `/map_merge/map` are merged ones")));
        let as_logged = self::read(&log, "names = \"as_logged\"");
        assert_eq!((as_logged.on("map").len(), as_logged.warnings.len()), (3, 0), "{:?}", as_logged.warnings);
    }
}

#[test]
fn maps_that_are_all_in_the_world_are_those_of_robots() {
    let log = |log: &mut TestLog| {
        for (second, robot) in (1..).zip(["a", "b", "c", "a"]) {
            log.add(&format!("/{robot}/map"), OccupancyGrid::NAME, second, &map("world", &[0, 100, 0]));
        }
    };
    let robots: Vec<String> = read(&log, "").on("map").iter().map(|message| message.robot().to_owned()).collect();
    assert_eq!(robots, ["a", "b", "c", "a"], "the frames of all are known before the first");
    let alone = |log: &mut TestLog| {
        log.add("/a/map", OccupancyGrid::NAME, 1, &map("world", &[0, 100, 0]));
        for robot in ["b", "c"] {
            log.raw(&format!("/{robot}/map"), OccupancyGrid::NAME, 2, b"cut");
        }
    };
    assert_eq!(read(&alone, "").on("map").len(), 3, "what stays undecided is sent at the end");
}

fn robots_of(run: &Run) -> BTreeSet<String> {
    run.on("map").iter().map(|message| message.robot().to_owned()).collect()
}

/// Maps and poses of two robots, and a map of another program in `frame`.
fn merged_beside_two(log: &mut TestLog, topic: &str, frame: &str) {
    log.add(topic, OccupancyGrid::NAME, 1, &map(frame, &[0, 0, 100, 0]));
    for robot in ["robot1", "robot2"] {
        let frame = format!("{robot}/map");
        log.add(&format!("/{robot}/map"), OccupancyGrid::NAME, 2, &map(&frame, &[0, 0, 100, 0]));
        log.add(&format!("/{robot}/pose"), PoseStamped::NAME, 3, &PoseStamped { pose: at(1.0), ..Default::default() });
    }
}

#[test]
fn a_merged_map_is_left_out_whatever_its_frame_is_and_taken_in_by_the_option() {
    let two = BTreeSet::from(["robot1".to_owned(), "robot2".to_owned()]);
    let join = |log: &mut TestLog, topics: [&str; 2], child: [&str; 2]| {
        for (topic, child) in topics.into_iter().zip(child) {
            let edge = TransformStamped {
                header: Header::new(LogTime(1), "common"),
                child_frame_id: child.into(),
                ..Default::default()
            };
            log.add(topic, TFMessage::NAME, 4, &TFMessage { transforms: vec![edge] });
        }
    };
    let shapes: [&dyn Fn(&mut TestLog); 4] = [
        &|log| merged_beside_two(log, "/map_merge/map", "map"),
        &|log| merged_beside_two(log, "/base/map", "robot1/map"),
        &|log| {
            merged_beside_two(log, "/base/map", "common");
            join(log, ["/robot1/tf", "/robot2/tf"], ["map", "map"]);
        },
        &|log| {
            merged_beside_two(log, "/base/map", "common");
            join(log, ["/tf", "/tf"], ["robot1/map", "robot2/map"]);
        },
    ];
    for (number, log) in shapes.iter().enumerate() {
        let topic = if number == 0 { "/map_merge/map" } else { "/base/map" };
        let run = read(log, "");
        assert_eq!(robots_of(&run), two, "{number}: {:?}", run.warnings);
        let program = topic.split('/').nth(1).unwrap();
        let mut robots = ["robot1", "robot2", program];
        robots.sort_unstable();
        let warning = format!(
            "maps on `{topic}` are merged ones of another program, and are not taken as a robot's; if they are a robot's, give \
             --robots {}",
            robots.join(",")
        );
        assert_eq!(run.warnings.get(&warning), Some(&1), "{number}: {:?}", run.warnings);
        let all = read(log, &format!("only_robots = {robots:?}"));
        assert_eq!(robots_of(&all).len(), 3, "{number}");
        assert!(!all.warnings.keys().any(|warning| warning.contains("merged")), "{number}: {:?}", all.warnings);
    }
}

#[test]
fn a_robot_whose_map_is_in_the_world_is_distinguished_from_a_program_by_what_else_it_has() {
    let log = |log: &mut TestLog| {
        merged_beside_two(log, "/drone/map", "world");
        log.raw("/drone/imu", "sensor_msgs/msg/Imu", 1, b"");
    };
    let run = read(&log, "");
    assert_eq!(robots_of(&run).len(), 3, "{:?}", run.warnings);
    assert!(!run.warnings.keys().any(|warning| warning.contains("merged")), "{:?}", run.warnings);
    let nothing_else = read(&|log| merged_beside_two(log, "/base/map", "map"), "");
    assert_eq!(robots_of(&nothing_else).len(), 3);
    let warning = "of base there is nothing but maps: if those on `/base/map` are merged ones of another program, give \
                   --robots robot1,robot2";
    assert_eq!(nothing_else.warnings.get(warning), Some(&1), "{:?}", nothing_else.warnings);
}

#[test]
fn a_map_in_centimetres_one_with_exchanged_values_and_ranges_in_millimetres_are_named_once() {
    let large = MapMetaData { width: 400, height: 300, resolution: 5.0, ..Default::default() };
    let cells: Vec<u8> = (0..120_000).map(|index| u8::from(index % 50 > 0)).collect();
    let log = |log: &mut TestLog| {
        for second in 1..20 {
            let map = OccupancyGrid { header: Header::new(LogTime(1), "map"), info: large, data: &cells };
            log.add("/a/map", OccupancyGrid::NAME, second, &map);
            log.add("/a/tag_ranges", TagRange::NAME, second, &TagRange { range: 5230.0, ..reading() });
        }
    };
    let run = read(&log, "");
    for start in [
        "maps on `/a/map`: cells of 5 m make a map of 2000 m by 1500 m",
        "maps on `/a/map`: 117600 cells have the value 1 and 2400 the value 0",
        "tags on `/a/tag_ranges`: ranges of 5230 m are too long",
    ] {
        let counts: Vec<u64> =
            run.warnings.iter().filter(|(text, _)| text.starts_with(start)).map(|(_, count)| *count).collect();
        assert_eq!(counts, [1], "{start}: {:?}", run.warnings);
    }
    let inverted = read(&log, "map_values = \"inverted\"");
    assert!(cells_of(&inverted, 100) == 2400 && cells_of(&inverted, 0) == 117_600, "{:?}", inverted.warnings);
}

/// The number of cells with a value in the first map.
fn cells_of(run: &Run, value: u8) -> usize {
    cells(run)[0].iter().filter(|cell| **cell == value).count()
}

#[test]
fn a_name_with_a_zero_byte_is_no_robots_and_takes_no_name_of_another() {
    let log = |log: &mut TestLog| {
        for (second, topic) in [(1, "/a\0b/map"), (2, "/a/map"), (3, "/a\0c/map")] {
            log.add(topic, OccupancyGrid::NAME, second, &map("map", &[0, 0, 100, 0]));
        }
    };
    let run = read(&log, "");
    assert_eq!(run.times("map"), [2]);
    for topic in ["/a\\0b/map", "/a\\0c/map"] {
        let warning =
            format!("`{topic}` is not read as a robot's: the robot's name contains a zero byte; rename the topic");
        assert!(run.warnings.contains_key(&warning), "{:?}", run.warnings);
    }
}

#[test]
fn an_origin_with_roll_or_pitch_is_warned_of_once_for_each_robot() {
    let turned = |x: f64, z: f64, w: f64| {
        let mut map = map("map", &[0, 0, 100, 0]);
        map.info.origin.orientation = Quaternion { x, y: 0.0, z, w };
        map
    };
    let log = |log: &mut TestLog| {
        for second in 1..3 {
            log.add("/flipped/map", OccupancyGrid::NAME, second, &turned(1.0, 0.0, 0.0));
            log.add("/tilted/map", OccupancyGrid::NAME, second, &turned(0.05, 0.0, 1.0));
            log.add("/scaled/map", OccupancyGrid::NAME, second, &turned(0.0, 3.0, 4.0));
            log.add("/zero/map", OccupancyGrid::NAME, second, &turned(0.0, 0.0, 0.0));
            log.add("/tiny/map", OccupancyGrid::NAME, second, &turned(0.0, 1e-170, 1e-170));
        }
    };
    let run = read(&log, "");
    assert_eq!(run.on("map").len(), 10);
    let about = |robot: &str| {
        let mut warnings = run.warnings.iter().filter(|(text, _)| text.contains(&format!("`/{robot}/map`")));
        warnings.next().map(|(text, count)| (text.clone(), *count))
    };
    let (flipped, times) = about("flipped").unwrap();
    assert!(flipped.contains("would be a mirror image") && times == 1, "{flipped}");
    let (tilted, times) = about("tilted").unwrap();
    assert!(tilted.contains("5.7 degrees") && times == 1, "{tilted}");
    assert!(about("tiny").unwrap().0.contains("too small"));
    assert_eq!((about("scaled"), about("zero")), (None, None));
    for message in run.on("map").iter().filter(|message| ["scaled", "tiny"].contains(&message.robot())) {
        let map: OccupancyGrid<'_> = message.decode().unwrap();
        assert_eq!(map.check().is_ok(), message.robot() == "scaled");
    }
}
