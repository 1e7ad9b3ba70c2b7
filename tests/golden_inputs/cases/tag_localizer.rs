//! Inputs of `tag_localizer`: drives past tags.

use super::Case;
use gridweave_runtime::ros::{Pose, PoseStamped, PoseWithCovarianceStamped, TagBearing, TagPosition, TagRange};
use gridweave_stages::shared::geometry::{Point2, pose};
use gridweave_tests::{LogBuilder, header};
use nalgebra::Vector2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use std::f64::consts::TAU;

/// Standard deviation of a reading, metres: the paper's.
const NOISE: f64 = 0.05;
/// The reach of a tag, metres: the paper's.
const REACH: f64 = 3.0;
/// Seconds between two poses.
const TICK: f64 = 0.1;
/// Where a tag is, metres: in the middle of a block of the paper's grid about the origin, 3 x 3 cells of 0.02 m.
const TAG: Point2 = Point2::new(1.23, 1.05);
/// On the border of two blocks.
const TAG_ON_BORDER: Point2 = Point2::new(1.2, 1.05);

pub(super) fn cases() -> Vec<Case> {
    let case = |name, write| Case::new("tag_localizer", name, write);
    vec![
        case("straight_drive", |log| Drive::past("tag", TAG).along(log, "robot1", line(100))),
        case("curved_drive", |log| Drive::past("tag", TAG).along(log, "robot1", circle(100))),
        case("paper", |log| Drive::past("tag", TAG).along(log, "robot1", circle(100))),
        case("blocks_middle", |log| Drive::exact("tag", TAG).along(log, "robot1", circle(100))),
        case("blocks_border", |log| Drive::exact("tag", TAG_ON_BORDER).along(log, "robot1", circle(100))),
        case("window_border", |log| Drive::exact("tag", TAG_ON_BORDER).along(log, "robot1", circle(100))),
        case("standing_still", |log| {
            Drive::past("tag", TAG).along(log, "robot1", (0..100).map(|_| Point2::origin()));
        }),
        case("outliers", |log| {
            Drive { outliers: 0.2, ..Drive::past("tag", TAG) }.along(log, "robot1", circle(150));
        }),
        case("uncertain_poses", |log| {
            Drive { deviation: 0.3, ..Drive::past("tag", TAG) }.along(log, "robot1", circle(100));
        }),
        case("out_of_reach", out_of_reach),
        case("before_the_first_pose", before_the_first_pose),
        case("poses_missing", poses_missing),
        case("few_readings", |log| Drive::past("tag", TAG).along(log, "robot1", circle(100).take(4))),
        case("no_readings", no_readings),
        case("seen_by_a_camera", seen_by_a_camera),
        case("bearings_alone", bearings_alone),
    ]
}

/// Three centimetres a tick along the x axis.
fn line(ticks: u32) -> impl Iterator<Item = Point2> {
    (0..ticks).map(|tick| Point2::new(0.03 * f64::from(tick), 0.0))
}

/// Once round a circle of 0.8 m that begins at the origin.
fn circle(ticks: u32) -> impl Iterator<Item = Point2> {
    (0..ticks).map(move |tick| {
        let angle = TAU * f64::from(tick) / f64::from(ticks);
        Point2::new(0.8 - 0.8 * angle.cos(), 0.8 * angle.sin())
    })
}

/// How a robot reads tags as it drives.
struct Drive {
    tags: Vec<(&'static str, Point2)>,
    /// Standard deviation of a reading, metres.
    noise: f64,
    /// Share of the readings that say any range.
    outliers: f64,
    /// What the poses claim to be known to, metres; 0 if they claim nothing.
    deviation: f64,
    /// When it begins, seconds.
    start: f64,
}

impl Drive {
    fn past(id: &'static str, place: Point2) -> Self {
        Self { tags: vec![(id, place)], noise: NOISE, outliers: 0.0, deviation: 0.0, start: 1.0 }
    }

    /// The same without noise.
    fn exact(id: &'static str, place: Point2) -> Self {
        Self { noise: 0.0, ..Self::past(id, place) }
    }

