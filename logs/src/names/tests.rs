use super::*;
use crate::test_log::{Folder, TestLog, layouts};
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{
    Header, OccupancyGrid, PoseStamped, PoseWithCovarianceStamped, RosMessage, TFMessage, TransformStamped, decode,
    encode,
};

mod shown_robots;

const SCAN: &str = "sensor_msgs/msg/LaserScan";

/// Writes a log with a channel for each topic and type.
fn log(folder: &Folder, name: &str, topics: &[(&str, &str)]) -> PathBuf {
    let mut log = TestLog::new(layouts()[1].clone());
    for (time, (topic, type_name)) in topics.iter().enumerate() {
        log.raw(topic, type_name, time as u64, b"");
    }
    folder.write(name, &log.finish())
}

fn inputs(paths: &[PathBuf]) -> Vec<Input> {
    paths.iter().map(|path| Input { robot: None, path: path.clone() }).collect()
}

fn topics(inputs: &[Input], rules: &NameRules) -> Vec<Vec<String>> {
    let (reader, names) = open(inputs, rules, &RobotTopics::default()).unwrap();
    let files = reader.files().iter().enumerate();
    files
        .map(|(file, log)| {
            let called = |(number, _)| names.channel(file, number).unwrap().topic.clone();
            log.channels().filter(|(number, _)| names.wants(file, *number)).map(called).collect()
        })
        .collect()
}

#[test]
fn topics_under_a_robot_have_its_name_once_and_transforms_share_a_topic() {
    let folder = Folder::new();
    let path = log(
        &folder,
        "a.mcap",
        &[
            ("/map", OccupancyGrid::NAME),
            ("/robot1/scan", SCAN),
            ("/tf", TFMessage::NAME),
            ("/robot1/tf_static", TFMessage::NAME),
            ("/odd/tf", "std_msgs/msg/String"),
        ],
    );
    let input = Input { robot: Some("robot1".into()), path };
    for convention in [TopicNaming::ByRobot, TopicNaming::AsLogged] {
        let rules = NameRules { convention, ..Default::default() };
        let expected = ["/robot1/map", "/robot1/scan", "/tf", "/tf_static", "/robot1/odd/tf"];
        assert_eq!(topics(std::slice::from_ref(&input), &rules), [expected]);
    }
}

#[test]
fn logs_with_equal_topics_are_named_after_their_files_unless_names_stay_as_logged() {
    let folder = Folder::new();
    let one = [("/map", OccupancyGrid::NAME), ("/amcl_pose", PoseWithCovarianceStamped::NAME), ("/x", "p/msg/X")];
    let paths = [log(&folder, "red.mcap", &one), log(&folder, "blue.mcap", &one)];
    let named = topics(&inputs(&paths), &NameRules::default());
    assert_eq!(named[0], ["/red/map", "/red/amcl_pose", "/red/x"]);
    assert_eq!(named[1], ["/blue/map", "/blue/amcl_pose", "/blue/x"]);
    let (_, names) = open(&inputs(&paths), &NameRules::default(), &RobotTopics::default()).unwrap();
    let note = names.note().unwrap();
    assert!(note.contains("red.mcap to red") && note.contains("ROBOT=LOG"), "{note}");
    assert_eq!((names.robot_of_file(0), names.robot_of_file(1)), (Some("red"), Some("blue")));

    let as_logged = NameRules { convention: TopicNaming::AsLogged, ..Default::default() };
    assert_eq!(topics(&inputs(&paths), &as_logged)[1], ["/map", "/amcl_pose", "/x"]);
    let mut half = inputs(&paths);
    half[0].robot = Some("red1".into());
    assert_eq!(topics(&half, &NameRules::default())[1][0], "/blue/map", "it has the topics of one that was named");
}

#[test]
fn logs_with_robot_names_or_without_common_topics_are_not_named() {
    let folder = Folder::new();
    let with_robot = |robot: &str| {
        let map = format!("/{robot}/map");
        log(&folder, &format!("{robot}.mcap"), &[(&map, OccupancyGrid::NAME), ("/tf", TFMessage::NAME)])
    };
    let paths = [with_robot("r1"), with_robot("r2")];
    assert_eq!(topics(&inputs(&paths), &NameRules::default())[1], ["/r2/map", "/tf"]);
    let paths = [
        log(&folder, "maps.mcap", &[("/map", OccupancyGrid::NAME), ("/rosout", "p/msg/L")]),
        log(&folder, "tf.mcap", &[("/tf", TFMessage::NAME), ("/rosout", "p/msg/L")]),
    ];
    assert_eq!(topics(&inputs(&paths), &NameRules::default()), [["/map", "/rosout"], ["/tf", "/rosout"]]);
}

