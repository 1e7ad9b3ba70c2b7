use super::*;
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{TransformStamped, Vector3};
use nalgebra::{Isometry2, Vector2};
use std::f64::consts::FRAC_PI_2;

fn edge(parent: &str, child: &str, x: f64, y: f64, yaw: f64) -> TransformStamped {
    TransformStamped {
        header: Header::new(LogTime((x.abs() * 1e9) as u64), parent),
        child_frame_id: child.into(),
        transform: Isometry2::new(Vector2::new(x, y), yaw).into(),
    }
}

fn message(transforms: impl Into<Vec<TransformStamped>>) -> TFMessage {
    TFMessage { transforms: transforms.into() }
}

fn poses_of(frames: (&str, &str)) -> TfPoses {
    TfPoses::new(TfFrames { map_frame: frames.0.into(), base_frame: frames.1.into() })
}

fn robots() -> TfPoses {
    poses_of(("{robot}/map", "{robot}/base_link"))
}

#[test]
fn a_pose_is_the_product_of_the_chain_from_map_to_base() {
    let mut tf = robots();
    assert!(tf.update("", false, &message([edge("r1/map", "r1/odom", 1.0, 2.0, FRAC_PI_2)])).0.is_empty());
    assert_eq!(tf.robots_without_pose(), BTreeSet::from(["r1"]));
    let (poses, unusable) = tf.update("", false, &message([edge("r1/odom", "r1/base_link", 3.0, 0.0, 0.5)]));
    let [(robot, pose)] = &poses[..] else { panic!("{poses:?}") };
    assert_eq!((robot.as_str(), pose.header.frame_id.as_str(), unusable), ("r1", "r1/map", 0));
    assert_eq!(pose.header.stamp.sec, 3, "the stamp of the edge that changed the pose");
    let planar = pose.pose.planar();
    assert!((planar.translation.vector - Vector2::new(1.0, 5.0)).norm() < 1e-9);
    assert!((planar.rotation.angle() - (FRAC_PI_2 + 0.5)).abs() < 1e-9);
    assert!(tf.robots_without_pose().is_empty());
}

#[test]
fn a_pose_is_derived_only_when_its_base_moves_and_once_per_message() {
    let mut tf = robots();
    let chain = [edge("r1/map", "r1/odom", 1.0, 0.0, 0.0), edge("r1/odom", "r1/base_link", 2.0, 0.0, 0.0)];
    assert_eq!(tf.update("", false, &message(chain.clone())).0.len(), 1);
    assert!(tf.update("", false, &message([edge("r1/base_link", "r1/laser", 0.1, 0.0, 0.0)])).0.is_empty());
    assert!(tf.update("", false, &message([edge("world", "r1/map", 9.0, 0.0, 0.0)])).0.is_empty());
    assert!(tf.update("", false, &message([])).0.is_empty());
    assert!(tf.update("", false, &message([chain[0].clone()])).0.is_empty());
    assert_eq!(tf.update("", false, &message([chain[1].clone()])).0.len(), 1);
}

#[test]
fn a_correction_that_is_dated_into_the_future_gives_no_pose_and_no_later_stamp() {
    let mut tf = robots();
    // The base is mounted on a moving frame, and the stamp of these edges is their x in seconds.
    let mount = edge("r1/footprint", "r1/base_link", 0.5, 0.0, 0.0);
    assert!(tf.update("", true, &message([mount])).0.is_empty());
    assert!(tf.update("", false, &message([edge("r1/map", "r1/odom", 9.0, 0.0, 0.0)])).0.is_empty());
    let moved = |x| message([edge("r1/odom", "r1/footprint", x, 0.0, 0.0)]);
    assert_eq!(tf.update("", false, &moved(1.0)).0[0].1.header.stamp.sec, 1);
    assert!(tf.update("", false, &message([edge("r1/map", "r1/odom", 20.0, 0.0, 0.0)])).0.is_empty());
    let (poses, _) = tf.update("", false, &moved(2.0));
    assert_eq!((poses[0].1.header.stamp.sec, poses[0].1.pose.position.x), (2, 22.5));
}

