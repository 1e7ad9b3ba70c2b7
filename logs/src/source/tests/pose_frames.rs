//! Poses on pose topics, in another frame than that of the map.

use super::*;

fn tf(parent: &str, child: &str, transform: Isometry2<f64>) -> TFMessage {
    let header = Header { frame_id: parent.into(), ..Default::default() };
    TFMessage {
        transforms: vec![TransformStamped { header, child_frame_id: child.into(), transform: transform.into() }],
    }
}

fn pose_in(frame: &str) -> PoseWithCovarianceStamped {
    let mut pose =
        PoseWithCovariance { pose: Isometry2::new(Vector2::new(1.0, 0.0), 0.0).into(), ..Default::default() };
    (pose.covariance[0][0], pose.covariance[1][1], pose.covariance[5][5]) = (0.04, 0.01, 0.002);
    PoseWithCovarianceStamped { header: Header::new(LogTime(1), frame), pose }
}

fn map_in(frame: &str) -> OccupancyGrid<'static> {
    OccupancyGrid { header: Header::new(LogTime(1), frame), ..grid() }
}

/// The frame, place and variances in x and y of each pose that was sent.
fn poses(files: Vec<PathBuf>) -> Vec<(String, [f64; 2], [f64; 2])> {
    let read = |message: &Message| {
        let PoseWithCovarianceStamped { header, pose } = message.decode().unwrap();
        let round = |value: f64| (value * 1e9).round() / 1e9;
        let place = pose.pose.position;
        (header.frame_id, [place.x, place.y].map(round), [pose.covariance[0][0], pose.covariance[1][1]].map(round))
    };
    run(files).on("pose").iter().map(read).collect()
}

#[test]
fn poses_by_odometry_are_transformed_to_the_map_as_tf_says_at_their_time() {
    let quarter = std::f64::consts::FRAC_PI_2;
    let (_folder, files) = write(|log| {
        log.add("/robot1/pose", POSE_WITH_COVARIANCE, 1, &pose_in("odom"))
            .add(
                "/tf",
                TFMessage::NAME,
                2,
                &tf("robot1/map", "robot1/odom", Isometry2::new(Vector2::new(5.0, 0.0), quarter)),
            )
            .add("/robot1/map", OccupancyGrid::NAME, 3, &map_in("map"))
            .add("/robot1/pose", POSE_WITH_COVARIANCE, 4, &pose_in("odom"))
            .add(
                "/tf",
                TFMessage::NAME,
                5,
                &tf("robot1/map", "robot1/odom", Isometry2::new(Vector2::new(6.0, 0.0), 0.0)),
            )
            .add("/robot1/pose", POSE_WITH_COVARIANCE, 6, &pose_in("odom"))
            .add("/robot1/pose", POSE_WITH_COVARIANCE, 7, &pose_in("map"));
    });
    let turned = ("robot1/map".to_owned(), [5.0, 1.0], [0.01, 0.04]);
    let straight = |x: f64| ("robot1/map".to_owned(), [x, 0.0], [0.04, 0.01]);
    assert_eq!(poses(files), [turned.clone(), turned, straight(7.0), straight(1.0)]);
}

#[test]
fn poses_in_a_frame_that_tf_does_not_connect_to_the_map_stay_as_they_are() {
    let (_folder, files) = write(|log| {
        log.add("/robot1/map", OccupancyGrid::NAME, 1, &map_in("map"))
            .add("/tf", TFMessage::NAME, 2, &tf("robot1/odom", "robot1/base_link", Isometry2::identity()))
            .add("/robot1/pose", POSE_WITH_COVARIANCE, 3, &pose_in("odom"));
    });
    assert_eq!(poses(files), [("robot1/odom".to_owned(), [1.0, 0.0], [0.04, 0.01])]);
}
