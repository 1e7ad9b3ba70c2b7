//! Robots that frames show, and no topic.

use super::*;
use gridweave_runtime::ros::{LaserScan, Odometry};

/// Adds a transform on a topic.
fn tie(log: &mut TestLog, topic: &str, time: u64, parent: &str, child: &str) {
    let one = TransformStamped {
        header: Header::new(LogTime(1), parent),
        child_frame_id: child.into(),
        ..Default::default()
    };
    log.add(topic, TFMessage::NAME, time, &TFMessage { transforms: vec![one] });
}

fn add_scan(log: &mut TestLog, topic: &str, frame: &str) {
    let scan = LaserScan { header: Header::new(LogTime(1), frame), ..Default::default() };
    log.add(topic, LaserScan::NAME, 2, &scan);
}

fn add_map(log: &mut TestLog, topic: &str, frame: &str) {
    let map = OccupancyGrid { header: Header::new(LogTime(1), frame), ..Default::default() };
    log.add(topic, OccupancyGrid::NAME, 3, &map);
}

/// A log with lidars, each with its topic, its frame and the base that it is on.
fn lidars(of: &[(&str, &str, &str)], others: &[&str]) -> Vec<u8> {
    let mut log = TestLog::new(layouts()[1].clone());
    for (topic, frame, base) in of {
        if !base.is_empty() {
            tie(&mut log, "/tf_static", 1, base, frame);
        }
        add_scan(&mut log, topic, frame);
    }
    for topic in others {
        log.raw(topic, Odometry::NAME, 4, b"");
    }
    log.finish()
}

/// The topics of logs, and the note about them.
fn named(logs: &[(&str, Vec<u8>)], robots: &[&str]) -> (Vec<Vec<String>>, String) {
    let folder = Folder::new();
    let paths: Vec<PathBuf> = logs.iter().map(|(name, bytes)| folder.write(name, bytes)).collect();
    let rules = NameRules { robots: robots.iter().map(|robot| robot.to_string()).collect(), ..Default::default() };
    let (_, names) = open(&inputs(&paths), &rules, &RobotTopics::default()).unwrap();
    let note = names.note().unwrap_or_default().to_owned();
    (topics(&inputs(&paths), &rules), note)
}

fn names_of(log: Vec<u8>) -> Vec<String> {
    named(&[("log.mcap", log)], &[]).0.remove(0)
}

#[test]
fn lidars_on_one_base_are_those_of_one_robot() {
    let two = [("/sick1/scan", "laser1", "base_link"), ("/sick2/scan", "laser2", "base_link")];
    let (topics, note) = named(&[("log.mcap", lidars(&two, &["/odom"]))], &[]);
    assert_eq!(topics, [["/tf_static", "/log/scan", "/log/sick2/scan", "/log/odom"]], "one of them is read");
    assert!(note.starts_with("the scans on /sick1/scan and /sick2/scan are those of one robot, as tf has"), "{note}");
    assert!(
        note.contains("`base_link`") && note.contains("--robots sick1,sick2 takes each lidar for a robot"),
        "{note}"
    );
    let read = "the scans on /sick1/scan are read, as those on `/scan`; `--rename /sick2/scan=/scan` reads another";
    assert!(note.ends_with(read), "{note}");
    let both = named(&[("log.mcap", lidars(&two, &[]))], &["sick1", "sick2"]).0;
    assert_eq!(both, [["/tf_static", "/sick1/scan", "/sick2/scan"]], "the user says so");
    let folder = Folder::new();
    let given = Input { robot: Some("r".into()), path: folder.write("a.mcap", &lidars(&two, &[])) };
    assert_eq!(self::topics(&[given], &NameRules::default()), [["/tf_static", "/r/scan", "/r/sick2/scan"]]);
    let nameless = [("/scan", "laser", "r7/base_link"), ("/sick1/scan", "sick1", "r7/base_link")];
    assert_eq!(names_of(lidars(&nameless, &[])), ["/tf_static", "/r7/scan", "/r7/sick1/scan"]);
}

#[test]
fn lidars_of_two_robots_stay_theirs() {
    for of in [
        [("/a/scan", "a/laser", "a/base_link"), ("/b/scan", "b/laser", "b/base_link")],
        // Frames without the names of robots.
        [("/a/scan", "laser", "base_link"), ("/b/scan", "laser", "base_link")],
        [("/a/scan", "laser_a", ""), ("/b/scan", "laser_b", "")],
        // Parts of robots are good names for robots, too.
        [("/left/scan", "left/laser", "left/base_link"), ("/right/scan", "right/laser", "right/base_link")],
    ] {
        let topics = names_of(lidars(&of, &["/odom"]));
        assert!(of.iter().all(|(topic, ..)| topics.contains(&topic.to_string())), "{topics:?}");
    }
    let mut log = TestLog::new(layouts()[1].clone());
    for robot in ["a", "b"] {
        tie(&mut log, "/tf_static", 1, "base_link", &format!("laser_{robot}"));
        add_scan(&mut log, &format!("/{robot}/scan"), &format!("laser_{robot}"));
        add_map(&mut log, &format!("/{robot}/map"), "map");
    }
    assert!(names_of(log.finish()).contains(&"/a/scan".to_owned()), "they have maps of their own");
}

