//! Drives through a building whose walls are known, with odometry that drifts.

use super::contradictions::{PlacedScan, find_contradictions};
use super::{
    FramedTrajectory, PoseGraph, ScanPoint, Trajectory, joint_contradictions, joint_poses, recorded_map, scan_points,
};
use crate::shared::geometry::{Point2, Pose2, pose};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::{FRAC_PI_2, TAU};

const BEAMS: usize = 240;
/// Standard deviation of a range, metres.
const NOISE: f64 = 0.01;
/// Way between two scans, metres.
const STEP: f64 = 0.3;

/// Walls as segments: a ring of corridors 3 m wide around a block, with niches and pillars at uneven distances.
fn walls() -> Vec<[Point2; 2]> {
    let rectangle = |left: f64, low: f64, right: f64, high: f64| {
        let corners = [(left, low), (right, low), (right, high), (left, high)].map(|(x, y)| Point2::new(x, y));
        (0..4).map(move |corner| [corners[corner], corners[(corner + 1) % 4]])
    };
    let pillars =
        [(4.0, 0.4), (7.5, 2.6), (13.0, 0.5), (21.5, 4.0), (19.4, 9.0), (16.0, 15.5), (9.0, 13.3), (0.5, 6.0)];
    let pillars = pillars.into_iter().flat_map(|(x, y)| rectangle(x - 0.25, y - 0.25, x + 0.25, y + 0.25));
    rectangle(0.0, 0.0, 22.0, 16.0).chain(rectangle(3.0, 3.0, 19.0, 13.0)).chain(pillars).collect()
}

/// The nearest wall on a beam.
fn range(walls: &[[Point2; 2]], from: &Pose2, angle: f64) -> f64 {
    let way = from.rotation * nalgebra::Vector2::new(angle.cos(), angle.sin());
    let start = from.translation.vector;
    let hit = |[a, b]: &[Point2; 2]| {
        let (along, off) = (b - a, a.coords - start);
        let across = way.perp(&along);
        let (range, share) = (off.perp(&along) / across, off.perp(&way) / across);
        (range > 0.0 && (0.0..=1.0).contains(&share)).then_some(range)
    };
    walls.iter().filter_map(hit).fold(f64::INFINITY, f64::min)
}

fn scan(walls: &[[Point2; 2]], at: &Pose2, random: &mut ChaCha8Rng) -> Vec<ScanPoint> {
    scan_through(walls, &[], at, random)
}

/// A scan of walls, and of railings through which every second beam passes.
fn scan_through(
    walls: &[[Point2; 2]],
    railings: &[[Point2; 2]],
    at: &Pose2,
    random: &mut ChaCha8Rng,
) -> Vec<ScanPoint> {
    let hit = |beam: usize| {
        let angle = TAU * beam as f64 / BEAMS as f64;
        let noise: f64 = (0..12).map(|_| random.random_range(-0.5..0.5)).sum();
        let passes = railings.is_empty() || random.random_bool(0.5);
        let to_railing = if passes { f64::INFINITY } else { range(railings, at, angle) };
        let range = range(walls, at, angle).min(to_railing) + NOISE * noise;
        Point2::new(range * angle.cos(), range * angle.sin())
    };
    let hits: Vec<Point2> = (0..BEAMS).map(hit).collect();
    scan_points(&hits, &Point2::origin())
}

/// The way once around the block, and on along the first corridor.
fn drive() -> Vec<Pose2> {
    let corners = [(1.5, 1.5), (20.5, 1.5), (20.5, 14.5), (1.5, 14.5), (1.5, 1.5), (12.0, 1.5)];
    let mut poses = Vec::new();
    for (leg, ends) in corners.windows(2).enumerate() {
        let [from, to] = [ends[0], ends[1]].map(|(x, y)| Point2::new(x, y));
        let steps = ((to - from).norm() / STEP) as usize;
        for step in 0..steps {
            let place = from + (to - from) * (step as f64 / steps as f64);
            poses.push(pose(place.x, place.y, FRAC_PI_2 * leg as f64));
        }
    }
    poses
}