#[test]
fn logs_with_equal_topics_and_equal_file_names_are_an_error_with_a_fix() {
    let folder = Folder::new();
    std::fs::create_dir_all(folder.path().join("x/r")).unwrap();
    let one = [("/map", OccupancyGrid::NAME)];
    let paths = [log(&folder, "x/r/map.mcap", &one), log(&folder, "x/r/map.log", &one)];
    let error = open(&inputs(&paths), &NameRules::default(), &RobotTopics::default()).err().unwrap().to_string();
    assert!(error.contains("ROBOT=LOG") && error.contains("x/r/map.mcap"), "{error}");
}

#[test]
fn two_topics_do_not_become_one() {
    let folder = Folder::new();
    let maps = [("/robot1/map", OccupancyGrid::NAME), ("/robot2/map", OccupancyGrid::NAME), ("/tf", TFMessage::NAME)];
    let inputs = inputs(&[log(&folder, "a.mcap", &maps)]);
    let opened = |renames: &[&str]| {
        let renames = renames.iter().map(|text| text.parse().unwrap()).collect();
        open(&inputs, &NameRules { renames, ..Default::default() }, &RobotTopics::default()).map(|_| ())
    };
    let together = ["/robot1/map=/x/map", "/robot2/map=/x/map"];
    for renames in [&["/robot2/map=/robot1/map"][..], &together, &["/{robot}/map=/map"]] {
        let error = opened(renames).unwrap_err().to_string();
        assert!(error.starts_with("`/robot1/map` and `/robot2/map` would both be"), "{error}");
    }
    // Each gets the name of the other.
    opened(&["/robot1/map=/robot2/map", "/robot2/map=/robot1/map"]).unwrap();
    opened(&["/robot1/map=/x/tf", "/robot2/map=/tf"]).unwrap();
}

