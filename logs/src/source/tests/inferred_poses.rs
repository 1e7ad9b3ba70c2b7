//! Poses of robots without a pose topic.

use super::*;

fn tf(parent: &str, child: &str, second: u64, x: f64) -> TFMessage {
    let transform = Isometry2::new(Vector2::new(x, 0.0), 0.0).into();
    let header = Header::new(LogTime(second), parent);
    TFMessage { transforms: vec![TransformStamped { header, child_frame_id: child.into(), transform }] }
}

fn map_in(frame: &str) -> OccupancyGrid<'static> {
    OccupancyGrid { header: Header::new(LogTime(1), frame), ..grid() }
}

fn odometry_in(frame: &str, x: f64) -> Odometry {
    let pose = PoseWithCovariance { pose: at(x), ..Default::default() };
    Odometry { header: Header::new(LogTime(5), frame), pose, ..Default::default() }
}

/// The robot, frame and x coordinate of each pose.
fn poses(run: &Run) -> Vec<(String, String, f64)> {
    let seen = |message: &Message| {
        let pose: PoseWithCovarianceStamped = message.decode().unwrap();
        (message.robot().to_owned(), pose.header.frame_id, pose.pose.pose.position.x)
    };
    run.on("pose").iter().map(seen).collect()
}

fn pose(robot: &str, frame: &str, x: f64) -> (String, String, f64) {
    (robot.to_owned(), frame.to_owned(), x)
}

#[test]
fn a_robot_without_a_pose_topic_gets_its_poses_from_tf() {
    let (_folder, files) = write(|log| {
        // Frames with robot names, a map frame with an unusual name, and static transforms.
        log.add("/robot1/map", OccupancyGrid::NAME, 1, &map_in("robot1/slam"))
            .add("/tf_static", TFMessage::NAME, 2, &tf("robot1/base_footprint", "robot1/base_link", 2, 0.5))
            .add("/tf", TFMessage::NAME, 3, &tf("robot1/slam", "robot1/odom", 3, 1.0))
            .add("/tf", TFMessage::NAME, 4, &tf("robot1/odom", "robot1/base_footprint", 4, 2.0))
            // Frames without robot names, in a namespace, and no base_link.
            .add("/robot2/map", OccupancyGrid::NAME, 5, &map_in("map"))
            .add("/robot2/tf", TFMessage::NAME, 6, &tf("map", "base_footprint", 6, 7.0))
            // A robot with a pose topic, for which tf is not used.
            .add("/robot3/map", OccupancyGrid::NAME, 7, &map_in("robot3/map"))
            .add("/robot3/pose", PoseStamped::NAME, 8, &PoseStamped { pose: at(9.0), ..Default::default() })
            .add("/tf", TFMessage::NAME, 9, &tf("robot3/map", "robot3/base_link", 9, 1.0));
    });
    let run = run(files);
    let expected = [pose("robot1", "robot1/slam", 3.5), pose("robot2", "robot2/map", 7.0)];
    let (third, of_tf): (Vec<_>, Vec<_>) = poses(&run).into_iter().partition(|(robot, ..)| robot == "robot3");
    assert_eq!((of_tf, third.len()), (expected.to_vec(), 1));
    assert_eq!(run.on("pose")[0].decode::<PoseWithCovarianceStamped>().unwrap().header.stamp.nanosec, 4);
    assert!(!run.warnings.keys().any(|warning| warning.contains("pose")), "{:?}", run.warnings);
}

#[test]
fn odometry_gives_poses_if_it_is_in_the_frame_of_the_map_and_nothing_else_does() {
    let (_folder, files) = write(|log| {
        log.add("/robot1/map", OccupancyGrid::NAME, 1, &map_in("robot1/map"))
            .add("/robot1/odom", ODOMETRY, 2, &odometry_in("robot1/map", 2.0))
            .add("/tf", TFMessage::NAME, 3, &tf("robot1/map", "robot1/base_link", 3, 3.0))
            .add("/robot1/odom", ODOMETRY, 4, &odometry_in("robot1/map", 4.0))
            .add("/robot2/map", OccupancyGrid::NAME, 5, &map_in("robot2/map"))
            .add("/robot2/odom", ODOMETRY, 6, &odometry_in("robot2/odom", 6.0))
            .add("/robot3/map", OccupancyGrid::NAME, 7, &map_in("robot3/map"))
            .add("/robot3/pose", PoseStamped::NAME, 8, &PoseStamped { pose: at(9.0), ..Default::default() })
            .add("/robot3/odom", ODOMETRY, 9, &odometry_in("robot3/map", 6.0));
    });
    let run = run(files);
    let found = poses(&run);
    assert_eq!(found[..2], [pose("robot1", "robot1/map", 2.0), pose("robot1", "robot1/map", 4.0)]);
    assert_eq!((found.len(), run.on("other").len()), (3, 6));
    let warning = run.warnings.keys().find(|warning| warning.contains("no pose of robot2")).unwrap();
    let parts = [
        "tf has no transform from `robot2/base_link`",
        "`/robot2/odom` is in the frame `robot2/odom`",
        "not in the map frame `robot2/map`",
    ];
    assert!(parts.iter().all(|part| warning.contains(part)), "{warning}");
}

#[test]
fn odometry_in_any_frame_gives_the_poses_of_a_robot_that_reads_tags_and_has_no_map() {
    let (_folder, files) = write(|log| {
        let reading = TagRange { tag_id: "a".to_owned(), range: 2.0, ..Default::default() };
        log.add("/robot1/tag_ranges", TagRange::NAME, 1, &reading)
            .add("/robot1/odom", ODOMETRY, 2, &odometry_in("robot1/odom", 2.0))
            .add("/tf", TFMessage::NAME, 3, &tf("robot1/odom", "robot1/base_link", 3, 3.0))
            // A robot whose map frame is in tf.
            .add("/robot2/tag_ranges", TagRange::NAME, 4, &reading)
            .add("/tf", TFMessage::NAME, 5, &tf("robot2/map", "robot2/odom", 5, 1.0))
            .add("/robot2/odom", ODOMETRY, 6, &odometry_in("robot2/odom", 6.0))
            .add("/tf", TFMessage::NAME, 7, &tf("robot2/odom", "robot2/base_link", 7, 3.0));
    });
    let run = run(files);
    assert_eq!(poses(&run), [pose("robot1", "robot1/odom", 2.0), pose("robot2", "robot2/map", 4.0)]);
}

#[test]
fn transforms_before_the_start_give_poses_after_it() {
    let (_folder, files) = write(|log| {
        let second = 1_000_000_000;
        log.add("/robot1/map", OccupancyGrid::NAME, second, &map_in("robot1/slam"))
            .add("/tf", TFMessage::NAME, second, &tf("robot1/slam", "robot1/odom", 1, 1.0))
            .add("/tf", TFMessage::NAME, 3 * second, &tf("robot1/odom", "robot1/base_link", 3, 1.0));
    });
    let run = try_run(files, "start = 1.0", RobotTopics::default()).unwrap();
    assert_eq!(poses(&run), [pose("robot1", "robot1/slam", 2.0)]);
}