    /// A pose and a reading of every tag in reach, ten times a second.
    fn along(&self, log: &mut LogBuilder, robot: &str, path: impl Iterator<Item = Point2>) {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let noise = Normal::new(0.0, self.noise).unwrap();
        for (tick, place) in path.enumerate() {
            let seconds = self.start + TICK * tick as f64;
            log.uncertain_pose(seconds, robot, place.x, place.y, self.deviation);
            for (id, tag) in &self.tags {
                let is_outlier = random.random::<f64>() < self.outliers;
                let (any, error) = (0.1 + 2.8 * random.random::<f64>(), noise.sample(&mut random));
                let range = (tag - place).norm() + error;
                if range < REACH {
                    log.reading(seconds, robot, id, if is_outlier { any } else { range });
                }
            }
        }
    }
}

/// Past two tags, the first of which gets out of reach on the way; and a second robot, whose map is its own.
fn out_of_reach(log: &mut LogBuilder) {
    let corner = (0..160).map(|tick| 0.05 * f64::from(tick));
    let corner = corner.map(|way| if way < 2.0 { Point2::new(way, 0.0) } else { Point2::new(2.0, way - 2.0) });
    let drive = Drive { tags: vec![("first", TAG), ("second", Point2::new(3.1, 6.4))], ..Drive::past("", TAG) };
    drive.along(log, "robot1", corner);
    Drive { start: 20.0, ..Drive::past("first", Point2::new(-0.4, 1.3)) }.along(log, "robot2", circle(60));
}

/// Readings from the start, and poses from a second later.
fn before_the_first_pose(log: &mut LogBuilder) {
    for tick in 0..10 {
        log.reading(TICK * f64::from(tick), "robot1", "tag", 1.0);
    }
    Drive::past("tag", TAG).along(log, "robot1", circle(100));
}

/// Readings half way between two poses, for two seconds without a pose, and after the last one.
fn poses_missing(log: &mut LogBuilder) {
    for (tick, place) in circle(100).enumerate() {
        let seconds = 1.0 + TICK * tick as f64;
        if !(40..60).contains(&tick) && tick % 2 == 0 && tick < 98 {
            log.uncertain_pose(seconds, "robot1", place.x, place.y, 0.0);
        }
        log.reading(seconds, "robot1", "tag", (TAG - place).norm());
    }
}

/// Readings and poses that are none, among good ones.
fn no_readings(log: &mut LogBuilder) {
    let reading = |seconds, tag_id: &str, range, range_stddev| TagRange {
        header: header(seconds, "robot1/base_link"),
        tag_id: tag_id.into(),
        range,
        range_stddev,
        rssi: -50.0,
    };
    let pose_in = |seconds, frame: &str, x| {
        let (header, pose) = (header(seconds, frame), Pose::from(pose(x, 0.0, 0.0)));
        PoseWithCovarianceStamped::from(PoseStamped { header, pose })
    };
    Drive::past("tag", TAG).along(log, "robot1", circle(60));
    let (poses, readings) = ("/robot1/pose", "/robot1/tag_ranges");
    for (tick, range) in [f64::NAN, f64::INFINITY, 0.0, -1.0, 4.0].into_iter().enumerate() {
        let seconds = 7.1 + 0.01 * tick as f64;
        log.message(seconds, readings, &reading(seconds, "tag", range, NOISE));
    }
    log.message(7.2, readings, &reading(7.2, "", 1.0, NOISE));
    log.raw(7.3, readings, "gridweave_msgs/msg/TagRange", &[0, 1, 0, 0, 9]);
    log.message(7.4, poses, &pose_in(7.4, "robot1/map", f64::NAN));
    log.message(7.5, poses, &pose_in(7.5, "robot1/odom", 0.0));
    log.message(7.6, poses, &pose_in(6.0, "robot1/map", 0.0));
    // A standard deviation that is none is replaced.
    log.uncertain_pose(7.65, "robot1", 0.0, 0.0, 0.0);
    for (tick, stddev) in [f64::NAN, -1.0, 0.0, 1e9].into_iter().enumerate() {
        let seconds = 7.7 + 0.01 * tick as f64;
        log.message(seconds, readings, &reading(seconds, "tag", (TAG.coords).norm(), stddev));
    }
    log.uncertain_pose(7.8, "robot1", 0.0, 0.0, 0.0);
}

/// A straight drive past a tag that a camera sees, with an error that goes round; at the end its range is also
/// measured.
fn seen_by_a_camera(log: &mut LogBuilder) {
    for (step, place) in line(60).enumerate() {
        let seconds = 0.1 * step as f64;
        log.uncertain_pose(seconds, "robot1", place.x, place.y, 0.0);
        let error = Vector2::new((0.7 * step as f64).cos(), (0.7 * step as f64).sin()) * 0.05;
        let seen = TAG - place + error;
        let header = header(seconds, "robot1/base_link");
        let position = TagPosition { header, tag_id: "tag".into(), x: seen.x, y: seen.y, covariance: [0.0; 4] };
        log.message(seconds, "/robot1/tag_positions", &position);
        if step >= 40 {
            log.reading(seconds, "robot1", "tag", (TAG - place).norm());
        }
    }
    let header = header(6.0, "robot1/base_link");
    let nowhere = TagPosition { header, tag_id: "tag".into(), x: f64::NAN, y: 0.0, covariance: [0.0; 4] };
    log.message(6.0, "/robot1/tag_positions", &nowhere);
}

/// A straight drive past a tag whose direction is perceived from half a metre ahead, with an error that goes round; one
/// direction is wrong, and one is no number. Another tag is measured once.
fn bearings_alone(log: &mut LogBuilder) {
    for (step, place) in line(60).enumerate() {
        let seconds = 0.1 * step as f64;
        log.uncertain_pose(seconds, "robot1", place.x, place.y, 0.0);
        let seen = TAG - place - Vector2::new(0.5, 0.0);
        let bearing = match step {
            20 => -2.0,
            30 => f64::NAN,
            _ => seen.y.atan2(seen.x) + 0.05 * (0.7 * step as f64).cos(),
        };
        let header = header(seconds, "robot1/base_link");
        let bearing = TagBearing { header, tag_id: "tag".into(), x: 0.5, y: 0.0, bearing, bearing_stddev: 0.05 };
        log.message(seconds, "/robot1/tag_bearings", &bearing);
    }
    // Of another tag, and too few to report it.
    log.reading(6.0, "robot1", "heard", 1.0);
}