/// Root of the mean squared distance to the truth, metres; poses are relative to the first.
fn error(poses: &[Pose2], truth: &[Pose2]) -> f64 {
    let off = |(found, truth_at): (&Pose2, &Pose2)| {
        (found.translation.vector - truth[0].inv_mul(truth_at).translation.vector).norm_squared()
    };
    (poses.iter().zip(truth).map(off).sum::<f64>() / poses.len() as f64).sqrt()
}

#[test]
fn a_pose_by_odometry_that_is_late_turns_only_its_own_scan() {
    let walls = walls();
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let truth: Vec<Pose2> = drive().into_iter().step_by(8).collect();
    // As where the robot turns while it is scanned, and has turned back at the next scan.
    let late = |(scan, at): (usize, &Pose2)| if scan == 6 { at * pose(0.0, 0.0, 0.6) } else { *at };
    let odometry: Vec<Pose2> = truth.iter().enumerate().map(late).collect();
    let mut trajectory = Trajectory::new(0.1);
    for (scan_number, at) in truth.iter().enumerate() {
        let moved = scan_number
            .checked_sub(1)
            .map_or_else(Pose2::identity, |before| odometry[before].inv_mul(&odometry[scan_number]));
        trajectory.add(&moved, scan(&walls, at, &mut random), Point2::origin());
    }
    let off = error(trajectory.poses(), &truth);
    assert!(off < 0.05 && trajectory.unmatched() == 0, "{off}");
}

#[test]
fn a_drive_around_a_block_is_closed_though_odometry_turns_too_far() {
    let (walls, truth) = (walls(), drive());
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut trajectory = Trajectory::new(0.1);
    let mut odometry = vec![Pose2::identity()];
    let mut has_moved = false;
    for (step, at) in truth.iter().enumerate() {
        let moved = match step.checked_sub(1) {
            Some(before) => {
                let moved = truth[before].inv_mul(at);
                let (way, turn) = (moved.translation.vector * 1.05, 0.03 * moved.translation.vector.norm());
                pose(way.x, way.y, moved.rotation.angle() + turn)
            }
            None => Pose2::identity(),
        };
        if step > 0 {
            odometry.push(odometry[step - 1] * moved);
        }
        has_moved |= trajectory.add(&moved, scan(&walls, at, &mut random), Point2::origin());
    }
    has_moved |= trajectory.finish_submap();
    let (closed, start) = (error(trajectory.poses(), &truth), trajectory.poses()[..5].to_vec());
    assert!(trajectory.finish());
    for (now, before) in trajectory.poses().iter().zip(&start) {
        let off = before.inv_mul(now);
        assert!(
            off.translation.vector.norm() < 0.05 && off.rotation.angle().abs() < 0.02,
            "the frame has moved: {off}"
        );
    }
    let (before, after) = (error(&odometry, &truth), error(trajectory.poses(), &truth));
    assert!(before > 3.0, "odometry alone is off by {before} m");
    assert!(closed < 0.15 && after < 0.02, "{closed} m, and {after} m with what was seen at other times");
    assert!(has_moved && trajectory.closures().next().is_some());
    assert_eq!((trajectory.unmatched(), trajectory.poses().len()), (0, truth.len()));
    for closure in trajectory.closures() {
        let off = truth[closure.from].inv_mul(&truth[closure.to]).inverse() * closure.transform;
        assert!(off.translation.vector.norm() < 0.2 && off.rotation.angle().abs() < 0.05, "{closure:?}");
    }
}

#[test]
fn scans_without_anything_in_common_are_unmatched_and_keep_their_poses_by_odometry() {
    let (walls, truth) = (walls(), drive());
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let mut trajectory = Trajectory::new(0.1);
    for (step, at) in truth.iter().enumerate().take(10) {
        let moved = if step == 0 { Pose2::identity() } else { pose(40.0, 0.0, 0.0) };
        trajectory.add(&moved, scan(&walls, at, &mut random), Point2::origin());
    }
    assert_eq!(trajectory.unmatched(), 9);
    assert!((trajectory.poses()[9].translation.vector.x - 360.0).abs() < 1e-9);
}