#[test]
fn a_log_that_has_another_name_for_its_robot_gets_the_one_that_is_given() {
    let folder = Folder::new();
    let mut log = TestLog::new(layouts()[1].clone());
    let map = OccupancyGrid { header: Header::new(LogTime(1), "robot1/map"), ..Default::default() };
    let edge = |parent: &str, child: &str| TransformStamped {
        header: Header::new(LogTime(1), parent),
        child_frame_id: child.into(),
        ..Default::default()
    };
    let tf = TFMessage { transforms: vec![edge("robot1/map", "robot1/odom"), edge("odom", "base_link")] };
    log.add("/robot1/map", OccupancyGrid::NAME, 1, &map).add("/tf", TFMessage::NAME, 2, &tf).raw("/x", "p/X", 3, b"");
    let path = folder.write("a.mcap", &log.finish());
    let input = Input { robot: Some("a".into()), path };
    for convention in [TopicNaming::ByRobot, TopicNaming::AsLogged] {
        let rules = NameRules { convention, ..Default::default() };
        assert_eq!(topics(std::slice::from_ref(&input), &rules), [["/a/map", "/tf", "/a/x"]]);
    }
    let (mut reader, names) = open(&[input], &NameRules::default(), &RobotTopics::default()).unwrap();
    let mut copy = Vec::new();
    names.rename_frames(&reader.next_message().unwrap(), &mut copy);
    assert_eq!(decode::<OccupancyGrid<'_>>(&copy).unwrap().header.frame_id, "a/map");
    names.rename_frames(&reader.next_message().unwrap(), &mut copy);
    let expected = TFMessage { transforms: vec![edge("a/map", "a/odom"), edge("a/odom", "a/base_link")] };
    assert_eq!(decode::<TFMessage>(&copy).unwrap(), expected);
    assert_eq!(names.note(), None);
}

#[test]
fn a_name_stays_in_topics_that_would_be_others_without_it() {
    let folder = Folder::new();
    let scans = [("/robot1/map", OccupancyGrid::NAME), ("/robot1/scan", SCAN), ("/scan", SCAN)];
    let input = Input { robot: Some("a".into()), path: log(&folder, "a.mcap", &scans) };
    assert_eq!(topics(&[input], &NameRules::default()), [["/a/robot1/map", "/a/robot1/scan", "/a/scan"]]);
}

#[test]
fn two_logs_of_one_time_do_not_give_one_robot_two_maps() {
    let folder = Folder::new();
    let write = |name: &str, from: u64| {
        let mut log = TestLog::new(layouts()[1].clone());
        for time in [from, from + 10] {
            log.add("/robot1/map", OccupancyGrid::NAME, time, &OccupancyGrid::default());
        }
        folder.write(name, &log.finish())
    };
    let [first, same_time, next_part, later] =
        [("a.mcap", 0), ("b.mcap", 5), ("d.mcap", 9), ("c.mcap", 11)].map(|(name, from)| write(name, from));
    let opened = |paths: &[PathBuf]| open(&inputs(paths), &NameRules::default(), &RobotTopics::default()).map(|_| ());
    let error = opened(&[first.clone(), same_time.clone()]).unwrap_err().to_string();
    assert!(error.contains("maps or scans of `robot1` at the same time") && error.contains("A="), "{error}");
    opened(&[first.clone(), later]).unwrap();
    opened(&[first.clone(), next_part]).unwrap();
    let named =
        [("a", &first), ("b", &same_time)].map(|(robot, path)| Input { robot: Some(robot.into()), path: path.clone() });
    assert_eq!(topics(&named, &NameRules::default()), [["/a/map"], ["/b/map"]]);
}

/// Opens a folder of logs that have a map of a robot at one time and its poses from a time to another, each with its name.
fn open_folder(logs: &[(&str, u64, [u64; 2])]) -> Result<(), String> {
    let folder = Folder::new();
    for (name, map, poses) in logs {
        let mut log = TestLog::new(layouts()[1].clone());
        log.add("/robot1/map", OccupancyGrid::NAME, *map, &OccupancyGrid::default());
        for time in poses {
            log.add("/robot1/pose", PoseStamped::NAME, *time, &PoseStamped::default());
        }
        folder.write(name, &log.finish());
    }
    let input = folder.path();
    open(&inputs(&[input]), &NameRules::default(), &RobotTopics::default())
        .map(|_| ())
        .map_err(|error| error.to_string())
}

#[test]
fn two_logs_are_of_one_time_by_all_that_they_have_of_a_robot_in_a_folder_as_well() {
    let error = open_folder(&[("lab.mcap", 2, [0, 20]), ("hall.mcap", 30, [0, 40])]).unwrap_err();
    assert!(error.contains("lab.mcap") && error.contains("hall.mcap"), "{error}");
    let error = open_folder(&[("run1.mcap", 2, [0, 20]), ("run2.mcap", 12, [0, 22])]).unwrap_err();
    assert!(error.contains("at the same time"), "{error}");
    open_folder(&[("run_0.mcap", 2, [0, 20]), ("run_1.mcap", 20, [19, 40]), ("run_2.mcap", 40, [39, 40])]).unwrap();
}

#[test]
fn topics_are_renamed_before_and_after_they_are_put_under_their_robot() {
    let folder = Folder::new();
    let path = log(&folder, "a.mcap", &[("/slam/map", OccupancyGrid::NAME), ("/bot/map", OccupancyGrid::NAME)]);
    let renames = ["/slam/map=/map", "/{robot}/bot/map=/{robot}/second/map"].map(|text| text.parse().unwrap());
    let rules = NameRules { renames: renames.to_vec(), ..Default::default() };
    let input = Input { robot: Some("r1".into()), path };
    assert_eq!(topics(&[input], &rules), [["/r1/map", "/r1/second/map"]]);
}

#[test]
fn robots_and_topics_that_are_not_selected_are_dropped() {
    let folder = Folder::new();
    let path = log(
        &folder,
        "a.mcap",
        &[("/r1/map", OccupancyGrid::NAME), ("/r1/x", "p/msg/X"), ("/r2/map", OccupancyGrid::NAME), ("/y", "p/msg/X")],
    );
    let read = |rules: NameRules| topics(&inputs(std::slice::from_ref(&path)), &rules).remove(0);
    assert_eq!(read(NameRules { robots: vec!["r1".into()], ..Default::default() }), ["/r1/map", "/r1/x", "/y"]);
    let topics = vec!["/{robot}/map".into(), "/y".into()];
    assert_eq!(read(NameRules { topics, ..Default::default() }), ["/r1/map", "/r2/map", "/y"]);
    let rules = NameRules { robots: vec!["r3".into()], ..Default::default() };
    let error = open(&inputs(&[path]), &rules, &RobotTopics::default()).err().unwrap().to_string();
    assert!(error.contains("`r3`") && error.contains("r1 and r2"), "{error}");
}

/// The frames of a message on a topic of a log, after renaming.
fn frames<T: RosMessage + serde::Serialize>(topic: &str, others: &[&str], message: &T) -> (Renamed, Vec<u8>) {
    let folder = Folder::new();
    let mut log = TestLog::new(layouts()[1].clone());
    log.add(topic, T::NAME, 1, message);
    others.iter().for_each(|other| {
        log.raw(other, TFMessage::NAME, 2, b"");
    });
    let inputs = inputs(&[folder.write("a.mcap", &log.finish())]);
    let (mut reader, names) = open(&inputs, &NameRules::default(), &RobotTopics::default()).unwrap();
    let mut copy = Vec::new();
    let renamed = names.rename_frames(&reader.next_message().unwrap(), &mut copy);
    (renamed, copy)
}

#[test]
fn frames_without_a_robot_name_get_it_where_the_log_contains_it() {
    let edge = |parent: &str, child: &str| TransformStamped {
        header: Header::new(LogTime(1), parent),
        child_frame_id: child.into(),
        ..Default::default()
    };
    let tf = |edges: &[(&str, &str)]| TFMessage { transforms: edges.iter().map(|(p, c)| edge(p, c)).collect() };
    let own = tf(&[("map", "odom"), ("/odom", "robot1/base_link")]);
    let expected = tf(&[("robot1/map", "robot1/odom"), ("robot1/odom", "robot1/base_link")]);
    let (renamed, copy) = frames("/robot1/tf", &[], &own);
    assert_eq!((renamed, decode::<TFMessage>(&copy).unwrap()), (Renamed::Copied, expected.clone()));
    assert_eq!(copy, encode(&expected).unwrap());
    assert_eq!(frames("/robot1/tf", &[], &expected).0, Renamed::AsLogged);
    assert_eq!(frames("/tf", &[], &own).0, Renamed::AsLogged, "these are full names");

    let header = Header::new(LogTime(1), "map");
    let pose = PoseWithCovarianceStamped { header: header.clone(), ..Default::default() };
    for (topic, others, renamed) in [
        ("/robot1/pose", &[][..], Renamed::Copied),
        ("/robot1/amcl_pose", &[], Renamed::Copied),
        ("/robot1/goal", &[], Renamed::AsLogged),
        ("/robot1/goal", &["/robot1/tf_static"], Renamed::Copied),
        ("/robot1/goal", &["/robot2/tf"], Renamed::AsLogged),
        ("/goal", &["/robot1/tf"], Renamed::AsLogged),
    ] {
        let (found, copy) = frames(topic, others, &pose);
        assert_eq!(found, renamed, "{topic} {others:?}");
        if renamed == Renamed::Copied {
            assert_eq!(decode::<PoseWithCovarianceStamped>(&copy).unwrap().header.frame_id, "robot1/map");
        }
    }
    for (frame, expected) in [("map", Some("robot1/map")), ("", Some("robot1/map")), ("robot1_map", None)] {
        let map = OccupancyGrid { header: Header::new(LogTime(1), frame), data: &[1, 2, 3], ..Default::default() };
        let (renamed, copy) = frames("/robot1/map", &[], &map);
        let named = (renamed == Renamed::Copied).then(|| decode::<OccupancyGrid<'_>>(&copy).unwrap());
        assert_eq!(named.as_ref().map(|map| map.header.frame_id.as_str()), expected, "{frame}");
        assert!(named.is_none_or(|named| named.data == map.data));
    }
}

#[test]
fn a_message_that_does_not_match_its_type_keeps_its_frames_and_a_missing_definition_is_reported() {
    let folder = Folder::new();
    let mut log = TestLog::new(layouts()[1].clone());
    log.raw("/map", OccupancyGrid::NAME, 1, b"\0\x01\0\0cut").raw("/x", "p/msg/X", 2, b"?");
    let path = folder.write("a.mcap", &log.finish());
    let input = Input { robot: Some("robot1".into()), path };
    let (mut reader, names) = open(&[input], &NameRules::default(), &RobotTopics::default()).unwrap();
    assert_eq!(names.rename_frames(&reader.next_message().unwrap(), &mut Vec::new()), Renamed::Unreadable);
    let message = reader.next_message().unwrap();
    let why = names.unrenamed_frames(message.file, message.channel).unwrap();
    assert!(why.contains("/robot1/x") && why.contains("p/msg/X"), "{why}");
    assert_eq!(names.rename_frames(&message, &mut Vec::new()), Renamed::AsLogged);
}