#[test]
fn the_first_connected_frame_is_the_base_from_then_on() {
    let ends =
        PoseFrames { map: "map".into(), bases: ["r1/base_link", "r1/base_footprint"].map(str::to_owned).to_vec() };
    let mut tf = TfPoses::default();
    tf.set_robots(BTreeMap::from([("r1".to_owned(), ends)]));
    tf.set_map_frame("r1", "r1/slam_map");
    assert!(tf.update("", false, &message([edge("r1/map", "r1/base_link", 1.0, 0.0, 0.0)])).0.is_empty());
    assert_eq!((tf.base_of("r1"), tf.robots_without_pose().len()), (None, 1));
    let (poses, _) = tf.update("", false, &message([edge("r1/slam_map", "r1/base_footprint", 2.0, 0.0, 0.0)]));
    assert_eq!((poses[0].1.header.frame_id.as_str(), poses[0].1.pose.position.x), ("r1/slam_map", 2.0));
    // From here on the other frame is not used, although it is connected.
    let (poses, _) = tf.update("", false, &message([edge("r1/slam_map", "r1/base_link", 5.0, 0.0, 0.0)]));
    assert!(poses.is_empty());
    assert_eq!((tf.base_of("r1"), tf.map_frame("r1")), (Some("r1/base_footprint"), Some("r1/slam_map")));
    assert!(tf.knows("r1") && !tf.knows("r2"), "robots that were not set stay unknown");
}

#[test]
fn a_base_that_never_moves_has_a_pose() {
    let mut tf = robots();
    assert_eq!(tf.update("", true, &message([edge("r1/map", "r1/base_link", 1.0, 0.0, 0.0)])).0.len(), 1);
}

#[test]
fn frames_without_prefix_get_the_robots() {
    let mut tf = robots();
    let channel = channel("/robot2/tf", TFMessage::NAME);
    let prefix = tf_topic(&channel).unwrap();
    let transforms = message([edge("map", "/odom", 1.0, 0.0, 0.0), edge("odom", "robot2/base_link", 1.0, 0.0, 0.0)]);
    let (poses, _) = tf.update(prefix, false, &transforms);
    assert_eq!(poses[0].0, "robot2");
    assert_eq!(poses[0].1.pose.position.x, 2.0);
}

fn channel(topic: &str, type_name: &str) -> Channel {
    let (topic, schema_name) = (topic.to_owned(), type_name.to_owned());
    Channel { topic, schema_name, message_encoding: "cdr".into(), ..Default::default() }
}

#[test]
fn tf_topics_are_recognised() {
    let topics = ["/tf", "tf", "/tf_static", "/robot1/tf", "/fleet/r2/tf_static", "/tf2", "/robot1/tf/x"];
    let channels = topics.map(|topic| channel(topic, "tf2_msgs/TFMessage"));
    let found: Vec<_> = channels.iter().map(tf_topic).collect();
    assert_eq!(found, [Some(""), None, Some(""), Some("robot1"), Some("r2"), None, None]);
    assert_eq!(tf_topic(&channel("/tf", "std_msgs/msg/String")), None);
}

#[test]
fn a_base_and_a_map_with_a_common_ancestor_are_connected() {
    let mut tree = FrameTree::default();
    for edge in [edge("odom", "map", -1.0, 0.0, 0.0), edge("odom", "base", 4.0, 0.0, 0.0)] {
        assert!(tree.insert(&edge.header.frame_id, &edge.child_frame_id, &edge.transform, false));
    }
    assert!((tree.lookup("map", "base").unwrap().translation.x - 5.0).abs() < 1e-12);
    assert!((tree.lookup("base", "map").unwrap().translation.x + 5.0).abs() < 1e-12);
    assert_eq!(tree.lookup("map", "map"), Some(Isometry3::identity()));
    assert_eq!(tree.lookup("map", "elsewhere"), None);
}