#[test]
fn what_was_registered_can_be_located_without_adding_it() {
    let (walls, truth) = (walls(), drive());
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut trajectory = Trajectory::new(0.1);
    assert!(trajectory.locate(&Pose2::identity(), [0.1; 2], &[]).is_none());
    for (step, at) in truth.iter().enumerate().take(4) {
        let moved = if step == 0 { Pose2::identity() } else { pose(STEP, 0.0, 0.0) };
        trajectory.add(&moved, scan(&walls, at, &mut random), Point2::origin());
    }
    let at = truth[3] * pose(0.2, 0.05, 0.1);
    let found = trajectory.locate(&Pose2::identity(), [0.1; 2], &scan(&walls, &at, &mut random)).unwrap();
    assert!(found.is_sure, "{found:?}");
    let off = found.pose.inverse() * truth[3].inv_mul(&at);
    assert!(off.translation.vector.norm() < 0.02 && off.rotation.angle().abs() < 0.01, "{off}");
    assert_eq!(trajectory.poses().len(), 4);
}

#[test]
fn scans_contradict_walls_that_were_drawn_elsewhere() {
    let (walls, truth) = (walls(), drive());
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let scans: Vec<Vec<ScanPoint>> = truth.iter().map(|at| scan(&walls, at, &mut random)).collect();
    // The first corridor is driven along again at the end.
    let again = truth.len() - 35;
    let contradictions = |moved: f64| {
        let mut placed = Vec::new();
        for (scan, (points, at)) in scans.iter().zip(&truth).enumerate() {
            let by = if scan < again { 0.0 } else { moved };
            placed.push(PlacedScan { points, pose: pose(0.0, by, 0.0) * at, lidar: Some(Point2::origin()), drive: 0 });
        }
        find_contradictions(&placed, 40)
    };
    let right = contradictions(0.0);
    assert!(right.revisiting > 60 && right.contradicting.is_empty(), "{right:?}");
    assert_eq!(contradictions(0.1).contradicting, [0; 0], "walls are drawn to a few centimetres");
    let doubled = contradictions(0.6);
    let is_along_it = |scan: &usize| *scan < 45 || *scan >= again;
    assert!(doubled.contradicting.len() > 50 && doubled.contradicting.iter().all(is_along_it), "{doubled:?}");
    let alone = scans.iter().zip(&truth).take(30);
    let alone = alone.map(|(points, pose)| PlacedScan { points, pose: *pose, lidar: Some(Point2::origin()), drive: 0 });
    assert_eq!(find_contradictions(&alone.collect::<Vec<_>>(), 40).revisiting, 0);
}

#[test]
fn scans_do_not_contradict_a_railing_that_was_looked_through_whenever_it_was_seen() {
    let (walls, truth) = (walls(), drive());
    // Along the first corridor, in front of the block, on both ways there.
    let railing = [[Point2::new(2.0, 2.3), Point2::new(20.0, 2.3)]];
    let mut random = ChaCha8Rng::seed_from_u64(9);
    let scans: Vec<_> = truth.iter().map(|at| scan_through(&walls, &railing, at, &mut random)).collect();
    let placed = scans.iter().zip(&truth);
    let placed =
        placed.map(|(points, pose)| PlacedScan { points, pose: *pose, lidar: Some(Point2::origin()), drive: 0 });
    let found = find_contradictions(&placed.collect::<Vec<_>>(), 40);
    assert!(found.revisiting > 60 && found.contradicting.is_empty(), "{found:?}");
}

/// The trajectory of a robot with a lidar of some metres, whose odometry goes too far and turns too far along the poses.
fn driven(walls: &[[Point2; 2]], truth: &[Pose2], metres: f64, seed: u64) -> Trajectory {
    let mut trajectory = added(walls, truth, metres, seed);
    trajectory.finish();
    trajectory
}