#[test]
fn lidars_named_after_their_places_are_those_of_the_robot_whose_odometry_has_no_name() {
    let of = [("/front/scan", "front", ""), ("/rear/scan", "rear", "")];
    assert_eq!(names_of(lidars(&of, &["/odom"])), ["/log/front/scan", "/log/rear/scan", "/log/odom"]);
    assert_eq!(names_of(lidars(&of[..1], &["/odom"])), ["/log/front/scan", "/log/odom"]);
    assert_eq!(names_of(lidars(&of, &[])), ["/front/scan", "/rear/scan"]);
    assert_eq!(names_of(lidars(&of, &["/front/odom"])), ["/front/scan", "/rear/scan", "/front/odom"]);
}

#[test]
fn logs_whose_lidars_have_namespaces_are_distinguished_by_their_files() {
    let of = [("/front/scan", "front", "base_link"), ("/rear/scan", "rear", "base_link")];
    let (topics, _) = named(&[("red.mcap", lidars(&of, &["/odom"])), ("blue.mcap", lidars(&of, &["/odom"]))], &[]);
    assert!(topics[0].contains(&"/red/front/scan".into()) && topics[1].contains(&"/blue/front/scan".into()));
    let based = || {
        let of = [("/front/scan", "front", "r7/base_link"), ("/rear/scan", "rear", "r7/base_link")];
        lidars(&of, &[])
    };
    let (topics, _) = named(&[("red.mcap", based()), ("blue.mcap", based())], &[]);
    assert!(topics[0].contains(&"/red/front/scan".into()) && topics[1].contains(&"/blue/front/scan".into()));
    let mut other = TestLog::new(layouts()[1].clone());
    add_map(&mut other, "/map", "map");
    other.raw("/odom", Odometry::NAME, 4, b"");
    let (topics, _) = named(&[("red.mcap", lidars(&of, &["/odom"])), ("blue.mcap", other.finish())], &[]);
    assert_eq!(topics[1], ["/blue/map", "/blue/odom"]);
}

/// A log with a map on `/map` in a frame, and maps of other robots.
fn map_beside(frames: &[&str], others: &[&str]) -> TestLog {
    let mut log = TestLog::new(layouts()[1].clone());
    frames.iter().for_each(|frame| add_map(&mut log, "/map", frame));
    others.iter().for_each(|robot| add_map(&mut log, &format!("/{robot}/map"), &format!("{robot}/map")));
    log
}

#[test]
fn maps_without_a_name_are_those_of_the_robot_in_their_frame() {
    let (topics, note) = named(&[("log.mcap", map_beside(&["robot1/map"], &["robot2"]).finish())], &[]);
    assert_eq!(topics, [["/robot1/map", "/robot2/map"]]);
    assert!(note.contains("`robot1/map`") && note.contains("--rename /map=/ROBOT/map"), "{note}");
    let mut only = map_beside(&["/robot1/map"], &[]);
    add_scan(&mut only, "/scan", "laser");
    assert_eq!(names_of(only.finish()), ["/robot1/map", "/robot1/scan"]);
    let mut third = map_beside(&["c/map"], &["a", "b"]);
    tie(&mut third, "/tf", 1, "c/odom", "c/base_link");
    assert_eq!(names_of(third.finish())[0], "/c/map");
    let logs = ["a", "b"].map(|robot| (robot, map_beside(&[&format!("{robot}1/map")], &[]).finish()));
    assert_eq!(named(&logs, &[]).0, [["/a1/map"], ["/b1/map"]]);
    let logs = ["a", "b"].map(|robot| (robot, map_beside(&["turtle/map"], &[]).finish()));
    assert_eq!(named(&logs, &[]).0, [["/a/map"], ["/b/map"]], "two robots of one name");
}

#[test]
fn maps_of_no_robot_keep_their_name() {
    for (frame, others) in [
        ("robot1/map", &["robot1", "robot2"][..]),
        ("world/map", &["a"]),
        ("slam_toolbox/map", &["a"]),
        ("map", &["a"]),
    ] {
        assert_eq!(names_of(map_beside(&[frame], others).finish())[0], "/map", "{frame}");
    }
    assert_eq!(names_of(map_beside(&["fleet/map"], &["a", "b"]).finish())[0], "/map", "it may be made of both");
    let mut localised = map_beside(&["robot1/map"], &[]);
    for robot in ["robot1", "robot2"] {
        let pose = PoseWithCovarianceStamped { header: Header::new(LogTime(1), "robot1/map"), ..Default::default() };
        localised.add(&format!("/{robot}/amcl_pose"), PoseWithCovarianceStamped::NAME, 4, &pose);
    }
    assert_eq!(names_of(localised.finish())[0], "/map");
    let mut tied = map_beside(&["robot1/map"], &[]);
    tie(&mut tied, "/tf", 4, "robot1/map", "robot2/odom");
    assert_eq!(names_of(tied.finish())[0], "/map");
}

#[test]
fn maps_of_several_robots_on_one_topic_are_reported() {
    let (topics, note) = named(&[("log.mcap", map_beside(&["a/map", "b/map"], &[]).finish())], &[]);
    assert_eq!(topics, [["/map"]]);
    assert!(note.starts_with("`/map` has the maps of several robots, by their frames a/map and b/map"), "{note}");
}
