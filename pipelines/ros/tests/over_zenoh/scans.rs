//! Scans of robots that publish no map, taken by the source over a router on this machine.

use crate::stages::{map, wait_until_heard};
use crate::waiting::{sent, wait_for};
use crate::wire::{Robot, Router, Sender, WATCHDOG, topic};
use gridweave_ros::qos::Qos;
use gridweave_runtime::message::{LogTime, Message, MessageFlags};
use gridweave_runtime::ros::{
    Header, LaserEcho, LaserScan, MultiEchoLaserScan, OccupancyGrid, Odometry, PoseWithCovarianceStamped, RangeScan,
    RosMessage, TFMessage, Transform, TransformStamped, Vector3, encode,
};
use gridweave_runtime::stage::{Context, OutputEnd, StageHarness};
use std::time::{Duration, Instant};

fn source(router: &Router, wait_for_map: f64) -> StageHarness {
    let parameters = format!("{}\nwait_for_map = {wait_for_map:?}", router.parameters());
    StageHarness::new(&gridweave_ros::source::kind(), &parameters).unwrap()
}

fn edge(parent: &str, child: &str, x: f64) -> TransformStamped {
    let translation = Vector3 { x, ..Default::default() };
    TransformStamped {
        header: Header::new(LogTime(5), parent),
        child_frame_id: child.into(),
        transform: Transform { translation, ..Default::default() },
    }
}

fn transforms(edges: Vec<TransformStamped>) -> Vec<u8> {
    encode(&TFMessage { transforms: edges }).unwrap()
}

fn scan() -> Vec<u8> {
    let header = Header::new(LogTime(7_000_000_000), "laser");
    encode(&LaserScan { header, angle_increment: 0.1, ranges: vec![1.0, 2.0], ..Default::default() }).unwrap()
}

/// Sends until a message comes out on an output: what is sent before all is known that it needs is left out.
#[track_caller]
fn first_of(source: &mut StageHarness, output: &str, send: impl FnMut()) -> Message {
    first_that(source, output, |_| true, send)
}

/// Sends until a message comes out on an output that is the one expected: answers to what was sent before it may come
/// late.
#[track_caller]
fn first_that(
    source: &mut StageHarness,
    output: &str,
    is_expected: impl Fn(&Message) -> bool,
    mut send: impl FnMut(),
) -> Message {
    let mut first = None;
    wait_for(source, output, |source| {
        send();
        let is_data = |message: &Message| message.header().flags.contains(MessageFlags::DATA);
        first = source.take_messages(output).into_iter().find(|message| is_data(message) && is_expected(message));
        first.is_some()
    });
    first.unwrap()
}

#[test]
fn scans_come_as_the_base_sees_them_with_odometry_from_its_topic_or_from_tf() {
    let router = Router::start();
    let mut source = source(&router, 0.0);
    let robot = Robot::start(&router, "lidar");
    let mut mounts = robot.publish(&topic("/robot1/tf_static", TFMessage::NAME), Qos::latched(1));
    mounts.send(&transforms(vec![edge("base_link", "laser", 0.2)]));
    let mut scans = robot.publish(&topic("/robot1/scan", LaserScan::NAME), Qos::reliable(5));
    wait_until_heard(&mut source, &scans);
    let message = first_of(&mut source, "scans", || scans.send(&scan()));
    let seen: RangeScan = message.decode().unwrap();
    assert_eq!((message.robot(), seen.header.frame_id.as_str(), seen.x), ("robot1", "robot1/base_link", 0.2));
    assert_eq!((seen.header.stamp.sec, seen.ranges), (7, vec![1.0, 2.0]));

    let mut tf = robot.publish(&topic("/robot1/tf", TFMessage::NAME), Qos::reliable(10));
    wait_until_heard(&mut source, &tf);
    let message = first_of(&mut source, "odometry", || tf.send(&transforms(vec![edge("odom", "base_link", 3.0)])));
    let by_tf: PoseWithCovarianceStamped = message.decode().unwrap();
    assert_eq!((by_tf.header.frame_id.as_str(), by_tf.pose.pose.position.x), ("robot1/odom", 3.0));

    let mut odometry = robot.publish(&topic("/robot1/odom", Odometry::NAME), Qos::reliable(10));
    wait_until_heard(&mut source, &odometry);
    let mut driven = Odometry { header: Header::new(LogTime(5), "odom"), ..Default::default() };
    driven.pose.pose.position.x = 4.0;
    let x = |message: &Message| message.decode::<PoseWithCovarianceStamped>().unwrap().pose.pose.position.x;
    first_that(&mut source, "odometry", |pose| x(pose) == 4.0, || odometry.send(&encode(&driven).unwrap()));
    // From there on tf says nothing of the odometry.
    tf.send(&transforms(vec![edge("odom", "base_link", 5.0)]));
    driven.pose.pose.position.x = 6.0;
    let is_of_topic = |pose: &Message| {
        assert_ne!(x(pose), 5.0);
        x(pose) == 6.0
    };
    first_that(&mut source, "odometry", is_of_topic, || odometry.send(&encode(&driven).unwrap()));
}

