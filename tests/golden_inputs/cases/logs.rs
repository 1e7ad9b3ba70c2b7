//! Inputs of `mcap_source`, `mcap_sink` and `foxglove_sink`: small logs.

use super::Case;
use gridweave_runtime::ros::{
    Header, OccupancyGridUpdate, Odometry, Pose, PoseWithCovariance, RosMessage, TFMessage, Transform,
    TransformStamped, encode,
};
use gridweave_stages::shared::geometry::pose;
use gridweave_tests::{LogBuilder, TestMap, header};

pub(super) fn cases() -> Vec<Case> {
    let source = |name, write| Case::new("mcap_source", name, write);
    vec![
        source("every_kind", every_kind),
        source("a_part", every_kind),
        source("tf", every_kind),
        source("map_updates", map_updates),
        source("no_pose_topic", no_pose_topic),
        source("other_topics", other_topics),
        source("tag_messages", tag_messages),
        source("tag_fields", tag_messages),
        source("nothing_fits", |log| {
            log.raw(1.0, "/chatter", "std_msgs/msg/String", STRING);
        }),
        Case::new("mcap_sink", "of_a_log", every_kind),
        Case::new("mcap_sink", "uncompressed", every_kind),
        Case::new("mcap_sink", "only_topics", every_kind),
        Case::new("mcap_sink", "without_the_input", every_kind),
        Case::new("foxglove_sink", "any_messages", every_kind),
    ]
}

/// `std_msgs/msg/String`: "hello".
const STRING: &[u8] = b"\x00\x01\x00\x00\x06\x00\x00\x00hello\x00";

/// Maps, poses of three types, transforms, range measurements, and an unknown type.
fn every_kind(log: &mut LogBuilder) {
    log.message(0.0, "/tf_static", &transform(0.0, "robot1/base_link", "robot1/antenna", 0.2));
    log.map(0.1, "robot1", &TestMap::filled(4, 3, 0.05, 0));
    for second in 0..4 {
        let seconds = 0.5 + f64::from(second);
        let x = 0.1 * f64::from(second);
        log.pose(seconds, "robot1", x, 0.0);
        log.message(seconds, "/robot2/pose", &odometry(seconds, x));
        log.raw(
            seconds,
            "/robot3/pose",
            "geometry_msgs/msg/PoseWithCovarianceStamped",
            &pose_with_covariance(seconds, x),
        );
        log.message(seconds, "/tf", &transform(seconds, "robot1/map", "robot1/odom", 1.0));
        log.message(seconds, "/tf", &transform(seconds, "robot1/odom", "robot1/base_link", x));
        log.reading(seconds + 0.05, "robot1", "tag", 1.5);
        log.raw(seconds + 0.1, "/chatter", "std_msgs/msg/String", STRING);
    }
    log.map(2.2, "robot1", &TestMap::filled(5, 3, 0.05, 100)).map(2.3, "robot2", &TestMap::filled(2, 2, 0.05, -1));
    // A topic of a map that holds something else.
    log.raw(2.4, "/robot3/map", "std_msgs/msg/String", STRING);
}

/// A map whose cells change part by part, among them parts that do not fit; one that shrinks and goes on; and a map of
/// another robot, without updates.
fn map_updates(log: &mut LogBuilder) {
    let update = |log: &mut LogBuilder, seconds, [x, y]: [i32; 2], [width, height]: [u32; 2], cell: i8| {
        let data = vec![cell as u8; (width * height) as usize];
        let update = OccupancyGridUpdate { header: header(seconds, "robot1/map"), x, y, width, height, data: &data };
        log.raw(seconds, "/robot1/map_updates", OccupancyGridUpdate::NAME, &encode(&update).unwrap());
    };
    update(log, 0.0, [0, 0], [1, 1], 100);
    log.map(0.1, "robot1", &TestMap::filled(6, 4, 0.05, -1)).map(0.2, "robot2", &TestMap::filled(2, 2, 0.05, 0));
    for second in 1..6 {
        update(log, f64::from(second), [second - 1, 1], [3, 3], if second % 2 == 0 { 100 } else { 0 });
    }
    log.map(6.0, "robot1", &TestMap::filled(4, 3, 0.1, 0).at(-1.0, 0.5, 0.3));
    update(log, 6.5, [3, 0], [1, 3], 100);
    update(log, 6.6, [3, 0], [2, 3], 100);
}

