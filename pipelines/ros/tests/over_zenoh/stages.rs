//! The stages by themselves against sessions of Zenoh that do what nodes of ROS 2 do, over a router on this machine.

use crate::waiting::{give, sent, wait_for, warned};
use crate::wire::{Robot, Router, Sender, WATCHDOG, topic};
use gridweave_ros::key_expression::{NO_HASH, Topic};
use gridweave_ros::qos::Qos;
use gridweave_runtime::message::LogTime;
use gridweave_runtime::pipeline::{Mode, Overrides, Pipeline};
use gridweave_runtime::ros::{
    Header, MapMetaData, MarkerArray, OccupancyGrid, PoseStamped, PoseWithCovarianceStamped, RobotFrame, RobotFrames,
    RosMessage, TFMessage, TransformStamped, Vector3, decode, encode,
};
use gridweave_runtime::stage::{Context, InputWire, StageHarness};
use std::time::Instant;

pub(crate) fn map(robot: &str, occupied: u8) -> Vec<u8> {
    let info = MapMetaData { width: 2, height: 1, resolution: 0.05, ..Default::default() };
    let header = Header::new(LogTime(1_000_000_000), format!("{robot}map"));
    encode(&OccupancyGrid { header, info, data: &[0, occupied] }).unwrap()
}

fn source(router: &Router) -> StageHarness {
    source_with(router, "")
}

pub(crate) fn source_with(router: &Router, parameters: &str) -> StageHarness {
    StageHarness::new(&gridweave_ros::source::kind(), &format!("{}\n{parameters}", router.parameters())).unwrap()
}

/// Lets a source go on until it hears what is published.
#[track_caller]
pub(crate) fn wait_until_heard(source: &mut StageHarness, sender: &Sender) {
    wait_for(source, "subscription", |_| sender.is_heard());
}

