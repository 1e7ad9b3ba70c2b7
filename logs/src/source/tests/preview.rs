//! Frames that are logged after what they place.

use super::*;
use gridweave_runtime::ros::LaserScan;

fn placed(parent: &str, child: &str, x: f64) -> TFMessage {
    let header = Header { frame_id: parent.into(), ..Default::default() };
    let transform = Isometry2::new(Vector2::new(x, 0.0), 0.0).into();
    TFMessage { transforms: vec![TransformStamped { header, child_frame_id: child.into(), transform }] }
}

fn scan() -> LaserScan {
    let header = Header { frame_id: "robot1/laser".into(), ..Default::default() };
    LaserScan { header, angle_increment: 0.5, ranges: vec![1.0, 2.0], ..Default::default() }
}

/// The place of the lidar in each scan that was sent.
fn lidar_places(files: Vec<PathBuf>, more: &str) -> Vec<f64> {
    let run = try_run(files, more, RobotTopics::default()).unwrap();
    assert!(!run.warnings.keys().any(|warning| warning.contains("--lidar")), "{:?}", run.warnings);
    run.on("scans").iter().map(|message| message.decode::<RangeScan>().unwrap().x).collect()
}

#[test]
fn a_lidar_is_mounted_from_the_beginning_of_the_log_wherever_its_mount_was_logged() {
    for options in layouts() {
        let folder = Folder::new();
        let mut log = TestLog::new(options);
        log.add("/robot1/scan", LaserScan::NAME, 1, &scan())
            .flush()
            .add("/tf_static", TFMessage::NAME, 2, &placed("robot1/base_link", "robot1/camera", 0.9))
            .add("/robot1/scan", LaserScan::NAME, 3, &scan())
            .flush()
            .add("/tf_static", TFMessage::NAME, 4, &placed("robot1/base_link", "robot1/laser", 0.2))
            .add("/robot1/scan", LaserScan::NAME, 5, &scan())
            .add("/tf_static", TFMessage::NAME, 6, &placed("robot1/base_link", "robot1/laser", 0.3))
            .add("/robot1/scan", LaserScan::NAME, 7, &scan());
        let files = vec![folder.write("a.mcap", &log.finish())];
        assert_eq!(lidar_places(files.clone(), ""), [0.2, 0.2, 0.2, 0.3], "a mount that changes holds from there on");
        assert_eq!(lidar_places(files, "start = 4e-9").len(), 2);
    }
}

#[test]
fn chunks_without_messages_do_not_hide_a_mount() {
    for options in layouts() {
        let folder = Folder::new();
        let mut log = TestLog::new(options);
        log.empty_chunk()
            .add("/robot1/scan", LaserScan::NAME, 1, &scan())
            .flush()
            .add("/tf_static", TFMessage::NAME, 2, &placed("robot1/base_link", "robot1/laser", 0.2))
            .add("/robot1/scan", LaserScan::NAME, 3, &scan());
        assert_eq!(lidar_places(vec![folder.write("a.mcap", &log.finish())], ""), [0.2, 0.2]);
    }
}

#[test]
fn a_mount_that_is_sent_again_and_again_holds_before_it_is_first_sent() {
    let (_folder, files) = write(|log| {
        log.add("/robot1/scan", LaserScan::NAME, 1, &scan())
            .add("/tf", TFMessage::NAME, 2, &placed("robot1/base_link", "robot1/laser", 0.2))
            .add("/robot1/scan", LaserScan::NAME, 3, &scan());
    });
    assert_eq!(lidar_places(files, ""), [0.2, 0.2]);
}

#[test]
fn poses_before_the_first_map_are_in_its_frame() {
    let (_folder, files) = write(|log| {
        log.add("/tf", TFMessage::NAME, 1, &placed("robot1/slam", "robot1/base_link", 1.0))
            .flush()
            .add(
                "/robot1/map",
                OccupancyGrid::NAME,
                2,
                &OccupancyGrid { header: Header::new(LogTime(2), "robot1/slam"), ..grid() },
            )
            .add("/tf", TFMessage::NAME, 3, &placed("robot1/slam", "robot1/base_link", 2.0));
    });
    let run = run(files);
    let place = |message: &Message| message.decode::<PoseWithCovarianceStamped>().unwrap().pose.pose.position.x;
    assert_eq!(run.on("pose").iter().map(place).collect::<Vec<_>>(), [1.0, 2.0]);
}
