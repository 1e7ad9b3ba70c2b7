//! Point clouds of 3D lidars.

use super::*;
use gridweave_runtime::ros::{LaserScan, PointCloud2, PointField};

/// A cloud of one point ahead of the lidar, and one on the floor below it.
fn cloud<'a>(frame: &str, data: &'a [u8], point_step: u32) -> PointCloud2<'a> {
    let field = |(offset, name): (u32, &str)| PointField {
        name: name.to_owned(),
        offset,
        datatype: PointField::FLOAT32,
        count: 1,
    };
    PointCloud2 {
        header: Header { frame_id: frame.into(), ..Default::default() },
        height: 1,
        width: 2,
        fields: [(0, "x"), (4, "y"), (8, "z")].map(field).to_vec(),
        point_step,
        row_step: 2 * point_step,
        data,
        ..Default::default()
    }
}

fn points() -> Vec<u8> {
    [3.0_f32, 0.001, 0.1, 1.0, 0.001, -0.9].iter().flat_map(|number| number.to_le_bytes()).collect()
}

#[test]
fn a_robot_with_a_3d_lidar_alone_has_scans_from_where_it_is_mounted() {
    let data = points();
    let (_folder, files) = write(|log| {
        let header = Header { frame_id: "robot1/base_link".into(), ..Default::default() };
        let transform = Isometry2::new(Vector2::new(0.2, 0.0), 0.0).into();
        let mount = TransformStamped { header, child_frame_id: "robot1/velodyne".into(), transform };
        log.add("/tf_static", TFMessage::NAME, 1, &TFMessage { transforms: vec![mount] })
            .add("/robot1/velodyne_points", PointCloud2::NAME, 2, &cloud("robot1/velodyne", &data, 12))
            .add("/robot1/camera/points", PointCloud2::NAME, 2, &cloud("robot1/camera", &data, 12))
            .add("/robot2/ouster/points", PointCloud2::NAME, 3, &cloud("robot2/os_lidar", &data, 12));
    });
    let run = try_run(files, "", RobotTopics::default()).unwrap();
    let scans: Vec<RangeScan> = run.on("scans").iter().map(|message| message.decode().unwrap()).collect();
    let measured = |scan: &RangeScan| -> Vec<f32> {
        scan.ranges.iter().filter(|range| !range.is_nan()).map(|range| (range * 100.0).round() / 100.0).collect()
    };
    let found: Vec<(f64, Vec<f32>)> = scans.iter().map(|scan| (scan.x, measured(scan))).collect();
    assert_eq!(found, [(0.2, vec![3.0]), (0.0, vec![3.0])]);
    let unmounted = |warning: &&String| warning.contains("`/robot2/ouster/points`") && warning.contains("--lidar");
    assert_eq!(run.warnings.keys().filter(unmounted).count(), 1, "{:?}", run.warnings);
    assert!(!run.warnings.keys().any(|warning| warning.contains("velodyne")), "{:?}", run.warnings);
}

#[test]
fn a_cloud_that_cannot_be_read_is_a_warning_with_its_reason() {
    let data = points();
    let floor: Vec<u8> =
        [3.0_f32, 0.0, -1.0].iter().cycle().take(data.len() / 4).flat_map(|n| n.to_le_bytes()).collect();
    let (_folder, files) = write(|log| {
        log.add("/robot1/points", PointCloud2::NAME, 1, &cloud("robot1/base_link", &data, 8))
            .add("/robot2/points", PointCloud2::NAME, 2, &cloud("robot2/base_link", &data, 16))
            .add("/robot3/points", PointCloud2::NAME, 3, &cloud("robot3/base_link", &floor, 12));
    });
    let run = try_run(files, "", RobotTopics::default()).unwrap();
    assert_eq!(run.on("scans").len(), 0);
    for warning in [
        "a point cloud on `/robot1/points` was left out: its points have no field `z` that is one floating-point number",
        "a point cloud on `/robot2/points` was left out: its data are shorter than its rows",
        "a point cloud on `/robot3/points` was left out: none of its points is from 0.2 to 0.9 m above the base, where walls are \
         looked for; is its frame right?",
    ] {
        assert_eq!(run.warnings.get(warning), Some(&1), "{:?}", run.warnings);
    }
}

#[test]
fn a_topic_of_maps_or_scans_without_messages_hides_no_cloud() {
    // Only chunks have an index.
    for options in layouts().into_iter().skip(1) {
        let data = points();
        let folder = Folder::new();
        let mut log = TestLog::new(options);
        log.silent("/robot1/scan", LaserScan::NAME)
            .silent("/robot2/map", OccupancyGrid::NAME)
            .add("/robot1/points", PointCloud2::NAME, 1, &cloud("robot1/lidar", &data, 12))
            .add("/robot2/points", PointCloud2::NAME, 2, &cloud("robot2/lidar", &data, 12));
        let files = vec![folder.write("a.mcap", &log.finish())];
        let run = try_run(files, "", RobotTopics::default()).unwrap();
        assert_eq!(run.on("scans").len(), 2);
    }
}

#[test]
fn scans_of_two_robots_on_one_topic_are_refused_unless_the_log_keeps_its_names() {
    let (_folder, files) = write(|log| {
        for (second, frame) in [(1, "robot1/laser"), (2, "robot1/laser"), (3, "robot2/laser")] {
            let header = Header { frame_id: frame.into(), ..Default::default() };
            log.add("/fleet/scan", LaserScan::NAME, second, &LaserScan { header, ..Default::default() });
        }
    });
    let error = try_run(files.clone(), "", RobotTopics::default()).err().unwrap().to_string();
    assert!(error.contains("`/fleet/scan` has the messages of several robots"), "{error}");
    assert!(error.contains("`/robot1/scan` and `/robot2/scan`"), "{error}");
    assert_eq!(run_as_logged(files).on("other").len(), 3);
}
