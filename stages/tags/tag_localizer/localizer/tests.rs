use super::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

const TAG: Point2 = Point2::new(1.2, 1.1);

fn position(x: f64, y: f64) -> Position {
    Position::new(Point2::new(x, y))
}

fn at(seconds: f64) -> LogTime {
    LogTime(1_000_000_000).plus_seconds(seconds)
}

/// Drives along the path and reads the tag ten times a second with noise; a share of readings are uniform outliers.
fn locate(parameters: TagLocalizerParameters, outliers: f64, path: impl Iterator<Item = (f64, f64)>) -> TagMode {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let noise = Normal::new(0.0, 0.05).unwrap();
    let mut localizer = TagLocalizer::new(parameters);
    for (step, (x, y)) in path.enumerate() {
        let time = at(0.1 * step as f64);
        assert!(localizer.add_pose(time, position(x, y), |problem| panic!("{problem}")));
        let range = match random.random::<f64>() < outliers {
            true => 0.1 + 2.8 * random.random::<f64>(),
            false => (TAG - Point2::new(x, y)).norm() + noise.sample(&mut random),
        };
        localizer.add_reading(time, "tag", range, 0.05).unwrap();
    }
    assert!(localizer.read_out_all());
    *localizer.modes().next().unwrap().1
}

/// Two metres along one side of the tag, then two along another.
fn corner() -> impl Iterator<Item = (f64, f64)> {
    (0..190).map(|step| 0.021 * f64::from(step)).map(|way| if way < 2.0 { (way, 0.0) } else { (2.0, way - 2.0) })
}

#[test]
fn the_position_from_noisy_readings_is_within_its_covariance() {
    let mode = locate(TagLocalizerParameters::default(), 0.0, corner());
    let error = mode.position - TAG;
    let squared = error.dot(&(mode.covariance.try_inverse().unwrap() * error));
    assert!(mode.certainty > 0.9 && squared < 9.0, "{mode:?} {squared}");
}

#[test]
fn ranges_at_poses_without_a_heading_locate_a_tag_where_odometry_may_drift() {
    let parameters = TagLocalizerParameters { drift: true, ..TagLocalizerParameters::default() };
    let mut localizer = TagLocalizer::new(parameters);
    for (step, (x, y)) in corner().enumerate() {
        let (time, without) = (at(0.1 * step as f64), Position { yaw: f64::NAN, ..position(x, y) });
        assert!(localizer.add_pose(time, without, |problem| panic!("{problem}")));
        localizer.add_reading(time, "tag", (TAG - Point2::new(x, y)).norm(), 0.05).unwrap();
    }
    assert!(localizer.read_out_all() && localizer.take_estimated_poses().is_empty());
    let mode = *localizer.modes().next().unwrap().1;
    assert!((mode.position - TAG).norm() < 0.05, "{mode:?}");
}

#[test]
fn far_from_the_origin_nothing_is_lost() {
    let near = locate(TagLocalizerParameters::default(), 0.0, corner());
    let mut localizer = TagLocalizer::new(TagLocalizerParameters::default());
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let noise = Normal::new(0.0, 0.05).unwrap();
    for (step, (x, y)) in corner().enumerate() {
        let time = at(0.1 * step as f64);
        localizer.add_pose(time, position(x + 5e5, y - 4e6), |problem| panic!("{problem}"));
        let _outlier: f64 = random.random();
        let range = (TAG - Point2::new(x, y)).norm() + noise.sample(&mut random);
        localizer.add_reading(time, "tag", range, 0.05).unwrap();
    }
    localizer.read_out_all();
    let far = *localizer.modes().next().unwrap().1;
    assert!((far.position.coords - near.position.coords - nalgebra::Vector2::new(5e5, -4e6)).norm() < 1e-4);
    assert!((far.covariance - near.covariance).norm() < 1e-6);
}

#[test]
fn a_reading_between_two_poses_waits_for_the_second() {
    let mut localizer = TagLocalizer::new(TagLocalizerParameters { min_readings: 1, ..Default::default() });
    let ignore = |_| ();
    localizer.add_pose(at(0.0), position(0.0, 0.0), ignore);
    localizer.add_reading(at(0.25), "tag", 1.0, 0.05).unwrap();
    assert!(!localizer.read_out_all(), "it has no position yet");
    localizer.add_pose(at(0.5), position(1.0, 0.0), ignore);
    assert_eq!(localizer.tags["tag"].first_place, Point2::new(0.5, 0.0));
    assert!(localizer.read_out_all());
}

