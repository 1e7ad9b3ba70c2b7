//! Robots whose odometry, clock or lidar is not as it should be.

use super::test_drive::{BEAMS, CELL, LIDAR, WALLS, at, cast, scan, still_ranges, truth};
use super::tests::{Bench, measure};
use crate::shared::geometry::{Pose2, pose};
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{Header, PoseStamped, PoseWithCovarianceStamped, RangeScan, UnmergedRobot};
use std::f64::consts::TAU;

/// A scan of one moment.
fn still(seconds: f64) -> RangeScan {
    RangeScan { time_increment: 0.0, ranges: still_ranges(seconds), ..scan(seconds) }
}

/// The same in a room two of whose walls are farther away.
fn still_in_wider_room(seconds: f64) -> RangeScan {
    let [x, y, yaw] = LIDAR;
    let (walls, lidar) = ([[-4.0, -3.0, 6.8, 3.8], WALLS[1]], truth(seconds) * pose(x, y, yaw));
    let angle = |beam: usize| -3.0 + TAU / BEAMS as f64 * beam as f64;
    RangeScan { ranges: (0..BEAMS).map(|beam| cast(&walls, &lidar, angle(beam)) as f32).collect(), ..still(seconds) }
}

/// Drives for half a minute, with odometry and scans as they are changed.
fn drive(odometry: impl Fn(f64) -> Pose2, changed: impl Fn(RangeScan) -> RangeScan) -> Bench {
    let mut bench = Bench::new("mode = 'offline'");
    for tick in 0..300 {
        let seconds = 0.1 * f64::from(tick);
        bench.pose("odometry", "robot1/odom", seconds, odometry(seconds));
        bench.scan(seconds, &changed(still(seconds)));
    }
    bench
}

fn warns(bench: &mut Bench, of: &str) -> bool {
    bench.0.warnings().keys().any(|warning| warning.contains(of))
}

/// Why robot1 has no map.
fn lost(bench: &mut Bench) -> Vec<String> {
    let lost: Vec<UnmergedRobot> = bench.0.take("lost").unwrap();
    lost.into_iter().map(|lost| lost.reason).collect()
}

#[test]
fn odometry_that_starts_again_goes_on_where_it_was() {
    let restart = truth(14.95).inverse();
    let mut bench =
        drive(|seconds| if seconds < 14.95 { truth(seconds) } else { restart * truth(seconds) }, |scan| scan);
    let drawn = measure(&bench.map(30.0).0.unwrap(), &Pose2::identity());
    assert!(drawn.mean < CELL && drawn.greatest < 8.0 * CELL, "{} {}", drawn.mean, drawn.greatest);
    assert!(warns(&mut bench, "the odometry of robot1 leaps, for the first time 15.0 s after its first scan"));
}

#[test]
fn a_lidar_that_is_mounted_with_another_yaw_than_given_is_named() {
    let turned = |by: f64| move |scan: RangeScan| RangeScan { yaw: scan.yaw + by, ..scan };
    for (by, text) in [(1.5, "robot1 moves 86 degrees farther to the left"), (-0.2, "11 degrees farther to the right")]
    {
        let mut bench = drive(truth, turned(by));
        assert!(bench.map(30.0).0.is_some());
        assert!(warns(&mut bench, text), "{:?}", bench.0.warnings());
        let is_given = ["0.39", "0.40", "0.41"].iter().any(|yaw| warns(&mut bench, &format!("robot1=X,Y,{yaw}")));
        assert!(is_given, "{:?}", bench.0.warnings());
    }
    let mut right = drive(truth, |scan| scan);
    assert!(right.map(30.0).0.is_some() && !warns(&mut right, "farther to the"), "{:?}", right.0.warnings());
}

#[test]
fn odometry_twice_as_long_is_named() {
    let long = |seconds| Pose2::from_parts((2.0 * truth(seconds).translation.vector).into(), truth(seconds).rotation);
    let mut bench = drive(long, |scan| scan);
    let _ = bench.map(30.0);
    assert!(warns(&mut bench, "too long by its scans"), "{:?}", bench.0.warnings());
}

