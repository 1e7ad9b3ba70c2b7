//! Inputs of `mcap_source` and `mcap_sink`: small logs.

use super::Case;
use gridweave_runtime::ros::{
    Header, Odometry, Pose, PoseWithCovariance, TFMessage, Transform, TransformStamped, encode,
};
use gridweave_stages::geometry::pose;
use gridweave_tests::{LogBuilder, TestMap, header};

pub(super) fn cases() -> Vec<Case> {
    let source = |name, write| Case::new("mcap_source", name, write);
    vec![
        source("every_kind", every_kind),
        source("a_part", every_kind),
        source("tf", every_kind),
        source("other_topics", other_topics),
        source("nothing_fits", |log| {
            log.raw(1.0, "/chatter", "std_msgs/msg/String", STRING);
        }),
        Case::new("mcap_sink", "of_a_log", every_kind),
        Case::new("mcap_sink", "uncompressed", every_kind),
        Case::new("mcap_sink", "only_topics", every_kind),
        Case::new("mcap_sink", "without_the_input", every_kind),
    ]
}

/// `std_msgs/msg/String`: "hello".
const STRING: &[u8] = b"\x00\x01\x00\x00\x06\x00\x00\x00hello\x00";

/// Maps, poses of three types, transforms, readings of tags, and a type that nobody knows.
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

/// The topics of a fleet that has names of its own.
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