/// A sink of this run with wires that carry messages of these types on these topics.
pub(crate) fn sink(parameters: &str, wires: &[(&'static str, &str)]) -> StageHarness {
    let wire = |(ros_type, topic): &(&str, &str)| InputWire {
        port: "in",
        from: "a".into(),
        ros_type: (*ros_type).to_owned(),
        topic: (*topic).to_owned(),
        ..Default::default()
    };
    let context = Context { stage: "ros".into(), inputs: wires.iter().map(wire).collect(), ..Default::default() };
    StageHarness::with_context(&gridweave_ros::sink::kind(), parameters, &context).unwrap()
}

#[test]
fn a_map_that_was_sent_before_comes_and_those_after_it_too() {
    let router = Router::start();
    let robot = Robot::start(&router, "slam_toolbox");
    let mut maps = robot.publish(&topic("/robot1/map", OccupancyGrid::NAME), Qos::latched(1));
    maps.send(&map("", 10));
    let mut source = source(&router);
    let first = sent(&mut source, "map", 1).remove(0);
    let grid: OccupancyGrid<'_> = first.decode().unwrap();
    assert_eq!((first.robot(), grid.header.frame_id.as_str(), grid.data), ("robot1", "robot1/map", &[0, 10][..]));
    assert!(first.header().log_time > LogTime::MIN);
    maps.send(&map("", 20));
    let second = sent(&mut source, "map", 1).remove(0);
    assert_eq!(second.decode::<OccupancyGrid<'_>>().unwrap().data, [0, 20]);
    assert!(second.header().log_time >= first.header().log_time);
}

#[test]
fn what_gridweave_publishes_is_no_map_of_a_robot() {
    let router = Router::start();
    let mut merged = sink(&router.parameters(), &[(OccupancyGrid::NAME, "/fleet/map")]);
    give(&mut merged, 0, "/fleet/map", map("", 1));
    let mut source = source(&router);
    let robot = Robot::start(&router, "slam_toolbox");
    let mut maps = robot.publish(&topic("/robot1/map", OccupancyGrid::NAME), Qos::latched(1));
    for value in 1..4 {
        give(&mut merged, 0, "/fleet/map", map("", value));
        maps.send(&map("", value));
        assert!(sent(&mut source, "map", 1).iter().all(|message| message.robot() == "robot1"));
    }
}

#[test]
fn a_robot_that_comes_late_and_one_that_comes_again_are_heard() {
    let router = Router::start();
    let mut source = source(&router);
    for value in [1, 2] {
        let robot = Robot::start(&router, "slam_toolbox");
        let mut maps = robot.publish(&topic("/robot1/map", OccupancyGrid::NAME), Qos::latched(1));
        maps.send(&map("robot1/", value));
        let message = sent(&mut source, "map", 1).remove(0);
        assert_eq!(message.decode::<OccupancyGrid<'_>>().unwrap().data, [0, value]);
    }
}

#[test]
fn poses_come_from_their_topic_and_without_one_from_tf() {
    let router = Router::start();
    let robot = Robot::start(&router, "robot");
    let mut source = source(&router);
    let mut maps = robot.publish(&topic("/robot1/map", OccupancyGrid::NAME), Qos::latched(1));
    maps.send(&map("robot1/", 1));
    sent(&mut source, "map", 1);
    let edge = |parent: &str, child: &str, x| TransformStamped {
        header: Header::new(LogTime(5), parent),
        child_frame_id: child.into(),
        transform: gridweave_runtime::ros::Transform {
            translation: Vector3 { x, ..Default::default() },
            ..Default::default()
        },
    };
    let transforms = vec![edge("robot1/map", "robot1/odom", 1.0), edge("robot1/odom", "robot1/base_link", 2.0)];
    let mut tf = robot.publish(&topic("/tf", TFMessage::NAME), Qos::reliable(10));
    wait_until_heard(&mut source, &tf);
    tf.send(&encode(&TFMessage { transforms }).unwrap());
    let pose = sent(&mut source, "pose", 1).remove(0);
    assert_eq!(pose.decode::<PoseWithCovarianceStamped>().unwrap().pose.pose.position.x, 3.0);

    let mut poses = robot.publish(&topic("/robot1/pose", PoseStamped::NAME), Qos::reliable(10));
    wait_until_heard(&mut source, &poses);
    let mut said = PoseStamped { header: Header::new(LogTime(6), "map"), ..Default::default() };
    said.pose.position.x = 9.0;
    poses.send(&encode(&said).unwrap());
    let pose = sent(&mut source, "pose", 1).remove(0);
    let pose: PoseWithCovarianceStamped = pose.decode().unwrap();
    assert_eq!((pose.pose.pose.position.x, pose.header.frame_id.as_str()), (9.0, "robot1/map"));
}

#[test]
fn unusable_topics_are_reported_and_the_others_received() {
    let router = Router::start();
    let robot = Robot::start(&router, "robot");
    let mut source = source(&router);
    let mut other = topic("/robot1/map", OccupancyGrid::NAME);
    other.type_hash = format!("RIHS01_{}", "0".repeat(64));
    let _others = robot.publish(&other, Qos::latched(1));
    let text = warned(&mut source, "another definition");
    assert!(text.contains("RIHS01_00000000 there"), "{text}");

    let mut wrong = robot.publish(&topic("/robot2/map", PoseStamped::NAME), Qos::latched(1));
    wrong.send(&[0, 1, 0, 0]);
    assert!(warned(&mut source, "/robot2/map").contains("carries geometry_msgs/msg/PoseStamped"));

    let mut maps = robot.publish(&topic("/robot3/map", OccupancyGrid::NAME), Qos::latched(1));
    maps.send(&[0, 1, 0, 0, 1, 2, 3]);
    assert!(warned(&mut source, "do not match their type").contains("/robot3/map"));
    maps.send(&map("", 3));
    assert_eq!(sent(&mut source, "map", 1)[0].robot(), "robot3");
    assert!(source.take_messages("map").is_empty());
}

#[test]
fn two_robots_of_one_name_are_reported_and_a_hash_unknown_to_ros_is_none() {
    let router = Router::start();
    let mut source = source(&router);
    let mut unknown = topic("/robot1/map", OccupancyGrid::NAME);
    unknown.type_hash = gridweave_ros::key_expression::NO_HASH.to_owned();
    let one = Robot::start(&router, "slam_of_one");
    let mut maps = one.publish(&unknown, Qos::latched(1));
    maps.send(&map("", 1));
    sent(&mut source, "map", 1);
    assert!(source.warnings().is_empty(), "{:?}", source.warnings());
    let other = Robot::start(&router, "slam_of_other");
    let mut others = other.publish(&topic("/robot1/map", OccupancyGrid::NAME), Qos::latched(1));
    let text = warned(&mut source, "two robots of one name");
    assert!(text.contains("/slam_of_one") && text.contains("/slam_of_other"), "{text}");
    others.send(&map("", 2));
    assert_eq!(sent(&mut source, "map", 1)[0].decode::<OccupancyGrid<'_>>().unwrap().data, [0, 2]);
}

#[test]
fn a_source_without_a_router_says_so_and_goes_on() {
    let router = Router::nowhere();
    let text = warned(&mut source(&router), "no Zenoh router");
    assert!(text.contains("rmw_zenohd") && text.contains(router.endpoint()), "{text}");
}

#[test]
fn a_domain_without_publishers_is_reported_with_the_likely_reasons() {
    let router = Router::start();
    let mut source = source_with(&router, "discovery_timeout = 0.1");
    let text = warned(&mut source, "nobody publishes");
    assert!(text.contains("Fast DDS") && text.contains("rmw_zenoh_cpp") && text.contains("ROS_DOMAIN_ID"), "{text}");
    let robot = Robot::start(&router, "slam_toolbox");
    let mut maps = robot.publish(&topic("/robot1/map", OccupancyGrid::NAME), Qos::latched(1));
    maps.send(&map("", 10));
    assert_eq!(sent(&mut source, "map", 1).len(), 1, "it goes on");
}

#[test]
fn late_joiners_get_the_merged_map_also_after_a_restart() {
    let router = Router::start();
    let viewer = Robot::start(&router, "viewer");
    let topic = topic("/map", OccupancyGrid::NAME);
    let early = viewer.subscribe(&topic, Qos::latched(1));
    let sink = |value| {
        let mut sink = sink(&router.parameters(), &[(OccupancyGrid::NAME, "/map")]);
        give(&mut sink, 0, "/map", map("", value));
        sink
    };
    let of_value = |message: Vec<u8>| decode::<OccupancyGrid<'_>>(&message).unwrap().data[1];
    let first = sink(7);
    assert_eq!(of_value(early.next()), 7);
    let late = viewer.subscribe(&topic, Qos::latched(1));
    assert_eq!(of_value(late.next()), 7);
    drop(first);
    let _second = sink(8);
    assert_eq!((of_value(early.next()), of_value(late.next())), (8, 8));
}

/// Types have no hash in Humble.
#[test]
fn subscribers_without_a_hash_of_the_type_get_the_last_map_and_those_after_it() {
    let router = Router::start();
    let mut sink = sink(&router.parameters(), &[(OccupancyGrid::NAME, "/map")]);
    give(&mut sink, 0, "/map", map("", 10));
    let robot = Robot::start(&router, "rviz");
    robot.wait_for_token(&format!("/{}/:1:,1:,:,:,,", topic("/map", OccupancyGrid::NAME).type_hash));
    let old = Topic { type_hash: NO_HASH.into(), ..topic("/map", OccupancyGrid::NAME) };
    for value in [20, 30] {
        let subscriber = robot.subscribe(&old, Qos::latched(1));
        assert_eq!(subscriber.next(), map("", value - 10));
        give(&mut sink, 0, "/map", map("", value));
        assert_eq!(subscriber.next(), map("", value));
    }
}

#[test]
fn programs_that_ask_see_the_node_and_its_topics() {
    let router = Router::start();
    let mut sink = sink(&router.parameters(), &[(MarkerArray::NAME, "/markers/graph")]);
    give(&mut sink, 0, "/markers/graph", encode(&MarkerArray::default()).unwrap());
    let viewer = Robot::start(&router, "viewer");
    let graph = topic("/markers/graph", MarkerArray::NAME).type_hash;
    viewer.wait_for_token("/%/gridweave_ros");
    viewer.wait_for_token(&format!(
        "/%/gridweave_ros/%markers%graph/visualization_msgs::msg::dds_::MarkerArray_/{graph}/:1:,1:,:,:,,"
    ));
}

fn world_to(child: &str, x: f64) -> TransformStamped {
    let mut transform = TransformStamped { child_frame_id: child.into(), ..Default::default() };
    transform.header.frame_id = "world".into();
    transform.transform.translation.x = x;
    transform.transform.rotation.w = 1.0;
    transform
}

#[test]
fn frames_are_published_together_and_do_not_jump() {
    let router = Router::start();
    let mut sink = sink(&router.parameters(), &[(RobotFrames::NAME, "/robot_frames"), (TFMessage::NAME, "/tf_static")]);
    let viewer = Robot::start(&router, "viewer");
    let heard = viewer.subscribe(&topic("/tf_static", TFMessage::NAME), Qos::latched(1));
    let mut give_frame = |robot: &str, x| {
        let frame_id = format!("{robot}/map");
        let covariance = [0.01, 0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.0, 0.0001];
        let frame = RobotFrame { robot: robot.into(), frame_id: frame_id.clone(), x, covariance, ..Default::default() };
        let frames = RobotFrames { frames: vec![frame], ..Default::default() };
        give(&mut sink, 0, "/robot_frames", encode(&frames).unwrap());
        let transforms = vec![world_to(&frame_id, x)];
        give(&mut sink, 1, "/tf_static", encode(&TFMessage { transforms }).unwrap());
    };
    let places = |message: Vec<u8>| -> Vec<(String, f64)> {
        let message: TFMessage = decode(&message).unwrap();
        message.transforms.into_iter().map(|edge| (edge.child_frame_id, edge.transform.translation.x)).collect()
    };
    let at = |one: f64, two: f64| vec![("robot1/map".to_owned(), one), ("robot2/map".to_owned(), two)];
    give_frame("robot1", 0.0);
    assert_eq!(places(heard.next()), at(0.0, 5.0)[..1]);
    give_frame("robot2", 5.0);
    assert_eq!(places(heard.next()), at(0.0, 5.0));
    give_frame("robot2", 5.1);
    give_frame("robot2", 6.0);
    assert_eq!(places(heard.next()), at(0.0, 6.0), "5.1 is within what it is uncertain");
    assert_eq!(places(viewer.subscribe(&topic("/tf_static", TFMessage::NAME), Qos::latched(1)).next()), at(0.0, 6.0));
    assert_eq!(sink.counts()["frames moved"], 1);
}

#[test]
fn the_frame_of_a_robot_with_its_own_tree_is_published_there() {
    let router = Router::start();
    let robot = Robot::start(&router, "slam_toolbox");
    let _tree = robot.publish(&topic("/robot2/tf", TFMessage::NAME), Qos::reliable(10));
    let heard = robot.subscribe(&topic("/robot2/tf_static", TFMessage::NAME), Qos::latched(1));
    let mut sink =
        sink(&router.parameters(), &[(TFMessage::NAME, "/tf_static"), (MarkerArray::NAME, "/markers/graph")]);
    let transforms = vec![world_to("robot1/map", 1.0), world_to("robot2/map", 2.0)];
    give(&mut sink, 0, "/tf_static", encode(&TFMessage { transforms }).unwrap());
    // The robot may become known only now.
    let until = Instant::now() + WATCHDOG;
    let message = loop {
        give(&mut sink, 1, "/markers/graph", encode(&MarkerArray::default()).unwrap());
        if let Some(message) = heard.try_next() {
            break message;
        }
        assert!(Instant::now() < until, "nothing has come");
        std::thread::yield_now();
    };
    assert_eq!(decode::<TFMessage>(&message).unwrap().transforms, [world_to("map", 2.0)]);
}

#[test]
fn a_pipeline_with_robots_is_a_live_one() {
    let registry = gridweave::shipped::registry(gridweave_ros::kinds());
    let parse = |text: &str| Pipeline::parse("live_ros.toml", text, &registry, &Overrides::default());
    assert_eq!(parse(include_str!("../../live_ros_scans.toml")).unwrap().mode, Mode::Live);
    let text = include_str!("../../live_ros.toml");
    assert_eq!(parse(text).unwrap().mode, Mode::Live);
    let error = parse(&text.replace("mode = \"live\"", "")).err().unwrap().to_string();
    assert!(error.contains("`ros_source` is for live pipelines"), "{error}");
}

#[test]
fn what_robots_have_sent_is_not_sent_to_them_again() {
    let inputs = vec![InputWire {
        port: "in",
        from: "robots".into(),
        ros_type: OccupancyGrid::NAME.into(),
        ..Default::default()
    }];
    let context = Context { stage: "ros".into(), inputs, ..Default::default() };
    let error = StageHarness::with_context(&gridweave_ros::sink::kind(), "", &context).err().unwrap();
    assert!(error.to_string().contains("would be sent back to them"), "{error}");
}
