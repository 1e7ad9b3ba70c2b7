//! Robots whose maps are all in one frame, `map`, as where no SLAM has a frame of its own.

use crate::stages::{map, source_with, wait_until_heard};
use crate::waiting::sent;
use crate::wire::{Robot, Router, topic};
use gridweave_ros::qos::Qos;
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{
    Header, OccupancyGrid, PoseWithCovarianceStamped, RosMessage, TFMessage, Transform, TransformStamped, Vector3,
    encode,
};

fn transform(parent: &str, child: &str, x: f64) -> Vec<u8> {
    let translation = Vector3 { x, ..Default::default() };
    let transform = Transform { translation, ..Default::default() };
    let header = Header::new(LogTime(5), parent);
    encode(&TFMessage { transforms: vec![TransformStamped { header, child_frame_id: child.into(), transform }] })
        .unwrap()
}

#[test]
fn robots_whose_maps_are_in_one_frame_have_poses_each_in_its_own_map() {
    let router = Router::start();
    let robot = Robot::start(&router, "robots");
    let mut source = source_with(&router, "");
    let publish = |name: &str| robot.publish(&topic(&format!("/{name}/map"), OccupancyGrid::NAME), Qos::latched(1));
    let mut maps = ["robot1", "robot2"].map(publish);
    // Sent once, and before any map.
    let mut fixed = robot.publish(&topic("/tf_static", TFMessage::NAME), Qos::latched(1));
    fixed.send(&transform("map", "robot2/odom", 1.0));
    sent(&mut source, "other", 1);
    maps.iter_mut().for_each(|map_of_robot| map_of_robot.send(&map("", 1)));
    for message in sent(&mut source, "map", 2) {
        let grid: OccupancyGrid<'_> = message.decode().unwrap();
        assert_eq!(grid.header.frame_id, format!("{}/map", message.robot()));
    }

    let mut tf = robot.publish(&topic("/tf", TFMessage::NAME), Qos::reliable(10));
    wait_until_heard(&mut source, &tf);
    tf.send(&transform("map", "robot1/base_link", 3.0));
    tf.send(&transform("robot2/odom", "robot2/base_link", 4.0));
    let poses = sent(&mut source, "pose", 2).into_iter().map(|message| {
        let pose: PoseWithCovarianceStamped = message.decode().unwrap();
        (message.robot().to_owned(), pose.header.frame_id, pose.pose.pose.position.x)
    });
    let mut poses: Vec<(String, String, f64)> = poses.collect();
    poses.sort_by(|one, other| one.0.cmp(&other.0));
    let expected = [("robot1", "robot1/map", 3.0), ("robot2", "robot2/map", 5.0)];
    assert_eq!(poses, expected.map(|(robot, frame, x)| (robot.to_owned(), frame.to_owned(), x)));
    assert!(source.warnings().is_empty(), "{:?}", source.warnings());
}