/// The same before the end of the drive.
fn added(walls: &[[Point2; 2]], truth: &[Pose2], metres: f64, seed: u64) -> Trajectory {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut trajectory = Trajectory::new(0.1);
    let mut last = truth[0];
    for at in truth {
        let moved = last.inv_mul(at);
        let (way, turn) = (moved.translation.vector * 1.05, 0.03 * moved.translation.vector.norm());
        let mut points = scan(walls, at, &mut random);
        points.retain(|point| point.place.coords.norm() < metres);
        trajectory.add(&pose(way.x, way.y, moved.rotation.angle() + turn), points, Point2::origin());
        last = *at;
    }
    trajectory
}

#[test]
fn errors_of_the_yaw_do_not_add_up_as_those_of_the_position_do() {
    let (walls, truth) = (walls(), &drive()[..180]);
    let trajectory = added(&walls, truth, 30.0, 3);
    let (poses, constraints) = (trajectory.poses().to_vec(), trajectory.constraints().to_vec());
    assert!(trajectory.closures().next().is_none(), "it has not come back so far");
    let covariances = PoseGraph { poses, constraints, ..Default::default() }.covariances_from(179).unwrap();
    let deviation = |apart: usize| covariances[179 - apart].m33.sqrt();
    assert!(deviation(160) < 2.0 * deviation(20), "{} {}", deviation(160), deviation(20));
    for apart in [20, 40, 80, 160] {
        let relative = |poses: &[Pose2]| poses[179].inv_mul(&poses[179 - apart]);
        let (found, real) = (relative(trajectory.poses()), relative(truth));
        let off = (found.translation.vector - real.translation.vector).norm();
        let covariance = covariances[179 - apart];
        assert!(off < 3.0 * (covariance.m11 + covariance.m22).sqrt(), "{apart}: {off}");
        assert!((found.rotation / real.rotation).angle().abs() < 3.0 * deviation(apart), "{apart}");
    }
}

#[test]
fn robots_in_one_graph_straighten_each_other_and_one_elsewhere_is_left_out() {
    let (walls, truth) = (walls(), drive());
    let closed = driven(&walls, &truth, 30.0, 5);
    // Half a round, which has no loop, with a lidar that seldom sees how far it has come along a corridor.
    let half = &truth[truth.len() / 4..truth.len() * 3 / 4];
    let mut open = driven(&walls, half, 2.0, 6);
    let alone = error(open.poses(), half);
    let frame = truth[0].inv_mul(&half[0]) * pose(0.2, -0.1, 0.02);
    let robots = [
        FramedTrajectory { trajectory: &closed, frame: Pose2::identity() },
        FramedTrajectory { trajectory: &open, frame },
        FramedTrajectory { trajectory: &open, frame: pose(500.0, 0.0, 0.0) },
    ];
    let found = joint_poses(&robots);
    let [Some(_), Some(together), None] = &found[..] else { panic!("{found:?}") };
    let in_common = error(&together.iter().map(|pose| together[0].inv_mul(pose)).collect::<Vec<_>>(), half);
    open.move_to(together.clone());
    let after = error(open.poses(), half);
    assert!(
        after < 0.5 * alone && in_common < 0.5 * alone,
        "{alone} m alone, and {after} m with the other, {in_common}"
    );

    let contradicting = |by: f64| {
        let moved: Vec<Pose2> = together.iter().map(|at| pose(0.0, by, 0.0) * at).collect();
        let other = found[0].as_ref().unwrap();
        joint_contradictions(&[(&closed, other), (&open, &moved)]).contradicting.len()
    };
    assert_eq!(contradicting(0.0), 0);
    assert!(contradicting(0.6) > 30, "{}", contradicting(0.6));
}

