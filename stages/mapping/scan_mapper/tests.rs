//! Robots whose maps are drawn from their scans.

use super::kind;
use super::test_drive::{BEAMS, CELL, TURN, at, scan, still_ranges, to_wall, truth};
use crate::shared::geometry::{Grid, GridGeometry, Point2, Pose2, is_free, is_occupied, pose};
use gridweave_runtime::message::{LogTime, Message};
use gridweave_runtime::ros::{
    Header, OccupancyGrid, PoseStamped, PoseWithCovarianceStamped, RangeScan, RosMessage, UnmergedRobot,
};
use gridweave_runtime::stage::StageHarness;

pub(super) struct Bench(pub(super) StageHarness);

impl Bench {
    pub(super) fn new(parameters: &str) -> Self {
        Self(StageHarness::new(&kind(), parameters).unwrap())
    }

    pub(super) fn scan(&mut self, seconds: f64, scan: &RangeScan) {
        self.0.give::<RangeScan>("scan", "robot1", at(seconds), scan).unwrap();
    }

    pub(super) fn pose(&mut self, port: &str, frame: &str, seconds: f64, pose: Pose2) {
        let stamped = PoseStamped { header: Header::new(at(seconds), frame), pose: pose.into() };
        self.0.give::<PoseWithCovarianceStamped>(port, "robot1", at(seconds), &stamped.into()).unwrap();
    }

    /// Finishes the stage. The last map, and how many were sent.
    pub(super) fn map(&mut self, seconds: f64) -> (Option<Message>, usize) {
        self.0.finish(at(seconds)).unwrap();
        let mut maps = self.0.take_messages("map");
        let count = maps.len();
        (maps.pop(), count)
    }
}

/// What is drawn: how far the occupied cells lie from the walls (the mean and the greatest), and how many are free.
pub(super) struct Drawn {
    pub(super) mean: f64,
    pub(super) greatest: f64,
    pub(super) occupied: usize,
    pub(super) free: usize,
}

/// Measures a map with the given pose of its frame in the building.
pub(super) fn measure(map: &Message, transform_building_map: &Pose2) -> Drawn {
    let map: OccupancyGrid<'_> = map.decode().unwrap();
    let grid = Grid::new(GridGeometry::from(&map.info), map.cells()).unwrap();
    let off: Vec<f64> =
        grid.occupied().map(|cell| to_wall(&(transform_building_map * grid.geometry.centre(cell)))).collect();
    Drawn {
        mean: off.iter().sum::<f64>() / off.len() as f64,
        greatest: off.iter().copied().fold(0.0, f64::max),
        occupied: grid.cells.iter().filter(|cell| is_occupied(**cell)).count(),
        free: grid.cells.iter().filter(|cell| is_free(**cell)).count(),
    }
}

/// The frame of the map in the building.
fn map_frame() -> Pose2 {
    pose(7.0, -3.0, 1.1)
}

/// A drive with poses at 20 Hz, whose scans report the given time between beams.
fn drive_by_poses(time_increment: f64) -> (Bench, Option<Message>) {
    let mut bench = Bench::new("interval = 3");
    for tick in 0..200 {
        let seconds = 0.05 * f64::from(tick);
        bench.pose("pose", "robot1/map", seconds, map_frame().inverse() * truth(seconds));
        if tick % 2 == 0 {
            bench.scan(seconds, &RangeScan { time_increment, ..scan(seconds) });
        }
    }
    let (map, count) = bench.map(10.0);
    assert_eq!(count, 4, "three on the way, and one at the end");
    (bench, map)
}