#[test]
fn of_several_echoes_the_nearest_is_taken_and_a_pose_from_tf() {
    let router = Router::start();
    let mut source = source(&router, 0.0);
    let robot = Robot::start(&router, "lidar");
    let mut scans = robot.publish(&topic("/robot1/scan", MultiEchoLaserScan::NAME), Qos::reliable(5));
    wait_until_heard(&mut source, &scans);
    let ranges = vec![LaserEcho { echoes: vec![1.5, 3.0] }];
    let header = Header::new(LogTime(7), "base_link");
    let scan = encode(&MultiEchoLaserScan { header, ranges, ..Default::default() }).unwrap();
    let message = first_of(&mut source, "scans", || scans.send(&scan));
    assert_eq!(message.decode::<RangeScan>().unwrap().ranges, [1.5]);
    let mut tf = robot.publish(&topic("/tf", TFMessage::NAME), Qos::reliable(10));
    wait_until_heard(&mut source, &tf);
    let edges = || vec![edge("robot1/map", "robot1/odom", 1.0), edge("robot1/odom", "robot1/base_link", 2.0)];
    let message = first_of(&mut source, "pose", || tf.send(&transforms(edges())));
    assert_eq!(message.decode::<PoseWithCovarianceStamped>().unwrap().pose.pose.position.x, 3.0);
}

#[test]
fn a_robot_that_publishes_a_map_in_time_is_asked_for_no_scans() {
    let router = Router::start();
    let robot = Robot::start(&router, "slam_toolbox");
    let scans = robot.publish(&topic("/robot1/scan", LaserScan::NAME), Qos::reliable(5));
    let mut source = source(&router, 3600.0);
    let mut maps = robot.publish(&topic("/robot1/map", OccupancyGrid::NAME), Qos::latched(1));
    maps.send(&map("", 1));
    sent(&mut source, "map", 1);
    assert!(!scans.is_heard());
}

#[test]
fn scans_are_taken_until_the_robot_publishes_a_map() {
    let router = Router::start();
    let robot = Robot::start(&router, "robot");
    let mut source = source(&router, 0.0);
    let mut scans = robot.publish(&topic("/robot1/scan", LaserScan::NAME), Qos::reliable(5));
    wait_until_heard(&mut source, &scans);
    let mut maps = robot.publish(&topic("/robot1/map", OccupancyGrid::NAME), Qos::latched(1));
    maps.send(&map("", 1));
    sent(&mut source, "map", 1);
    wait_until_not_heard(&mut source, &scans);
    // Robots that have no map are not concerned.
    scans = robot.publish(&topic("/robot2/scan", LaserScan::NAME), Qos::reliable(5));
    wait_until_heard(&mut source, &scans);
    assert!(source.warnings().is_empty(), "{:?}", source.warnings());
}

#[test]
fn a_pipeline_that_reads_no_scans_asks_for_none() {
    let router = Router::start();
    let robot = Robot::start(&router, "robot");
    let scans = robot.publish(&topic("/robot1/scan", LaserScan::NAME), Qos::reliable(5));
    let maps = robot.publish(&topic("/robot2/map", OccupancyGrid::NAME), Qos::latched(1));
    let kind = gridweave_ros::source::kind();
    let end = |_: &_| OutputEnd { topic: String::new(), sink: None };
    let ends = kind.outputs.iter().map(end).collect();
    let parameters = format!("{}\nwait_for_map = 0.0", router.parameters()).parse().unwrap();
    let mut source = kind.make(parameters, &Context { stage: "robots".into(), ..Default::default() }, ends).unwrap();
    let until = Instant::now() + WATCHDOG;
    while !maps.is_heard() {
        assert!(Instant::now() < until, "the source does not subscribe");
        source.wait(Duration::from_millis(20));
        source.advance().unwrap();
    }
    assert!(!scans.is_heard());
}

/// Lets a source go on until it hears what is published no longer.
#[track_caller]
fn wait_until_not_heard(source: &mut StageHarness, sender: &Sender) {
    wait_for(source, "end of the subscription", |_| !sender.is_heard());
}