#[test]
fn scans_that_cannot_be_used_or_show_nothing_are_reasons_without_a_map() {
    let none = |scan: RangeScan| RangeScan { angle_increment: f64::NAN, ..scan };
    let back = |scan: RangeScan| RangeScan { time_increment: -1e-4, ..scan };
    let many = |scan: RangeScan| RangeScan { ranges: vec![2.0; 100_001], ..scan };
    let blind = |scan: RangeScan| RangeScan { ranges: vec![f32::NAN; BEAMS], ..scan };
    let changes: [(&dyn Fn(RangeScan) -> RangeScan, &str); 4] = [
        (&none, "none of its 300 scans can be used: angle_min, angle_increment"),
        (&back, "none of its 300 scans can be used: time_increment is below 0"),
        (&many, "none of its 300 scans can be used: a scan has more than 100000 beams"),
        (&blind, "its scans show nothing within"),
    ];
    for (change, reason) in changes {
        let mut bench = drive(truth, change);
        assert!(bench.map(30.0).0.is_none());
        let lost = lost(&mut bench);
        assert!(lost.len() == 1 && lost[0].contains(reason), "{lost:?}");
    }
}

#[test]
fn scans_that_are_left_out_of_a_map_that_would_get_too_large_are_counted() {
    // A room of 70 m in cells of 5 mm.
    let mut bench = Bench::new("mode = 'offline'\nresolution = 0.005\nmax_range = 500.0");
    for tick in 0..60 {
        let seconds = 0.1 * f64::from(tick);
        let (small, [x, y, yaw]) = (truth(seconds / 7.0), LIDAR);
        let at = Pose2::from_parts((7.0 * small.translation.vector).into(), small.rotation);
        let ranges = still_ranges(seconds / 7.0).iter().map(|range| 7.0 * range).collect();
        bench.pose("odometry", "robot1/odom", seconds, at);
        let of_large = RangeScan { x: 7.0 * x, y: 7.0 * y, yaw, ranges, range_max: 1000.0, ..still(seconds) };
        bench.scan(seconds, &of_large);
    }
    assert!(bench.map(6.0).0.is_none());
    assert!(
        warns(&mut bench, "scans of robot1 were left out: its map would get too large"),
        "{:?}",
        bench.0.warnings()
    );
    let lost = lost(&mut bench);
    assert!(lost.len() == 1 && lost[0].contains("its map would get too large"), "{lost:?}");
}

#[test]
fn of_a_lidar_that_is_upside_down_no_mirrored_map_is_drawn() {
    let upside_down = |scan: RangeScan| RangeScan {
        yaw: -scan.yaw,
        y: -scan.y,
        angle_min: -scan.angle_min,
        angle_increment: -scan.angle_increment,
        ..scan
    };
    let mut bench = drive(truth, upside_down);
    assert!(bench.map(30.0).0.is_none());
    let reasons = lost(&mut bench);
    assert!(reasons.len() == 1 && reasons[0].contains("--lidar robot1=X,Y,YAW,3.1416"), "{reasons:?}");
}

#[test]
fn odometry_that_never_moves_is_reported() {
    let mut bench = drive(|_| truth(3.0), |scan| scan);
    bench.map(30.0);
    assert!(warns(&mut bench, "the odometry of robot1 stands still, so that only the first of 300 scans is used"));
}

#[test]
fn a_range_of_the_longest_that_the_lidar_reports_is_no_wall() {
    let nothing = |scan: RangeScan| {
        let ranges = scan.ranges.iter().map(|range| if *range > 3.0 { 3.0 } else { *range });
        RangeScan { range_max: 3.0, ranges: ranges.collect(), ..scan }
    };
    let mut bench = drive(truth, nothing);
    let drawn = measure(&bench.map(30.0).0.unwrap(), &Pose2::identity());
    assert!(drawn.mean < CELL && drawn.greatest < 4.0 * CELL, "{} {}", drawn.mean, drawn.greatest);
}

#[test]
fn a_first_message_without_a_stamp_does_not_cost_the_map() {
    let mut bench = Bench::new("mode = 'offline'");
    for tick in 0..300 {
        let seconds = 0.1 * f64::from(tick);
        let (log_time, simulated) = (at(1e6 + seconds), at(seconds));
        let stamp = if tick == 0 { LogTime::MIN } else { simulated };
        let odometry = PoseStamped { header: Header::new(stamp, "robot1/odom"), pose: truth(seconds).into() };
        bench.0.give::<PoseWithCovarianceStamped>("odometry", "robot1", log_time, &odometry.into()).unwrap();
        let header = Header::new(simulated, "robot1/base_link");
        bench.0.give::<RangeScan>("scan", "robot1", log_time, &RangeScan { header, ..still(seconds) }).unwrap();
    }
    let drawn = measure(&bench.map(1e6 + 30.0).0.unwrap(), &Pose2::identity());
    assert!(drawn.mean < CELL && drawn.occupied > 500, "{} {}", drawn.mean, drawn.occupied);
}

