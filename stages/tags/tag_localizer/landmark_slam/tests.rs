use super::super::TagLocalizerParameters;
use super::super::measured::Measured;
use super::{Keyframes, LocatedTags, locate};
use crate::shared::geometry::{Point2, Pose2, pose};
use gridweave_runtime::message::LogTime;
use nalgebra::Vector2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

/// How a robot reads tags.
#[derive(Clone, Copy, Debug)]
enum Reads {
    Ranges,
    Bearings,
    Places,
}

const TAGS: [Point2; 6] = [
    Point2::new(1.0, 6.0),
    Point2::new(4.0, -3.0),
    Point2::new(9.0, 7.0),
    Point2::new(13.0, -2.0),
    Point2::new(-4.0, 2.0),
    Point2::new(6.0, 2.0),
];

/// Three rounds of a square of 8 m from the origin on, whose odometry turns by `drift` radians after a metre. One
/// reading of twenty is of another tag.
fn drive(reads: Reads, drift: f64, seed: u64) -> (Keyframes, Vec<Pose2>) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let noise = Normal::new(0.0, 1.0).unwrap();
    let (mut truth, mut odometry) = (Pose2::identity(), Pose2::identity());
    let mut keyframes = Keyframes::new(0.1);
    let mut path = Vec::new();
    for step in 0..960 {
        let turn = if step % 80 == 79 { std::f64::consts::FRAC_PI_2 } else { 0.0 };
        let error = drift * (0.1f64 + turn).sqrt() * noise.sample(&mut random);
        let time = LogTime::MIN.plus_seconds(f64::from(step));
        keyframes.add_pose(time, &odometry);
        path.push(truth);
        for (number, tag) in TAGS.iter().enumerate() {
            if random.random::<f64>() > 0.3 {
                continue;
            }
            let seen = (truth.inverse() * tag).coords;
            let number = if random.random::<f64>() < 0.05 { (number + 1) % TAGS.len() } else { number };
            let measured = match reads {
                Reads::Ranges => Measured::Range((seen.norm() + 0.1 * noise.sample(&mut random)).max(0.01)),
                Reads::Places => {
                    Measured::Place(seen + 0.1 * Vector2::new(noise.sample(&mut random), noise.sample(&mut random)))
                }
                Reads::Bearings => Measured::Bearing {
                    sensor: Vector2::zeros(),
                    bearing: seen.y.atan2(seen.x) + 0.03 * noise.sample(&mut random),
                    stddev: 0.05,
                },
            };
            keyframes.add_reading(&odometry, &format!("tag{number}"), measured, 0.1);
        }
        truth *= pose(0.1, 0.0, turn);
        odometry *= pose(0.1, 0.0, turn + error);
    }
    (keyframes, path)
}

/// Holds that all tags are near the truth, in metres and in standard deviations.
#[track_caller]
fn assert_located(located: &LocatedTags, metres: f64) {
    assert_eq!(located.modes.len(), TAGS.len());
    for ((id, mode), tag) in located.modes.iter().zip(TAGS) {
        let mode = mode.as_ref().unwrap_or_else(|| panic!("{id} is not located"));
        let off = mode.position - tag;
        let squared = off.dot(&(mode.covariance.try_inverse().unwrap() * off));
        assert!(off.norm() < metres && squared < 16.0, "{id}: {:.3} m, {squared:.1}", off.norm());
    }
}

#[test]
fn tags_and_drive_are_found_in_spite_of_drift() {
    for reads in [Reads::Ranges, Reads::Bearings, Reads::Places] {
        for seed in 1..4 {
            let (keyframes, path) = drive(reads, 0.05, seed);
            let located = locate(&keyframes, &TagLocalizerParameters::default()).unwrap();
            assert_located(&located, 1.2);
            let off = located.poses.iter().map(|(time, found)| {
                let truth = &path[time.seconds_since(LogTime::MIN).round() as usize];
                (found.translation.vector - truth.translation.vector).norm()
            });
            let worst = off.fold(0.0, f64::max);
            assert!(!located.poses.is_empty() && worst < 1.0, "{reads:?} {seed}: {worst}");
        }
    }
}

#[test]
fn poses_that_something_keeps_from_drifting_away_are_right_on_the_whole() {
    // Loop closures bring the heading back every 4 m, whose error grows by 0.03 rad after a metre until then.
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let noise = Normal::new(0.0, 1.0).unwrap();
    let mut keyframes = Keyframes::new(0.1);
    let (mut truth, mut error) = (Pose2::identity(), 0.0);
    for step in 0..960 {
        let turn = if step % 80 == 79 { std::f64::consts::FRAC_PI_2 } else { 0.0 };
        error = if step % 40 == 20 { 0.0 } else { error + 0.03 * 0.1f64.sqrt() * noise.sample(&mut random) };
        // The first poses have an error of their own.
        let off = error + if step < 40 { 0.03 } else { 0.0 };
        let reported = truth * pose(0.0, 0.0, off);
        let time = LogTime::MIN.plus_seconds(f64::from(step));
        keyframes.add_pose(time, &reported);
        for (number, tag) in TAGS.iter().enumerate().filter(|(number, _)| (step + *number as i32) % 3 == 0) {
            let seen = (truth.inverse() * tag).coords;
            let error = 0.05 * Vector2::new(noise.sample(&mut random), noise.sample(&mut random));
            keyframes.add_reading(&reported, &format!("tag{number}"), Measured::Place(seen + error), 0.05);
        }
        truth *= pose(0.1, 0.0, turn);
    }
    let located = locate(&keyframes, &TagLocalizerParameters::default()).unwrap();
    assert_located(&located, 0.1);
}

#[test]
fn an_odometry_without_drift_is_taken_as_it_is() {
    for reads in [Reads::Ranges, Reads::Bearings, Reads::Places] {
        let located = locate(&drive(reads, 0.0, 5).0, &TagLocalizerParameters::default()).unwrap();
        assert!(located.poses.is_empty(), "{reads:?}");
        assert_located(&located, 0.15);
    }
}

#[test]
fn the_same_drive_gives_the_same_bits() {
    let found = || format!("{:?}", locate(&drive(Reads::Ranges, 0.03, 9).0, &TagLocalizerParameters::default()));
    assert_eq!(found(), found());
}

#[test]
fn a_drive_without_readings_or_with_one_locates_nothing() {
    let parameters = TagLocalizerParameters::default();
    let mut keyframes = Keyframes::new(0.1);
    assert!(locate(&keyframes, &parameters).is_none());
    keyframes.add_pose(LogTime::MIN, &Pose2::identity());
    assert!(locate(&keyframes, &parameters).is_none());
    keyframes.add_reading(&Pose2::identity(), "a", Measured::Range(2.0), 0.1);
    assert!(locate(&keyframes, &parameters).is_none());
}

#[test]
fn poses_and_readings_out_of_all_bounds_do_no_harm() {
    let parameters = TagLocalizerParameters::default();
    let mut keyframes = Keyframes::new(0.1);
    for step in 0..200 {
        let far = 1e150 * f64::from(step % 7);
        let here = pose(far, -far, f64::from(step));
        keyframes.add_pose(LogTime::MIN, &here);
        keyframes.add_reading(&here, "a", Measured::Range(1e-300), 1e-300);
        keyframes.add_reading(&here, "b", Measured::Place(Vector2::new(1e150, 0.0)), 0.1);
    }
    let located = locate(&keyframes, &parameters);
    assert!(
        located.is_none_or(|located| located
            .modes
            .iter()
            .flat_map(|(_, mode)| mode)
            .all(|mode| mode.position.x.is_finite()))
    );
}