#[test]
fn tags_that_are_seen_again_close_a_loop_where_scans_show_nothing() {
    let truth = drive();
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let mut trajectory = Trajectory::new(0.1);
    let tags = [
        ("family:1", Point2::new(3.0, 0.0)),
        ("family:2", Point2::new(8.0, 3.0)),
        ("family:3", Point2::new(22.0, 8.0)),
    ];
    let mut closed_on_the_way = false;
    let mut before = 0.0;
    for (step, at) in truth.iter().enumerate() {
        let moved = truth[step.saturating_sub(1)].inv_mul(at);
        let turn = moved.rotation.angle() + 0.006 * moved.translation.vector.norm();
        closed_on_the_way |=
            trajectory.add(&pose(moved.translation.x, moved.translation.y, turn), Vec::new(), Point2::origin());
        for (tag, place) in tags {
            let seen = at.inverse() * place;
            let noise = |random: &mut ChaCha8Rng| random.random_range(-0.03..0.03);
            let seen = Point2::new(seen.x + noise(&mut random), seen.y + noise(&mut random));
            if seen.coords.norm() < 4.0 && !closed_on_the_way {
                before = error(trajectory.poses(), &truth[..=step]);
            }
            if seen.coords.norm() < 4.0 {
                trajectory.see(step, tag, seen, 0.03);
            }
        }
    }
    trajectory.finish();
    let after = error(trajectory.poses(), &truth);
    assert!(closed_on_the_way, "a map on the way has the loop, too");
    assert!(before > 1.0 && after < 0.3 * before, "{before} m before, {after} m after");
}

#[test]
fn scans_are_straightened_by_a_recorded_map_which_stays_as_it_is() {
    let (walls, truth) = (walls(), drive());
    let half = &truth[truth.len() / 4..truth.len() * 3 / 4];
    let mut open = driven(&walls, half, 2.5, 8);
    let alone = error(open.poses(), half);
    // Points of the walls on both sides, in the frame of the building.
    let mut points = Vec::new();
    for [from, to] in &walls {
        let way = to - from;
        let normal = nalgebra::Vector2::new(way.y, -way.x).normalize();
        let steps = (way.norm() / 0.05) as usize;
        for step in 0..steps {
            let place = from + way * (step as f64 / steps as f64);
            points.extend([normal, -normal].map(|normal| ScanPoint { place, normal: Some(normal) }));
        }
    }
    let recorded = recorded_map(points.into_iter());
    let map = FramedTrajectory { trajectory: &recorded, frame: Pose2::identity() };
    let robot = FramedTrajectory { trajectory: &open, frame: half[0] * pose(0.2, 0.1, -0.02) };
    let found = joint_poses(&[map, robot]);
    let [Some(squares), Some(together)] = &found[..] else { panic!("{found:?}") };
    for (before, after) in recorded.poses().iter().zip(squares) {
        let off = before.inv_mul(after);
        assert!(off.translation.vector.norm() < 2e-3 && off.rotation.angle().abs() < 2e-3, "{off}");
    }
    let contradicting = |by: f64| {
        let moved: Vec<Pose2> = together.iter().map(|at| pose(0.0, by, 0.0) * at).collect();
        joint_contradictions(&[(&recorded, squares), (&open, &moved)]).contradicting.len()
    };
    assert_eq!(contradicting(0.0), 0);
    assert!(contradicting(0.6) > 10, "{}", contradicting(0.6));
    open.move_to(together.clone());
    let after = error(open.poses(), half);
    assert!(after < 0.5 * alone, "{alone} m alone, and {after} m on the map");
}

#[test]
fn a_tag_that_is_seen_again_from_the_last_scan_alone_counts() {
    let truth = drive();
    let tag = Point2::new(3.0, 0.0);
    let seen = |step: usize| truth[step].inverse() * tag;
    let again = (0..truth.len()).rev().find(|step| seen(*step).coords.norm() < 2.0).unwrap();
    let mut trajectory = Trajectory::new(0.1);
    for (step, at) in truth.iter().enumerate().take(again + 1) {
        let moved = truth[step.saturating_sub(1)].inv_mul(at);
        let turn = moved.rotation.angle() + 0.006 * moved.translation.vector.norm();
        trajectory.add(&pose(moved.translation.x, moved.translation.y, turn), Vec::new(), Point2::origin());
        if step == 5 {
            trajectory.see(step, "family:1", seen(step), 0.03);
        }
    }
    // The submap ends with the last scan, and the sighting comes after it.
    trajectory.finish_submap();
    let before = error(trajectory.poses(), &truth[..=again]);
    trajectory.see(again, "family:1", seen(again), 0.03);
    assert!(trajectory.finish());
    let after = error(trajectory.poses(), &truth[..=again]);
    assert!(after < 0.7 * before, "{before} m before, {after} m after");
}