#[test]
fn a_robot_none_of_whose_scans_has_a_pose_is_reported() {
    let mut bench = Bench::new("mode = 'offline'");
    // A localizer that has begun long after the scans.
    bench.pose("pose", "robot1/map", 500.0, truth(0.0));
    (0..30).map(f64::from).for_each(|seconds| bench.scan(seconds, &still(seconds)));
    assert!(bench.map(500.0).0.is_none());
    let reasons = lost(&mut bench);
    let reason = "none of its 30 scans is used: its first pose is 471.0 s after";
    assert!(reasons.len() == 1 && reasons[0].contains(reason), "{reasons:?}");
}

#[test]
fn odometry_whose_ways_are_too_long_is_corrected() {
    let mut longer = Pose2::identity();
    let poses: Vec<Pose2> = (0..300)
        .map(|tick| {
            let at = |tick: i32| truth(0.1 * f64::from(tick));
            let moved = if tick == 0 { Pose2::identity() } else { at(tick - 1).inv_mul(&at(tick)) };
            longer *= Pose2::from_parts((1.1 * moved.translation.vector).into(), moved.rotation);
            truth(0.0) * longer
        })
        .collect();
    let mut bench = drive(|seconds| poses[(10.0 * seconds).round() as usize], |scan| scan);
    let drawn = measure(&bench.map(30.0).0.unwrap(), &Pose2::identity());
    assert!(drawn.mean < CELL && drawn.greatest < 8.0 * CELL, "{} {}", drawn.mean, drawn.greatest);
    assert!(warns(&mut bench, "% too long by its scans, and is corrected"), "{:?}", bench.0.warnings());
}

#[test]
fn a_robot_that_is_elsewhere_after_a_pause_has_lost_its_way() {
    let mut bench = Bench::new("mode = 'offline'");
    for tick in 0..200 {
        let seconds = 0.1 * f64::from(tick) + if tick < 100 { 0.0 } else { 5.0 };
        // In a round shaft nothing is as it was.
        let ranges = if tick < 100 { still_ranges(seconds) } else { vec![0.7; still_ranges(0.0).len()] };
        bench.scan(seconds, &RangeScan { ranges, ..still(seconds) });
    }
    assert!(bench.map(30.0).0.is_some(), "what was before the pause stays");
    let poses: Vec<PoseWithCovarianceStamped> = bench.0.take("pose").unwrap();
    assert!(!poses.is_empty() && poses.iter().all(|pose| LogTime::from(pose.header.stamp) < at(10.0)));
    let lost = "robot1 has lost its way 15.0 s after its first scan: nothing shows how it moved in the 5.1 s before";
    assert!(warns(&mut bench, lost), "{:?}", bench.0.warnings());
}

/// Drives for half a minute with a gap of ten seconds without odometry, which is then off by `off`, and with no scans in it or all of
/// them, which are changed from its end on.
fn drive_with_gap(off: &Pose2, has_scans: bool, changed: impl Fn(RangeScan) -> RangeScan) -> Bench {
    let mut bench = Bench::new("mode = 'offline'");
    for seconds in (0..400).map(|tick| 0.1 * f64::from(tick)) {
        let (is_gap, is_after) = ((10.0..20.0).contains(&seconds), seconds >= 20.0);
        if !is_gap {
            bench.pose(
                "odometry",
                "robot1/odom",
                seconds,
                if is_after { off * truth(seconds) } else { truth(seconds) },
            );
        }
        if !is_gap || has_scans {
            bench.scan(seconds, &if is_after { changed(still(seconds)) } else { still(seconds) });
        }
    }
    bench
}