#[test]
fn walls_are_within_a_cell_of_where_they_are_though_the_robot_turns_during_a_scan() {
    let (mut bench, map) = drive_by_poses(TURN / BEAMS as f64);
    let map = map.unwrap();
    assert_eq!(map.header().topic.as_str(), "/robot1/drawn_map");
    assert_eq!(map.decode::<OccupancyGrid<'_>>().unwrap().header.frame_id, "robot1/map");
    let drawn = measure(&map, &map_frame());
    assert!(drawn.greatest < CELL, "{}", drawn.greatest);
    assert!(drawn.occupied > 500 && drawn.free > 15_000, "{} {}", drawn.occupied, drawn.free);
    // The last scan has no pose after its end.
    assert!(bench.0.warnings().values().all(|times| *times <= 1), "{:?}", bench.0.warnings());
    assert!(bench.0.take_messages("pose").is_empty(), "the poses are known already");

    let (_, as_if_still) = drive_by_poses(0.0);
    let as_if_still = measure(&as_if_still.unwrap(), &map_frame());
    assert!(as_if_still.mean > 2.0 * drawn.mean, "{} {}", as_if_still.mean, drawn.mean);
}

#[test]
fn stamps_that_leap_do_not_cost_the_map() {
    let mut bench = Bench::new("");
    for tick in 0..200 {
        let seconds = 0.05 * f64::from(tick);
        let (log_time, pose) = (at(seconds), map_frame().inverse() * truth(seconds));
        // The clock starts again half-way; one pose has no stamp, and one scan one of the future.
        let stamp = if tick < 100 { at(seconds + 100.0) } else { at(seconds - 4.0) };
        let pose_stamp = if tick == 30 { LogTime::MIN } else { stamp };
        let scan_stamp = if tick == 40 { at(1e6) } else { stamp };
        let stamped = PoseStamped { header: Header::new(pose_stamp, "robot1/map"), pose: pose.into() };
        bench.0.give::<PoseWithCovarianceStamped>("pose", "robot1", log_time, &stamped.into()).unwrap();
        if tick % 2 == 0 {
            let mut scan = RangeScan { time_increment: TURN / BEAMS as f64, ..scan(seconds) };
            scan.header.stamp = scan_stamp.into();
            bench.0.give::<RangeScan>("scan", "robot1", log_time, &scan).unwrap();
        }
    }
    let drawn = measure(&bench.map(10.0).0.unwrap(), &map_frame());
    assert!(drawn.greatest < CELL, "{}", drawn.greatest);
    assert!(drawn.occupied > 500 && drawn.free > 15_000, "{} {}", drawn.occupied, drawn.free);
    let warnings = bench.0.warnings();
    let leaps = warnings.iter().find(|(warning, _)| warning.starts_with("the stamps of robot1 leap"));
    assert_eq!(leaps.map(|(_, times)| *times), Some(2), "{warnings:?}");
}

#[test]
fn along_odometry_that_drifts_scans_are_matched_with_those_before() {
    let mut bench = Bench::new("");
    // Wheels of which one is thought to be larger than it is: every step a little long, and turned a little.
    let mut odometry = pose(2.0, 1.0, -0.7);
    let start = odometry;
    for tick in 0..600 {
        let seconds = 0.05 * f64::from(tick);
        if tick > 0 {
            let step = truth(seconds - 0.05).inverse() * truth(seconds);
            let (way, turn) =
                (step.translation.vector * 1.04, step.rotation.angle() + 0.02 * step.translation.vector.norm());
            odometry *= pose(way.x, way.y, turn);
        }
        bench.pose("odometry", "robot1/odom", seconds, odometry);
        if tick % 4 == 0 {
            bench.scan(seconds, &scan(seconds));
        }
    }
    let (map, _) = bench.map(30.0);
    // The frame of the map is that of odometry where it began.
    let transform_building_map = truth(0.0) * start.inverse();
    let adrift = (transform_building_map * odometry).translation.vector - truth(29.95).translation.vector;
    assert!(adrift.norm() > 0.3, "odometry has drifted by {} m", adrift.norm());
    let drawn = measure(&map.unwrap(), &transform_building_map);
    assert!(drawn.mean < CELL && drawn.greatest < 4.0 * CELL, "{} {}", drawn.mean, drawn.greatest);
    assert!(drawn.occupied > 500 && drawn.free > 15_000, "{} {}", drawn.occupied, drawn.free);

    let poses: Vec<PoseWithCovarianceStamped> = bench.0.take("pose").unwrap();
    let last = transform_building_map * poses.last().unwrap().pose.pose.planar();
    assert!((last.translation.vector - truth(29.95).translation.vector).norm() < 0.1, "{last}");
    assert_eq!(poses[0].header.frame_id, "robot1/map");
}

#[test]
fn odometry_does_not_count_where_there_are_poses() {
    let mut bench = Bench::new("");
    for tick in 0..100 {
        let seconds = 0.1 * f64::from(tick);
        bench.pose("odometry", "robot1/odom", seconds, pose(1e3 * seconds, 0.0, 0.0));
        if tick >= 20 {
            bench.pose("pose", "robot1/map", seconds, truth(seconds));
        }
        bench.scan(seconds, &scan(seconds));
    }
    let (map, _) = bench.map(10.0);
    let drawn = measure(&map.unwrap(), &Pose2::identity());
    assert!(drawn.greatest < CELL, "{}", drawn.greatest);
    assert!(bench.0.take_messages("pose").is_empty());
    let warnings = bench.0.warnings();
    assert!(warnings.keys().any(|warning| warning.contains("there is no pose of it")), "{warnings:?}");
}

#[test]
fn what_a_lidar_cannot_have_measured_is_no_wall() {
    let mut bench = Bench::new("max_range = 2.5\nfree_without_echo = 1.0");
    let ranges = [f32::NAN, f32::NEG_INFINITY, -1.0, 0.0, 0.01, f32::INFINITY, 25.0, 5.0, 2.0];
    let beams = RangeScan {
        x: 0.0,
        y: 0.0,
        yaw: 0.0,
        angle_min: 0.0,
        angle_increment: 0.5,
        time_increment: 0.0,
        ranges: ranges.to_vec(),
        ..scan(0.0)
    };
    for tick in 0..3 {
        let seconds = 0.1 * f64::from(tick);
        bench.pose("pose", "robot1/map", seconds, pose(0.01, 0.01, 0.0));
        bench.scan(seconds, &RangeScan { header: Header::new(at(seconds), "robot1/base_link"), ..beams.clone() });
    }
    let (map, _) = bench.map(1.0);
    let map = map.unwrap();
    let map: OccupancyGrid<'_> = map.decode().unwrap();
    let grid = Grid::new(GridGeometry::from(&map.info), map.cells()).unwrap();
    let value = |beam: f64, range: f64| {
        let (sine, cosine) = (0.5 * beam).sin_cos();
        grid.value_at(&Point2::new(0.01 + range * cosine, 0.01 + range * sine))
    };
    assert_eq!(grid.occupied().count(), 1);
    assert!(is_occupied(value(8.0, 2.0)));
    assert_eq!((0..5).map(|beam| value(f64::from(beam), 0.5)).collect::<Vec<_>>(), [-1; 5]);
    for beam in [5.0, 6.0] {
        assert!(!is_occupied(value(beam, 0.9)) && value(beam, 0.9) >= 0 && value(beam, 1.2) == -1, "{beam}");
    }
    assert!(value(7.0, 2.3) >= 0 && value(7.0, 2.6) == -1);
}

#[test]
fn a_robot_whose_scans_show_nothing_has_no_map_and_a_warning() {
    let mut bench = Bench::new("");
    for tick in 0..3 {
        let seconds = 0.1 * f64::from(tick);
        bench.pose("pose", "robot1/map", seconds, pose(0.0, 0.0, 0.0));
        bench.scan(seconds, &RangeScan { ranges: vec![f32::NAN; BEAMS], ..scan(seconds) });
    }
    assert!(bench.map(1.0).0.is_none());
    assert!(
        bench.0.warnings().keys().any(|warning| warning.starts_with("no map of robot1")),
        "{:?}",
        bench.0.warnings()
    );
}

#[test]
fn invalid_messages_are_reported_and_leave_the_rest() {
    let mut bench = Bench::new("");
    let good = scan(0.0);
    for tick in 0..4 {
        let seconds = 0.1 * f64::from(tick);
        let at_once = RangeScan { header: Header::new(at(seconds), "robot1/base_link"), ..scan(seconds) };
        bench.pose("pose", "robot1/map", seconds, truth(seconds));
        bench.scan(seconds, &at_once);
        bench.scan(seconds, &RangeScan { angle_increment: f64::NAN, ..good.clone() });
        bench.scan(seconds, &RangeScan { ranges: Vec::new(), ..at_once.clone() });
        bench.scan(seconds, &RangeScan { x: 1e7, ..at_once });
        bench.pose("pose", "elsewhere", seconds, truth(seconds));
        bench.pose("pose", "robot1/map", seconds, pose(f64::INFINITY, 0.0, 0.0));
    }
    bench.0.give_bytes("scan", "", at(0.5), gridweave_runtime::ros::encode(&good).unwrap()).unwrap();
    bench.0.give_bytes("scan", "robot1", at(0.5), vec![0, 1, 0, 0, 7]).unwrap();
    let (map, _) = bench.map(1.0);
    assert!(measure(&map.unwrap(), &Pose2::identity()).greatest < CELL);
    let warnings = bench.0.warnings();
    for expected in ["not finite", "too large", "without a robot", "in frame `elsewhere`"] {
        assert!(warnings.keys().any(|warning| warning.contains(expected)), "{expected}: {warnings:?}");
    }
    assert_eq!(RangeScan::NAME, "gridweave_msgs/msg/RangeScan");
}

#[test]
fn scans_alone_give_a_map_and_poses() {
    let mut bench = Bench::new("interval = 8");
    for tick in 0..300 {
        let seconds = 0.1 * f64::from(tick);
        // A scan of one moment: without odometry, nothing is known of the motion during a scan.
        let still = RangeScan { time_increment: 0.0, ranges: still_ranges(seconds), ..scan(seconds) };
        bench.scan(seconds, &still);
    }
    let (map, count) = bench.map(30.0);
    assert_eq!(count, 4, "three on the way, and one at the end");
    let drawn = measure(&map.unwrap(), &truth(0.0));
    assert!(drawn.mean < CELL && drawn.greatest < 8.0 * CELL, "{} {}", drawn.mean, drawn.greatest);
    assert!(drawn.occupied > 500 && drawn.free > 15_000, "{} {}", drawn.occupied, drawn.free);
    let poses: Vec<PoseWithCovarianceStamped> = bench.0.take("pose").unwrap();
    assert_eq!(poses.len(), 300);
    let off = (truth(0.0) * poses[299].pose.pose.planar()).inverse() * truth(29.9);
    assert!(off.translation.vector.norm() < 0.1 && off.rotation.angle().abs() < 0.05, "{off}");
}

#[test]
fn offline_all_poses_and_the_map_come_at_the_end() {
    let mut bench = Bench::new("mode = 'offline'\ninterval = 1");
    for tick in 0..200 {
        let seconds = 0.05 * f64::from(tick);
        bench.pose("odometry", "robot1/odom", seconds, truth(seconds));
        if tick % 4 == 0 {
            bench.scan(seconds, &scan(seconds));
        }
    }
    assert!(bench.0.take_messages("map").is_empty() && bench.0.take_messages("pose").is_empty());
    let (map, count) = bench.map(10.0);
    assert_eq!(count, 1);
    let drawn = measure(&map.unwrap(), &Pose2::identity());
    assert!(drawn.mean < CELL && drawn.greatest < 4.0 * CELL, "{} {}", drawn.mean, drawn.greatest);
    let poses: Vec<PoseWithCovarianceStamped> = bench.0.take("pose").unwrap();
    assert_eq!(poses.len(), 200);
    for (tick, pose) in poses.iter().enumerate() {
        let off = pose.pose.pose.planar().inverse() * truth(0.05 * tick as f64);
        assert!(off.translation.vector.norm() < 0.05 && off.rotation.angle().abs() < 0.03, "{tick}: {off}");
    }
}

#[test]
fn a_leap_of_odometry_and_scans_that_come_late_do_not_cost_the_map() {
    let mut bench = Bench::new("mode = 'offline'");
    for tick in 0..120 {
        let seconds = 0.1 * f64::from(tick);
        // One jump of the wheels' counters, and back.
        let jump = if tick == 110 { 1e6 } else { 0.0 };
        let odometry = truth(seconds);
        bench.pose("odometry", "robot1/odom", seconds, pose(jump, 0.0, 0.0) * odometry);
        bench.scan(seconds, &scan(seconds));
        if tick % 10 == 9 {
            bench.scan(seconds, &scan(seconds - 0.8));
        }
    }
    let (map, count) = bench.map(12.0);
    assert_eq!(count, 1);
    let drawn = measure(&map.unwrap(), &Pose2::identity());
    assert!(drawn.mean < CELL && drawn.greatest < 4.0 * CELL, "{} {}", drawn.mean, drawn.greatest);
    let warnings = bench.0.warnings();
    assert!(warnings.keys().any(|warning| warning.contains("leaps, for the first time 11.0 s")), "{warnings:?}");
    let poses: Vec<PoseWithCovarianceStamped> = bench.0.take("pose").unwrap();
    assert!(poses.iter().all(|pose| pose.pose.pose.position.x.abs() < 10.0));
}

#[test]
fn scans_that_lie_on_no_others_give_a_warning_and_no_map() {
    let mut bench = Bench::new("mode = 'offline'");
    for tick in 0..80 {
        let seconds = f64::from(tick);
        bench.pose("odometry", "robot1/odom", seconds, pose(15.0 * seconds, 0.0, 0.0));
        let header = Header::new(at(seconds), "robot1/base_link");
        bench.scan(seconds, &RangeScan { header, time_increment: 0.0, ..scan(0.1 * seconds) });
    }
    let (map, count) = bench.map(80.0);
    assert!(map.is_none() && count == 0);
    assert!(bench.0.take_messages("pose").is_empty());
    let warnings = bench.0.warnings();
    let is_lost = |text: &String| text.starts_with("no map of robot1") && text.contains("1.0 s after its first scan");
    assert!(warnings.keys().any(is_lost), "{warnings:?}");
    let lost: Vec<UnmergedRobot> = bench.0.take("lost").unwrap();
    assert!(lost.len() == 1 && lost[0].robot == "robot1" && lost[0].reason.starts_with("it has no map: "), "{lost:?}");
}

#[test]
fn a_robot_that_sends_a_map_of_its_own_has_none_drawn_from_there_on() {
    let mut bench = Bench::new("interval = 1");
    let give = |bench: &mut Bench, ticks: std::ops::Range<u32>| {
        for tick in ticks {
            let seconds = 0.1 * f64::from(tick);
            bench.scan(seconds, &scan(seconds));
            bench.pose("pose", "robot1/map", seconds, truth(seconds));
        }
    };
    give(&mut bench, 0..15);
    assert_eq!(bench.0.take_messages("map").len(), 1);
    for robot in ["robot2", "robot1"] {
        assert!(bench.0.warnings().is_empty(), "{:?}", bench.0.warnings());
        bench.0.give::<OccupancyGrid<'static>>("map", robot, at(1.5), &OccupancyGrid::default()).unwrap();
    }
    give(&mut bench, 15..60);
    assert_eq!(bench.map(6.0).1, 0, "not at the end either");
    let warnings = bench.0.warnings();
    assert!(
        warnings.keys().all(|text| text.starts_with("robot1 has sent a map")) && warnings.len() == 1,
        "{warnings:?}"
    );
}

#[test]
fn parameters_that_cannot_be_are_refused() {
    for wrong in [
        "resolution = 0",
        "hit_probability = 0.4",
        "miss_probability = 0.5",
        "max_range = 0",
        "interval = 0",
        "max_probability = 1.0",
        "wait_for_poses = 9",
        "step = 0",
        "step_yaw = -1",
        "odometry_deviation = nan",
        "max_contradicting = 1.1",
        "scan = 1",
    ] {
        assert!(StageHarness::new(&kind(), wrong).is_err(), "{wrong}");
    }
}