/// Drives past the tag, and sees it with noise in the frame of the robot, which turns; also reads ranges if `ranges`.
fn look(ranges: bool, wrong: usize) -> TagMode {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let noise = Normal::new(0.0, 0.1).unwrap();
    let mut localizer = TagLocalizer::new(TagLocalizerParameters::default());
    for step in 0..30 {
        let (time, yaw) = (at(0.1 * f64::from(step)), 0.3 * f64::from(step));
        let place = Point2::new(0.1 * f64::from(step), 0.0);
        localizer.add_pose(time, Position { yaw, ..Position::new(place) }, |problem| panic!("{problem}"));
        let mut seen = Rotation2::new(-yaw) * (TAG - place);
        seen += Vector2::new(noise.sample(&mut random), noise.sample(&mut random));
        if (step as usize) < wrong {
            seen = Vector2::new(2.0, -2.0);
        }
        localizer.add_sighting(time, "tag", seen, &Matrix2::zeros()).unwrap();
        if ranges {
            localizer.add_reading(time, "tag", (TAG - place).norm() + noise.sample(&mut random), 0.1).unwrap();
        }
    }
    assert!(localizer.read_out_all());
    let (_, mode, readings) = localizer.modes().next().unwrap();
    assert_eq!(readings, if ranges { 60 } else { 30 });
    *mode
}

#[test]
fn a_tag_that_is_seen_is_where_it_is_and_a_straight_drive_leaves_no_mirror_image() {
    let (seen, both) = (look(false, 0), look(true, 0));
    for mode in [&seen, &both] {
        let error = mode.position - TAG;
        let squared = error.dot(&(mode.covariance.try_inverse().unwrap() * error));
        assert!(mode.certainty > 0.8 && squared < 9.0, "{mode:?}");
    }
    assert!(both.covariance.trace() < seen.covariance.trace(), "what is heard adds to what is seen");
}

#[test]
fn wrong_sightings_do_no_harm() {
    let mode = look(false, 5);
    assert!((mode.position - TAG).norm() < 0.1, "{mode:?}");
}

#[test]
fn an_invalid_sighting_is_reported() {
    let mut localizer = TagLocalizer::new(TagLocalizerParameters::default());
    let mut add = |id: &str, x: f64| localizer.add_sighting(at(0.0), id, Vector2::new(x, 0.0), &Matrix2::zeros());
    assert_eq!(add("", 1.0), Err(ReadingProblem::NoId));
    for x in [f64::NAN, f64::INFINITY, 1e200] {
        assert_eq!(add("tag", x), Err(ReadingProblem::NoPosition));
    }
    let odd = Matrix2::new(f64::NAN, 0.0, 0.0, -1.0);
    assert_eq!(localizer.add_sighting(at(0.0), "tag", Vector2::zeros(), &odd), Ok(()));
}

/// Drives past the tag, and reads its bearing, on a path from 0.2 m ahead of its middle; a share of the bearings are
/// uniform outliers.
fn take_bearings(tag: Point2, outliers: f64, ranges: bool, way: f64) -> Option<TagMode> {
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let noise = Normal::new(0.0, 0.05).unwrap();
    let mut localizer = TagLocalizer::new(TagLocalizerParameters::default());
    // A sensor that turns with the robot measures from several positions.
    let sensor = Vector2::new(if way > 0.0 { 0.2 } else { 0.0 }, 0.0);
    for step in 0..60 {
        let (time, yaw) = (at(0.1 * f64::from(step)), 0.3 * f64::from(step));
        let place = Point2::new(way / 60.0 * f64::from(step), 0.0);
        localizer.add_pose(time, Position { yaw, ..Position::new(place) }, |problem| panic!("{problem}"));
        let seen = Rotation2::new(-yaw) * (tag - place) - sensor;
        let turn = match random.random::<f64>() < outliers {
            true => 2.0 * PI * random.random::<f64>(),
            false => noise.sample(&mut random),
        };
        localizer.add_bearing(time, "tag", sensor, seen.y.atan2(seen.x) + turn, 0.05).unwrap();
        if ranges {
            localizer.add_reading(time, "tag", (tag - place).norm() + noise.sample(&mut random), 0.05).unwrap();
        }
    }
    localizer.read_out_all();
    localizer.modes().next().map(|(_, mode, _)| *mode)
}

#[test]
fn bearings_alone_locate_a_tag_and_a_straight_drive_leaves_no_mirror_image() {
    // The second is beyond the grid of the first position.
    for tag in [TAG, Point2::new(2.0, 6.0)] {
        let mode = take_bearings(tag, 0.0, false, 4.0).unwrap();
        let error = mode.position - tag;
        let squared = error.dot(&(mode.covariance.try_inverse().unwrap() * error));
        assert!(mode.certainty > 0.4 && squared < 9.0, "{tag}: {mode:?} {squared}");
    }
    let near = take_bearings(TAG, 0.0, false, 4.0).unwrap();
    assert!(near.certainty > 0.9, "{near:?}");
    let both = take_bearings(TAG, 0.0, true, 4.0).unwrap();
    assert!(both.covariance.trace() < near.covariance.trace() && both.certainty > 0.9, "{both:?} {near:?}");
}

#[test]
fn a_fifth_of_wrong_bearings_does_no_harm() {
    let mode = take_bearings(TAG, 0.2, false, 4.0).unwrap();
    assert!((mode.position - TAG).norm() < 0.1 && mode.certainty > 0.75, "{mode:?}");
}