#[test]
fn a_path_is_followed_over_a_thousand_transforms_and_no_further() {
    let frame = |depth: usize| format!("r1/{depth}");
    let mut tree = FrameTree::default();
    for depth in 0..20_000 {
        let edge = edge(&frame(depth), &frame(depth + 1), 1.0, 0.0, 0.0);
        assert!(tree.insert(&edge.header.frame_id, &edge.child_frame_id, &edge.transform, false));
    }
    let distance = |target: usize, source: usize| Some(tree.lookup(&frame(target), &frame(source))?.translation.x);
    assert_eq!(distance(500, 1500), Some(1000.0));
    assert_eq!(distance(1500, 500), Some(-1000.0));
    assert_eq!(distance(500, 1501), None);
    assert_eq!(distance(0, 20_000), None);
    assert_eq!(tree.ancestors(&frame(20_000)).count(), LONGEST_PATH + 1);
}

#[test]
fn a_circle_of_frames_ends() {
    let mut tf = robots();
    let circle = [
        edge("r1/a", "r1/base_link", 1.0, 0.0, 0.0),
        edge("r1/b", "r1/a", 1.0, 0.0, 0.0),
        edge("r1/base_link", "r1/b", 1.0, 0.0, 0.0),
        edge("r1/c", "r1/map", 1.0, 0.0, 0.0),
        edge("r1/map", "r1/c", 1.0, 0.0, 0.0),
        edge("r1/map", "r1/map", 1.0, 0.0, 0.0),
    ];
    let (poses, unusable) = tf.update("", false, &message(circle));
    assert_eq!((poses.len(), unusable), (0, 1));
    assert_eq!(tf.robots_without_pose(), BTreeSet::from(["r1"]));
}

#[test]
fn transforms_that_are_not_finite_are_ignored() {
    let mut tf = robots();
    assert_eq!(tf.update("", false, &message([edge("r1/map", "r1/base_link", f64::NAN, 0.0, 0.0)])), (Vec::new(), 1));
    assert_eq!(tf.update("", false, &message([edge("r1/map", "r1/base_link", f64::INFINITY, 0.0, 0.0)])).1, 1);
    assert_eq!(
        tf.update("", false, &message([edge("r1/map", "r1/base_link", 2.0, 0.0, 0.0)])).0[0].1.pose.position.x,
        2.0
    );
}

#[test]
fn a_zero_quaternion_is_no_rotation_and_a_tilted_frame_is_respected() {
    let mut tree = FrameTree::default();
    let zeros = Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 0.0 };
    let ahead = Vector3 { x: 1.0, y: 0.0, z: 0.0 };
    tree.insert("map", "odom", &Transform { translation: ahead, rotation: zeros }, false);
    // Upside down: left of it is right of its parent.
    let upside_down = Quaternion { x: 1.0, y: 0.0, z: 0.0, w: 0.0 };
    tree.insert("odom", "mount", &Transform { translation: ahead, rotation: upside_down }, false);
    let left = Vector3 { x: 0.0, y: 1.0, z: 0.0 };
    tree.insert("mount", "base", &Transform { translation: left, rotation: upside_down }, false);
    let base = tree.lookup("map", "base").unwrap();
    assert!((base.translation.vector - nalgebra::Vector3::new(2.0, -1.0, 0.0)).norm() < 1e-12);
    assert!(base.rotation.angle() < 1e-9);
}

/// Each message moves one robot, and the others are not looked up: 9 million chains would take a minute.
#[test]
fn thousands_of_robots_with_transforms_of_their_own_have_their_poses() {
    let mut tf = robots();
    let count = 3000;
    let mut found = 0;
    for number in 0..count {
        let frame = |name: &str| format!("r{number}/{name}");
        let edges = [("odom", "base_link"), ("map", "odom")].map(|(parent, child)| (frame(parent), frame(child)));
        found +=
            tf.update("", false, &message(edges.map(|(parent, child)| edge(&parent, &child, 1.0, 0.0, 0.0)))).0.len();
    }
    assert_eq!(found, count);
    // A tie between the trees of two robots moves neither of their bases.
    assert!(tf.update("", false, &message([edge("world", "r1/map", 1.0, 0.0, 0.0)])).0.is_empty());
}