/// Robots without topics for their poses: one with a chain of transforms, one with odometry in the frame of its map,
/// one with odometry in another frame.
fn no_pose_topic(log: &mut LogBuilder) {
    log.message(0.0, "/tf_static", &transform(0.0, "robot1/base_footprint", "robot1/base_link", 0.25));
    for robot in ["robot1", "robot2", "robot3"] {
        log.map(0.1, robot, &TestMap::filled(4, 3, 0.05, 0));
    }
    for second in 0..3 {
        let seconds = 0.5 + f64::from(second);
        let x = 0.1 * f64::from(second);
        log.message(seconds, "/tf", &transform(seconds, "robot1/map", "robot1/odom", 1.0));
        log.message(seconds, "/tf", &transform(seconds, "robot1/odom", "robot1/base_footprint", x));
        log.message(seconds, "/robot2/odom", &odometry(seconds, x));
        let in_its_frame = Odometry { header: header(seconds, "robot3/odom"), ..odometry(seconds, x) };
        log.message(seconds, "/robot3/odom", &in_its_frame);
    }
}

/// Tags in messages of other types: ranges that are named by their frame, and tags that are frames of tf, seen by a
/// camera that looks to the left.
fn tag_messages(log: &mut LogBuilder) {
    log.map(0.0, "robot1", &TestMap::filled(4, 3, 0.05, 0)).pose(0.0, "robot1", 0.0, 0.0);
    let mount = Transform::from(pose(0.5, 0.0, std::f64::consts::FRAC_PI_2));
    let header_of = |seconds: f64, frame: &str| header(seconds, format!("robot1/{frame}"));
    let frame = |seconds, parent: &str, child: &str, transform| TFMessage {
        transforms: vec![TransformStamped {
            header: header_of(seconds, parent),
            child_frame_id: child.into(),
            transform,
        }],
    };
    // Before it is known how the camera is mounted.
    log.raw(0.1, "/robot1/camera/tags", "apriltag_msgs/msg/AprilTagDetectionArray", &[0, 1, 0, 0]);
    let seen = |x: f64| Transform::from(pose(x, 0.25, 0.0));
    log.message(0.2, "/tf", &frame(0.2, "camera", "tag36h11:4", seen(1.0)));
    log.message(0.3, "/tf_static", &frame(0.3, "base_footprint", "robot1/camera", mount));
    for second in 1..4 {
        let seconds = f64::from(second);
        log.message(seconds, "/tf", &frame(seconds, "camera", "tag36h11:4", seen(seconds)));
        let range: (Header, u8, [f32; 3], f32) = (header_of(seconds, "tag7"), 1, [0.1, 0.0, 10.0], second as f32);
        log.raw(seconds, "/robot1/tag_ranges", "sensor_msgs/msg/Range", &encode(&range).unwrap());
    }
    log.raw(4.0, "/robot1/tag_ranges", "sensor_msgs/msg/Range", b"cut");
}

/// The topics of a fleet with other names.
fn other_topics(log: &mut LogBuilder) {
    every_kind(log);
    log.message(5.0, "/fleet/r7/slam/pose", &odometry(5.0, 3.0));
}

fn transform(seconds: f64, parent: &str, child: &str, x: f64) -> TFMessage {
    let transform = Transform::from(pose(x, 0.0, 0.0));
    let stamped = TransformStamped { header: header(seconds, parent), child_frame_id: child.into(), transform };
    TFMessage { transforms: vec![stamped] }
}

fn odometry(seconds: f64, x: f64) -> Odometry {
    Odometry {
        header: header(seconds, "robot2/map"),
        child_frame_id: "robot2/base_link".into(),
        pose: with_covariance(x),
        ..Default::default()
    }
}

fn with_covariance(x: f64) -> PoseWithCovariance {
    let mut covariance = [[0.0; 6]; 6];
    (covariance[0][0], covariance[1][1], covariance[5][5]) = (0.01, 0.01, 0.001);
    PoseWithCovariance { pose: Pose::from(pose(x, 1.0, 0.5)), covariance }
}

/// `geometry_msgs/msg/PoseWithCovarianceStamped`.
fn pose_with_covariance(seconds: f64, x: f64) -> Vec<u8> {
    let message: (Header, PoseWithCovariance) = (header(seconds, "robot3/map"), with_covariance(x));
    encode(&message).unwrap()
}
