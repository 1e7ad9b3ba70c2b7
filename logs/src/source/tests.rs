use super::*;
use crate::schemas::full_type_name;
use crate::test_log::{Folder, TestLog, layouts};
use gridweave_runtime::message::{Channel, LogTime, Message, MessageFlags, MessageHeader};
use gridweave_runtime::ros::{
    Header, MapMetaData, Odometry, Pose, PoseStamped, PoseWithCovariance, RosMessage, TFMessage, TransformStamped,
};
use gridweave_runtime::stage::{
    Context, OutputEnd, OutputPort, OutputSink, RobotTopics, StageError, StageHarness, TfFrames,
};
use nalgebra::{Isometry2, Vector2};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;

mod batches;
mod clouds;
mod inferred_poses;
mod map_kinds;
mod map_updates;
mod pose_frames;
mod preview;

const ODOMETRY: &str = Odometry::NAME;
const POSE_WITH_COVARIANCE: &str = PoseWithCovarianceStamped::NAME;

/// A sent message: port, header and bytes.
type Sending = (&'static str, MessageHeader, Vec<u8>);

/// All that was sent, including announcements.
#[derive(Clone, Default)]
struct Everything(Rc<RefCell<Vec<Sending>>>);

struct Port(&'static str, Everything);

impl OutputSink for Port {
    fn send(&mut self, header: MessageHeader, bytes: &[u8]) -> Result<(), StageError> {
        self.1.0.borrow_mut().push((self.0, header, bytes.to_vec()));
        Ok(())
    }
}

struct Run {
    sent: Vec<Sending>,
    warnings: BTreeMap<String, u64>,
}

impl Run {
    /// The messages of a port.
    fn on(&self, port: &str) -> Vec<Message> {
        let is_data = |(at, header, _): &&Sending| *at == port && header.flags.contains(MessageFlags::DATA);
        self.sent.iter().filter(is_data).map(|(_, header, bytes)| Message::from_vec(*header, bytes.clone())).collect()
    }

    /// The topics and numbers announced on a port.
    fn announced(&self, port: &str) -> Vec<(u32, String)> {
        let is_channel = |(at, header, _): &&Sending| *at == port && header.flags.contains(MessageFlags::CHANNEL);
        let channel = |bytes: &[u8]| Channel::decode(bytes).unwrap().topic;
        self.sent.iter().filter(is_channel).map(|(_, header, bytes)| (header.channel, channel(bytes))).collect()
    }

    fn times(&self, port: &str) -> Vec<u64> {
        self.on(port).iter().map(|message| message.header().log_time.0).collect()
    }
}

fn try_run(files: Vec<PathBuf>, more: &str, robots: RobotTopics) -> Result<Run, StageError> {
    let mut parameters: toml::Table = more.parse().unwrap();
    let files: Vec<toml::Value> = files.iter().map(|file| file.to_str().unwrap().into()).collect();
    parameters.insert("files".into(), files.into());
    let everything = Everything::default();
    let kind = kind();
    let end = |port: &OutputPort| OutputEnd {
        topic: format!("/{{robot}}/log/{}", port.name),
        sink: Some(Box::new(Port(port.name, everything.clone()))),
    };
    let ends = kind.outputs.iter().map(end).collect();
    let context = Context { stage: "log".into(), robots, ..Default::default() };
    let mut source = kind.make(parameters, &context, ends)?;
    while source.advance()? {}
    Ok(Run { sent: everything.0.take(), warnings: source.warnings() })
}

fn run(files: Vec<PathBuf>) -> Run {
    try_run(files, "", RobotTopics::default()).unwrap()
}

/// The same, with the names in the logs.
fn run_as_logged(files: Vec<PathBuf>) -> Run {
    try_run(files, "names = 'as_logged'", RobotTopics::default()).unwrap()
}

fn write(fill: impl FnOnce(&mut TestLog)) -> (Folder, Vec<PathBuf>) {
    let folder = Folder::new();
    let mut log = TestLog::new(layouts()[3].clone());
    fill(&mut log);
    let path = folder.write("a.mcap", &log.finish());
    (folder, vec![path])
}

fn at(x: f64) -> Pose {
    Isometry2::new(Vector2::new(x, 0.0), 0.5).into()
}

fn grid() -> OccupancyGrid<'static> {
    OccupancyGrid {
        info: MapMetaData { width: 2, height: 1, ..Default::default() },
        data: &[0, 100],
        ..Default::default()
    }
}

fn reading() -> TagRange {
    TagRange { tag_id: "tag1".into(), range: 1.5, ..Default::default() }
}

#[test]
fn each_message_comes_on_its_port_as_it_was_logged() {
    let (_folder, files) = write(|log| {
        log.add("/robot1/map", OccupancyGrid::NAME, 10, &grid())
            .add("/robot1/pose", PoseStamped::NAME, 11, &PoseStamped { pose: at(1.0), ..Default::default() })
            .add("/robot2/tag_ranges", TagRange::NAME, 12, &reading())
            .raw("/robot1/scan", "sensor_msgs/msg/LaserScan", 13, b"scan");
    });
    let run = run_as_logged(files);
    let mut announced = BTreeMap::<&str, Vec<_>>::new();
    for (port, robot, topic, number) in [
        ("map", "robot1", "/robot1/map", 1),
        ("other", "robot1", "/robot1/pose", 2),
        ("tags", "robot2", "/robot2/tag_ranges", 3),
        ("other", "", "/robot1/scan", 4),
    ] {
        let announced = announced.entry(port).or_default();
        let messages = run.on(port);
        let header = messages[announced.len()].header();
        assert_eq!((messages[announced.len()].robot(), header.topic.as_str()), (robot, topic));
        assert_eq!((header.channel, header.log_sequence), (number, number));
        assert_eq!((header.log_time.0, header.publish_time), (9 + u64::from(number), 8 + u64::from(number)));
        announced.push((number, topic.to_owned()));
    }
    for (port, announced) in announced {
        assert_eq!((run.announced(port), run.on(port).len()), (announced.clone(), announced.len()));
    }
    assert_eq!(run.on("map")[0].decode::<OccupancyGrid<'_>>().unwrap(), grid());
    assert_eq!(run.on("other")[1].bytes(), b"scan");
    assert!(run.warnings.is_empty(), "{:?}", run.warnings);
}

#[test]
fn a_channel_is_announced_before_its_first_message_and_shared_between_files() {
    let (_one, mut files) = write(|log| {
        log.raw("/x", "p/msg/X", 1, b"1").raw("/x", "p/msg/X", 3, b"3");
    });
    let (_two, more) = write(|log| {
        log.raw("/y", "p/msg/Y", 0, b"0").raw("/x", "p/msg/X", 2, b"2").raw("/x", "p/msg/Z", 4, b"4");
    });
    files.extend(more);
    let run = run(files);
    assert_eq!(run.announced("other"), [(1, "/y".into()), (2, "/x".into()), (3, "/x".into())]);
    let sent: Vec<_> = run.sent.iter().map(|(_, header, _)| (header.flags.0, header.channel)).collect();
    let (data, channel) = (MessageFlags::DATA.0, MessageFlags::CHANNEL.0);
    assert_eq!(sent, [(channel, 1), (data, 1), (channel, 2), (data, 2), (data, 2), (data, 2), (channel, 3), (data, 3)]);
    assert_eq!(run.times("other"), [0, 1, 2, 3, 4]);
}

#[test]
fn poses_of_all_types_get_a_covariance_and_their_originals_are_passed_on() {
    let covariance = std::array::from_fn(|row| std::array::from_fn(|column| (10 * row + column) as f64));
    let odometry = Odometry {
        header: Header::new(LogTime(7), "odom"),
        child_frame_id: "base".into(),
        pose: PoseWithCovariance { pose: at(3.0), covariance },
        ..Default::default()
    };
    let with_covariance = PoseWithCovarianceStamped {
        header: Header::new(LogTime(8), "map"),
        pose: PoseWithCovariance { pose: at(4.0), covariance },
    };
    let without = PoseStamped { header: Header::new(LogTime(9), "map"), pose: at(5.0) };
    let (_folder, files) = write(|log| {
        log.add("/robot1/pose", ODOMETRY, 10, &odometry)
            .add("/robot2/pose", POSE_WITH_COVARIANCE, 11, &with_covariance)
            .raw("/robot1/pose", ODOMETRY, 12, b"cut")
            .add("/robot3/pose", PoseStamped::NAME, 13, &without)
            .raw("/robot3/pose", PoseStamped::NAME, 14, b"cut");
    });
    let run = run_as_logged(files);
    let poses: Vec<PoseWithCovarianceStamped> =
        run.on("pose").iter().map(|message| message.decode().unwrap()).collect();
    assert_eq!(poses[0], PoseWithCovarianceStamped { header: odometry.header.clone(), pose: odometry.pose });
    assert_eq!(poses[1], with_covariance);
    assert_eq!((poses[2].header.clone(), poses[2].pose.pose), (without.header.clone(), without.pose));
    assert_eq!((poses.len(), poses[2].pose.covariance), (3, [[0.0; 6]; 6]));
    let header = *run.on("pose")[0].header();
    assert_eq!((header.channel, header.topic.as_str(), header.robot.as_str()), (0, "/robot1/log/pose", "robot1"));
    assert_eq!(header.log_time.0, 10);
    assert!(run.announced("pose").is_empty(), "derived messages are not announced");
    assert_eq!(run.times("other"), [10, 11, 12, 13, 14], "their originals are passed on");
    assert_eq!(run.on("other")[0].decode::<Odometry>().unwrap(), odometry);
    assert_eq!(run.on("other")[3].decode::<PoseStamped>().unwrap(), without);
    assert_eq!(
        run.announced("other").iter().map(|(_, topic)| topic.as_str()).collect::<Vec<_>>(),
        ["/robot1/pose", "/robot2/pose", "/robot3/pose"]
    );
    for robot in ["robot1", "robot2", "robot3"] {
        let warning = format!("messages on `/{robot}/pose` could not be read as a pose");
        assert_eq!(run.warnings.contains_key(&warning), robot != "robot2");
    }
}

#[test]
fn a_topic_that_matches_with_another_type_goes_to_other_with_a_warning() {
    let (_folder, files) = write(|log| {
        log.raw("/robot1/map", "nav_msgs/msg/GridCells", 1, b"?").raw("/robot1/map", "nav_msgs/msg/GridCells", 2, b"?");
    });
    let run = run(files);
    assert_eq!((run.on("map").len(), run.on("other").len()), (0, 2));
    let warning = "`/robot1/map` fits `robots.map` but carries nav_msgs/msg/GridCells where nav_msgs/msg/OccupancyGrid is expected";
    assert!(run.warnings.contains_key(warning), "{:?}", run.warnings);
    assert!(run.warnings.keys().any(|warning| warning.starts_with("no map was found")));
}

#[test]
fn a_type_name_without_msg_is_known() {
    let (_folder, files) = write(|log| {
        log.add("/robot1/map", "nav_msgs/OccupancyGrid", 1, &grid());
    });
    assert_eq!(run(files).on("map").len(), 1);
    assert_eq!(full_type_name("nav_msgs/msg/OccupancyGrid"), "nav_msgs/msg/OccupancyGrid");
    assert_eq!(full_type_name("foxglove.Pose"), "foxglove.Pose");
}

#[test]
fn poses_are_derived_from_tf_and_tf_is_passed_on() {
    let transforms = |x: f64| TFMessage {
        transforms: vec![TransformStamped {
            header: Header::new(LogTime(5), "map"),
            child_frame_id: "base_link".into(),
            transform: Isometry2::new(Vector2::new(x, 0.0), 0.0).into(),
        }],
    };
    let (_folder, files) = write(|log| {
        log.add("/robot1/tf", TFMessage::NAME, 1, &transforms(1.0))
            .add("/robot2/tf", TFMessage::NAME, 2, &transforms(2.0))
            .add("/robot1/tf", TFMessage::NAME, 3, &transforms(f64::NAN))
            .raw("/robot1/tf", TFMessage::NAME, 4, b"\0\x01\0\0cut")
            .add("/robot1/pose", PoseStamped::NAME, 5, &PoseStamped::default());
    });
    let frames = |map: &str| TfFrames { map_frame: map.into(), base_frame: "{robot}/base_link".into() };
    let robots = RobotTopics { tf: Some(frames("{robot}/map")), ..Default::default() };
    let run = try_run(files.clone(), "", robots).unwrap();
    let poses: Vec<_> = run.on("pose").iter().map(|message| message.robot().to_owned()).collect();
    assert_eq!(poses, ["robot1", "robot2"]);
    assert_eq!(run.on("pose")[1].decode::<PoseWithCovarianceStamped>().unwrap().header.frame_id, "robot2/map");
    assert_eq!(run.times("other"), [1, 2, 3, 4, 5]);
    assert_eq!(run.warnings.len(), 5, "not finite, not readable (twice), no map, no tags: {:?}", run.warnings);
    let robots = RobotTopics { tf: Some(frames("map")), ..Default::default() };
    assert!(try_run(files, "", robots).err().unwrap().to_string().contains("{robot}/map"));
}

#[test]
fn latched_messages_before_the_start_are_sent_at_the_start() {
    let latched = BTreeMap::from([("offered_qos_profiles".to_owned(), "- history: 3\n  durability: 1\n".to_owned())]);
    let second = 1_000_000_000;
    let (_folder, files) = write(|log| {
        log.add("/robot1/map", OccupancyGrid::NAME, 0, &OccupancyGrid::default())
            .add("/robot1/map", OccupancyGrid::NAME, second, &grid())
            .raw("/tf_static", TFMessage::NAME, second, b"a")
            .raw("/tf_static", TFMessage::NAME, second + 1, b"b")
            .with_metadata("/description", "p/msg/D", second, b"d", &latched)
            .raw("/scan", "p/msg/S", second, b"s")
            .raw("/scan", "p/msg/S", 2 * second, b"S")
            .raw("/scan", "p/msg/S", 3 * second, b"S")
            .raw("/scan", "p/msg/S", 4 * second, b"s");
    });
    let run = try_run(files.clone(), "start = 1.5\nend = 3.0", RobotTopics::default()).unwrap();
    assert_eq!(run.times("map"), [second * 3 / 2]);
    let named = OccupancyGrid { header: Header { frame_id: "robot1/map".into(), ..Default::default() }, ..grid() };
    assert_eq!(run.on("map")[0].decode::<OccupancyGrid<'_>>().unwrap(), named);
    let others: Vec<_> = run.on("other").iter().map(|message| message.bytes().to_vec()).collect();
    assert_eq!(others, [b"a", b"d", b"b", b"S", b"S"]);
    let times: Vec<_> = run.sent.iter().map(|(_, header, _)| header.log_time).collect();
    assert!(times.is_sorted());
    // A log that ends before the start still gives its last map.
    let run = try_run(files, "start = 100.0", RobotTopics::default()).unwrap();
    assert_eq!((run.on("map").len(), run.on("other").len()), (1, 3));
}

/// A run of a log with a map and tag readings of `robot1` and of a robot whose name has so many bytes.
fn run_with_a_name_of(bytes: usize) -> Run {
    let topic = format!("/{}/map", "r".repeat(bytes));
    let (_folder, files) = write(|log| {
        log.add(&topic, OccupancyGrid::NAME, 1, &grid()).add("/robot1/map", OccupancyGrid::NAME, 2, &grid());
        log.raw(&topic.replace("/map", "/tag_ranges"), TagRange::NAME, 3, b"?");
    });
    run(files)
}

#[test]
fn a_robot_whose_name_is_too_long_is_left_out_with_a_warning() {
    assert_eq!(run_with_a_name_of(64).times("map"), [1, 2]);
    // A message dropped for its topic is not also reported as one of no robot.
    for (bytes, named, dropped) in [(65, 2, 0), (120, 1, 1), (255, 0, 2), (60_000, 0, 2)] {
        let run = run_with_a_name_of(bytes);
        assert_eq!((run.times("map"), run.times("other").len()), (vec![2], 2 - dropped), "{bytes} bytes");
        let warned = |text: &str| run.warnings.keys().filter(|warning| warning.contains(text)).count();
        let of_name = format!("the robot's name has {bytes} bytes, and at most 64 fit; rename the topic");
        assert_eq!((warned(&of_name), warned("at most 128 fit")), (named, dropped), "{:?}", run.warnings);
        assert!(run.warnings.keys().all(|warning| warning.len() < 500), "{:?}", run.warnings);
    }
}

#[test]
fn a_source_without_files_is_an_error_with_a_fix() {
    let error = try_run(Vec::new(), "", RobotTopics::default()).err().unwrap().to_string();
    assert!(error.contains("--input"), "{error}");
    let files = vec!["/nowhere/a.mcap".into()];
    let error = try_run(files, "", RobotTopics::default()).err().unwrap();
    assert!(error.to_string().contains("/nowhere/a.mcap"));
}

#[test]
fn parameters_out_of_range_are_reported() {
    let wrong =
        SourceParameters { rename: vec!["/map".into()], start: -1.0, end: Some(f64::NAN), ..Default::default() };
    assert_eq!(wrong.check().iter().map(|error| error.field.as_str()).collect::<Vec<_>>(), ["start", "end", "rename"]);
    assert!(SourceParameters::default().check().is_empty());
}

#[test]
fn damage_is_warned_of_and_counted() {
    let folder = Folder::new();
    let mut log = TestLog::new(layouts()[1].clone());
    for _ in 0..3 {
        log.raw("/x", "p/msg/X", 1, &[7; 50]).flush();
    }
    let mut bytes = log.finish();
    let place = bytes.windows(50).rposition(|window| window == [7; 50]).unwrap();
    bytes[place] = 8;
    bytes.truncate(bytes.len() - 20);
    let run = run(vec![folder.write("a.mcap", &bytes)]);
    assert_eq!(run.on("other").len(), 2);
    assert!(run.warnings.keys().any(|warning| warning.contains("has no end")), "{:?}", run.warnings);
    assert!(run.warnings.keys().any(|warning| warning.contains("checksum")), "{:?}", run.warnings);
}

#[test]
fn a_source_that_is_done_has_done_all_its_work() {
    let (_folder, files) = write(|log| {
        log.add("/robot1/map", OccupancyGrid::NAME, 1, &grid());
    });
    let mut source = StageHarness::new(&kind(), &format!("files = [{:?}]", files[0])).unwrap();
    while source.node().advance().unwrap() {}
    assert_eq!(source.node().progress(), Some(1.0));
}

#[test]
fn a_name_that_is_too_long_is_only_a_warning_if_the_topic_is_unused() {
    let (long, robot) = (format!("/{}", "x".repeat(128)), "r".repeat(65));
    let (_folder, files) = write(|log| {
        log.add("/robot1/map", OccupancyGrid::NAME, 1, &grid());
        log.raw(&long, "p/msg/A", 2, b"a");
        log.raw(&long, "p/msg/A", 3, b"a");
        // The topic matches the pose pattern, but the type is another.
        log.raw(&format!("/{robot}/pose"), "p/msg/A", 4, b"a");
        log.raw(&long[..128], "p/msg/A", 5, b"a");
    });
    let run = run(files);
    assert_eq!((run.times("map"), run.times("other")), (vec![1], vec![4, 5]));
    let warned: Vec<u64> =
        run.warnings.iter().filter(|(text, _)| text.contains("at most 128 fit")).map(|(_, count)| *count).collect();
    assert_eq!(warned, [2], "{:?}", run.warnings);
}

#[test]
fn the_thresholds_of_a_map_beside_logs_are_applied_by_the_parameter() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("robot1.yaml");
    let info = MapMetaData { resolution: 0.05, width: 3, height: 1, ..Default::default() };
    crate::map_file::save(&file, &crate::map_file::GridMap { info, cells: vec![0, 100, -1] }).unwrap();
    let text = std::fs::read_to_string(&file).unwrap();
    assert!(text.contains("free_thresh: 0.196"), "{text}");
    std::fs::write(&file, text.replace("free_thresh: 0.196", "free_thresh: 0.25")).unwrap();
    for (more, unknown) in [("", 255), ("literal_thresholds = true", 0)] {
        let run = try_run(vec![file.clone()], more, RobotTopics::default()).unwrap();
        let maps = run.on("map");
        let map: OccupancyGrid<'_> = maps[0].decode().unwrap();
        assert_eq!(map.data, [0, 100, unknown], "{more}");
    }
}