#[test]
fn bearings_from_one_position_determine_no_position_of_the_tag() {
    let mode = take_bearings(TAG, 0.0, false, 0.0);
    assert!(mode.is_none_or(|mode| mode.certainty < 0.3), "{mode:?}");
}

#[test]
fn an_invalid_bearing_is_reported() {
    let mut localizer = TagLocalizer::new(TagLocalizerParameters { min_readings: 1, ..Default::default() });
    localizer.add_pose(at(0.0), position(0.0, 0.0), |_| ());
    let mut add = |id: &str, x: f64, bearing: f64, stddev: f64| {
        localizer.add_bearing(at(0.0), id, Vector2::new(x, 0.0), bearing, stddev)
    };
    assert_eq!(add("", 0.0, 1.0, 0.1), Err(ReadingProblem::NoId));
    for (x, bearing) in [(f64::NAN, 1.0), (1e200, 1.0), (0.0, f64::NAN), (0.0, f64::INFINITY)] {
        assert_eq!(add("tag", x, bearing, 0.1), Err(ReadingProblem::NoBearing));
    }
    for stddev in [f64::NAN, -1.0, 0.0, f64::INFINITY, 1e300] {
        assert_eq!(add("tag", 0.0, 1e6, stddev), Ok(()));
    }
    localizer.read_out_all();
    assert!(localizer.modes().all(|(_, mode, _)| mode.covariance.iter().all(|value| value.is_finite())));
}

#[test]
fn a_first_bearing_from_beyond_the_reach_does_not_set_where_the_tag_is_searched() {
    let mut random = ChaCha8Rng::seed_from_u64(17);
    let noise = Normal::new(0.0, 0.05).unwrap();
    let mut localizer = TagLocalizer::new(TagLocalizerParameters::default());
    let tag = Point2::new(20.0, 1.5);
    for step in 0..200 {
        let (time, place) = (at(0.1 * f64::from(step)), Point2::new(0.12 * f64::from(step), 0.0));
        localizer.add_pose(time, Position::new(place), |problem| panic!("{problem}"));
        let offset = tag - place;
        let bearing = offset.y.atan2(offset.x) + noise.sample(&mut random);
        localizer.add_bearing(time, "tag", Vector2::zeros(), bearing, 0.05).unwrap();
        if offset.norm() < 3.0 {
            localizer.add_reading(time, "tag", offset.norm() + noise.sample(&mut random), 0.05).unwrap();
        }
    }
    localizer.read_out_all();
    let (_, mode, _) = localizer.modes().next().unwrap();
    assert!((mode.position - tag).norm() < 0.15 && mode.certainty > 0.75, "{mode:?}");
}

#[test]
fn tags_most_of_whose_ranges_are_beyond_the_reach_are_of_long_range() {
    let noise = Normal::new(0.0, 0.1).unwrap();
    let tags = [Point2::new(-10.0, 4.0), Point2::new(15.0, 9.0)];
    for echo in [false, true] {
        let mut random = ChaCha8Rng::seed_from_u64(19);
        let mut localizer = TagLocalizer::new(TagLocalizerParameters::default());
        for step in 0..240 {
            let (time, angle) = (at(0.1 * f64::from(step)), 0.03 * f64::from(step));
            let place = Point2::new(6.0 * angle.cos(), 6.0 * angle.sin());
            localizer.add_pose(time, Position::new(place), |problem| panic!("{problem}"));
            for (tag, id) in tags.iter().zip(["a", "b"]) {
                let wrong = if echo && step % 10 == 3 { 40.0 } else { 0.0 };
                let range = (tag - place).norm() + noise.sample(&mut random) + wrong;
                localizer.add_reading(time, id, range, 0.1).unwrap();
            }
        }
        localizer.read_out_all();
        assert_eq!((localizer.modes().count(), localizer.too_far()), (2, 0));
        for ((_, mode, readings), tag) in localizer.modes().zip(tags) {
            assert!((mode.position - tag).norm() < 0.4 && mode.certainty > 0.9, "{mode:?}");
            assert_eq!(readings, 240);
        }
    }
}

#[test]
fn echoes_from_beyond_the_reach_are_counted_and_change_nothing() {
    let estimate = |echoes: bool| {
        let mut localizer = TagLocalizer::new(TagLocalizerParameters::default());
        for (step, (x, y)) in corner().enumerate() {
            let time = at(0.1 * step as f64);
            localizer.add_pose(time, position(x, y), |problem| panic!("{problem}"));
            if echoes && step % 20 == 10 {
                localizer.add_reading(time, "tag", 25.0, 0.05).unwrap();
            }
            localizer.add_reading(time, "tag", (TAG - Point2::new(x, y)).norm(), 0.05).unwrap();
        }
        localizer.read_out_all();
        (*localizer.modes().next().unwrap().1, localizer.too_far())
    };
    let ((without, none), (with, some)) = (estimate(false), estimate(true));
    assert_eq!((without, none), (with, 0));
    assert!(some > 5, "{some}");
}