#[test]
fn a_robot_whose_odometry_is_too_uncertain_after_a_gap_of_its_scans_has_lost_its_way() {
    let shaft = |scan: RangeScan| RangeScan { ranges: vec![0.7; scan.ranges.len()], ..scan };
    for has_scans in [false, true] {
        let mut bench = drive_with_gap(&Pose2::identity(), has_scans, shaft);
        let drawn = measure(&bench.map(40.0).0.unwrap(), &Pose2::identity());
        assert!(
            drawn.mean < CELL && drawn.greatest < 4.0 * CELL,
            "what was before stays: {} {}",
            drawn.mean,
            drawn.greatest
        );
        let poses: Vec<PoseWithCovarianceStamped> = bench.0.take("pose").unwrap();
        assert!(!poses.is_empty() && poses.iter().all(|pose| LogTime::from(pose.header.stamp) < at(11.0)));
        let lost = "robot1 has lost its way 20.0 s after its first scan: it has no scans with odometry of the ";
        assert!(warns(&mut bench, lost), "{:?}", bench.0.warnings());
    }
}

#[test]
fn a_robot_that_sees_where_it_is_after_a_gap_of_its_scans_goes_on_there() {
    let mut bench = drive_with_gap(&pose(0.9, -0.7, 0.5), false, |scan| scan);
    let drawn = measure(&bench.map(40.0).0.unwrap(), &Pose2::identity());
    assert!(drawn.mean < CELL && drawn.greatest < 8.0 * CELL, "{} {}", drawn.mean, drawn.greatest);
    let poses: Vec<PoseWithCovarianceStamped> = bench.0.take("pose").unwrap();
    assert!(poses.iter().any(|pose| LogTime::from(pose.header.stamp) > at(39.0)));
    assert!(!warns(&mut bench, "lost its way"), "{:?}", bench.0.warnings());
}

#[test]
fn a_robot_without_odometry_loses_its_way_where_walls_do_not_show_how_it_moves() {
    // The end of the corridor is out of reach after 10 s.
    let corridor = [[-3.0, -1.0, 60.0, 1.0]];
    let mut bench = Bench::new("mode = 'offline'");
    for tick in 0..300 {
        let seconds = 0.1 * f64::from(tick);
        let (x, sway) = (0.5 * seconds, 0.05 * (0.5 * seconds).sin());
        let lidar = pose(x, sway, sway);
        let angle = |beam: usize| -3.0 + TAU / BEAMS as f64 * beam as f64;
        let ranges = (0..BEAMS).map(|beam| cast(&corridor, &lidar, angle(beam)) as f32).collect();
        let still = RangeScan { x: 0.0, y: 0.0, yaw: 0.0, range_max: 8.0, ranges, ..still(seconds) };
        bench.scan(seconds, &still);
    }
    assert!(bench.map(30.0).0.is_some(), "what was before stays");
    let poses: Vec<PoseWithCovarianceStamped> = bench.0.take("pose").unwrap();
    let last = poses.last().unwrap();
    let lost = LogTime::from(last.header.stamp).seconds_since(at(0.0));
    assert!((9.0..12.0).contains(&lost), "{lost}");
    assert!((last.pose.pose.position.x - 0.5 * lost).abs() < 0.1, "{lost} {:?}", last.pose.pose);
    assert!(warns(&mut bench, "along walls that are bare and parallel"), "{:?}", bench.0.warnings());
}

#[test]
fn no_map_is_sent_whose_walls_are_looked_through_unless_it_is_asked_for() {
    let drive = |parameters: &str| {
        let mut bench = Bench::new(parameters);
        for tick in 0..300 {
            let seconds = 0.1 * f64::from(tick);
            bench.pose("odometry", "robot1/odom", seconds, truth(seconds));
            bench.scan(seconds, &if tick < 150 { still(seconds) } else { still_in_wider_room(seconds) });
        }
        bench
    };
    for parameters in ["mode = 'offline'", "interval = 100.0", "interval = 14.0"] {
        let mut bench = drive(parameters);
        // What was sent before walls were looked through stays.
        let sent = usize::from(parameters == "interval = 14.0");
        assert_eq!(bench.map(30.0).1, sent, "{parameters}");
        let reasons = lost(&mut bench);
        let is_said = |reason: &String| reason.contains("that see walls again look through them");
        assert!(!reasons.is_empty() && reasons.iter().all(is_said), "{reasons:?}");
    }
    assert!(drive("mode = 'offline'\nmax_contradicting = 1.0").map(30.0).0.is_some());
}
