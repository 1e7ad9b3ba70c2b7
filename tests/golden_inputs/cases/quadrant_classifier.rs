//! Inputs of `quadrant_classifier`: walls of maps, and the tags that pairs of robots have in common.

use super::Case;
use gridweave_runtime::ros::{CommonTag, CommonTags, Segment, Segments};
use gridweave_stages::shared::geometry::{Point2, Pose2, pose};
use gridweave_tests::{LogBuilder, header};
use std::f64::consts::FRAC_1_SQRT_2;

/// Relative pose of the map of robot2 to that of robot1, where it matters.
const TRUTH: (f64, f64, f64) = (4.0, -2.0, 2.5);

pub(super) fn cases() -> Vec<Case> {
    let case = |name, write| Case::new("quadrant_classifier", name, write);
    vec![
        case("tables_1_and_2", tables_1_and_2),
        case("equation_4", equation_4),
        case("furniture", furniture),
        case("equation_7", equation_7),
        case("equation_7_by_default", equation_7),
        case("corrected_kappa", corrected_kappa),
        case("angles_at_the_wrap", angles_at_the_wrap),
        case("angles_at_the_wrap_groups", angles_at_the_wrap),
        case("one_direction", |log| {
            for (seconds, robot, degrees) in [(1.0, "robot1", 10.0), (2.0, "robot2", -20.0)] {
                send(log, seconds, robot, &[wall(degrees, 8.0, 0.9), wall(degrees, 7.0, 0.8)]);
            }
            let transform = pose(1.0, 2.0, 30_f64.to_radians());
            common(log, 3.0, "robot1", "robot2", &noisy_tags(&transform));
        }),
        case("no_segments", |log| {
            send(log, 1.0, "robot1", &[]);
            send(log, 2.0, "robot2", &room(0.0));
            common(log, 3.0, "robot1", "robot2", &noisy_tags(&truth()));
        }),
        case("round_hall", |log| {
            let hall: Vec<Segment> = (0..60).map(|index| wall(6.0 * f64::from(index), 1.0, 0.9)).collect();
            send(log, 1.0, "robot1", &hall);
            send(log, 2.0, "robot2", &hall);
            common(log, 3.0, "robot1", "robot2", &noisy_tags(&truth()));
        }),
        case("directions_contradict_tags", |log| {
            maps(log, TRUTH.2.to_degrees() + 20.0);
            common(log, 3.0, "robot1", "robot2", &noisy_tags(&truth()));
        }),
        case("no_common_tag", no_common_tag),
        case("method_1", merge),
        case("method_2", merge),
        case("default", merge),
        case("both", merge),
        case("tags_that_tell_nothing", tags_that_tell_nothing),
        case("not_a_number", not_a_number),
        case("sent_again", sent_again),
    ]
}

fn truth() -> Pose2 {
    pose(TRUTH.0, TRUTH.1, TRUTH.2)
}

/// A wall that runs at an angle, degrees.
fn wall(degrees: f64, length: f64, reliability: f64) -> Segment {
    let angle = degrees.to_radians();
    let (x2, y2) = (1.0 + length * angle.cos(), 2.0 + length * angle.sin());
    Segment { x1: 1.0, y1: 2.0, x2, y2, reliability, inliers: (length * 20.0) as u32 }
}

/// The four walls of a room, in one turn round it.
fn room(degrees: f64) -> Vec<Segment> {
    [(0.0, 8.0), (90.0, 5.0), (180.0, 8.0), (270.0, 5.0)].map(|(turn, length)| wall(degrees + turn, length, 1.0)).into()
}

fn send(log: &mut LogBuilder, seconds: f64, robot: &str, segments: &[Segment]) {
    let header = header(seconds, format!("{robot}/map"));
    let segments = Segments { header, robot: robot.into(), segments: segments.to_vec() };
    log.message(seconds, &format!("/{robot}/lines/segments"), &segments);
}

/// The maps of robot1, whose walls run at an angle, and of robot2, whose walls run along the axes.
fn maps(log: &mut LogBuilder, degrees: f64) {
    send(log, 1.0, "robot1", &room(degrees));
    send(log, 2.0, "robot2", &room(0.0));
}

fn tag(index: usize, a: Point2, b: Point2) -> CommonTag {
    let covariance = [0.001, 0.0, 0.0, 0.001];
    CommonTag {
        tag_id: format!("tag{index}"),
        a: a.into(),
        b: b.into(),
        covariance_a: covariance,
        covariance_b: covariance,
        certainty_a: 0.95 - 0.05 * index as f64,
        certainty_b: 0.96,
    }
}

/// Four tags of which the first lies in map a where the transform puts it, and the others some centimetres aside.
fn noisy_tags(transform_a_b: &Pose2) -> Vec<CommonTag> {
    let places = [[1.0, 0.0], [8.0, 2.0], [3.0, 5.0], [6.0, 4.0]];
    let errors = [[0.0, 0.0], [0.06, -0.02], [-0.04, 0.05], [0.01, 0.03]];
    let tags = places.into_iter().zip(errors).enumerate().map(|(index, (place, error))| {
        let b = Point2::from(place);
        tag(index, transform_a_b * b + nalgebra::Vector2::from(error), b)
    });
    tags.collect()
}

fn common(log: &mut LogBuilder, seconds: f64, a: &str, b: &str, tags: &[CommonTag]) {
    let message = CommonTags {
        header: header(seconds, format!("{a}/map")),
        robot_a: a.into(),
        robot_b: b.into(),
        tags: tags.to_vec(),
        accepted: true,
        reason: "all tags in common agree".into(),
        ..Default::default()
    };
    log.message(seconds, "/common_tags/common", &message);
}

/// Tables 1 and 2: once with walls of equal length, and once with lengths that show which wall is in which group.
fn tables_1_and_2(log: &mut LogBuilder) {
    let degrees = [2.0, 90.0, -1.0, -89.0, 179.0, 79.0];
    send(log, 1.0, "equal", &degrees.map(|degrees| wall(degrees, 3.0, 1.0)));
    let by_length = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
    let walls: Vec<Segment> = degrees.iter().zip(by_length).map(|(&angle, length)| wall(angle, length, 1.0)).collect();
    send(log, 2.0, "weighted", &walls);
    refused(log, 3.0, "equal", "weighted");
}

/// Walls whose reliabilities make the printed weights.
fn equation_4(log: &mut LogBuilder) {
    send(log, 1.0, "robot1", &[wall(4.0, 5.0, 0.9), wall(1.0, 10.0, 0.8), wall(95.0, 4.0, 0.5), wall(89.0, 8.0, 1.0)]);
    refused(log, 2.0, "robot1", "robot2");
}

/// Many walls that agree, and two at odd angles.
fn furniture(log: &mut LogBuilder) {
    let mut walls: Vec<Segment> = (0..12).map(|index| wall(12.0 + 90.0 * f64::from(index), 4.0, 0.9)).collect();
    walls.extend([wall(40.0, 15.0, 0.9), wall(35.0, 6.0, 0.9)]);
    send(log, 1.0, "robot1", &walls);
    refused(log, 2.0, "robot1", "robot2");
}

/// Three tags that give a rotation of `theta_hat`: the best two lie at one end, the third 4 m away.
fn tags_with_rotation(cosine: f64, sine: f64) -> Vec<CommonTag> {
    let turned = |x: f64, y: f64| Point2::new(cosine * x - sine * y, sine * x + cosine * y);
    let places = [(0.0, -1.0), (0.0, 1.0), (4.0, 0.0)];
    places.iter().enumerate().map(|(index, &(x, y))| tag(index, turned(x, y), Point2::new(x, y))).collect()
}

/// Maps whose walls all run along the axes, and pairs of robots whose tags give a rotation at the middle of every
/// quadrant, at its borders and near them, and between a printed border and the right one.
fn equation_7(log: &mut LogBuilder) {
    send(log, 0.0, "robot1", &room(0.0));
    let mut seconds = 1.0;
    let mut pair = |name: &str, cosine: f64, sine: f64| {
        send(log, seconds, name, &room(0.0));
        common(log, seconds + 0.5, "robot1", name, &tags_with_rotation(cosine, sine));
        seconds += 1.0;
    };
    for middle in [0, 90, 180, 270] {
        let angle = f64::from(middle).to_radians();
        pair(&format!("theta_hat_{middle}"), angle.cos(), angle.sin());
    }
    for (border, cosine, sine) in [(45, 1.0, 1.0), (135, -1.0, 1.0), (225, -1.0, -1.0), (315, 1.0, -1.0)] {
        for offset in [-1.0, -0.01, 0.0, 0.01, 1.0] {
            let degrees = f64::from(border) + offset;
            let angle = degrees.to_radians();
            match offset == 0.0 {
                // Equal sides make the angle exact.
                true => pair(&format!("theta_hat_{border}"), FRAC_1_SQRT_2 * cosine, FRAC_1_SQRT_2 * sine),
                false => pair(&format!("theta_hat_{degrees}"), angle.cos(), angle.sin()),
            }
        }
    }
    for printed in [220, 310] {
        let angle = f64::from(printed).to_radians();
        pair(&format!("theta_hat_{printed}"), angle.cos(), angle.sin());
    }
}

/// Two maps whose directions differ by 60 degrees, and tags that give each of the four rotations that align them.
fn corrected_kappa(log: &mut LogBuilder) {
    send(log, 0.0, "robot1", &room(30.0));
    for turns in 0..4 {
        let (name, seconds) = (format!("kappa_{turns}"), 1.0 + f64::from(turns));
        send(log, seconds, &name, &room(-30.0));
        let angle = (60.0 + 90.0 * f64::from(turns)).to_radians();
        common(log, seconds + 0.5, "robot1", &name, &noisy_tags(&pose(1.0, 2.0, angle)));
    }
}

/// Directions on both sides of where they are folded, 45 degrees, and rotations on both sides of half a turn.
fn angles_at_the_wrap(log: &mut LogBuilder) {
    let pairs = [(45.1, 44.9, 0.2), (44.9, 45.1, -0.2), (0.1, -0.1, 180.2), (-0.1, 0.1, 179.8), (90.0, 0.0, -180.0)];
    for (index, (degrees_a, degrees_b, rotation)) in pairs.into_iter().enumerate() {
        let (a, b, seconds) = (format!("a{index}"), format!("b{index}"), index as f64);
        send(log, seconds, &a, &room(degrees_a));
        send(log, seconds + 0.1, &b, &room(degrees_b));
        let (sine, cosine) = f64::to_radians(rotation).sin_cos();
        common(log, seconds + 0.2, &a, &b, &tags_with_rotation(cosine, sine));
    }
}

fn no_common_tag(log: &mut LogBuilder) {
    maps(log, 10.0);
    refused(log, 3.0, "robot1", "robot2");
}

/// A pair of robots that the tag filter has refused.
fn refused(log: &mut LogBuilder, seconds: f64, a: &str, b: &str) {
    let refused = CommonTags {
        header: header(seconds, format!("{a}/map")),
        robot_a: a.into(),
        robot_b: b.into(),
        reason: format!("{a} and {b} have no tag in common; {a} knows 4 tags, {b} 0"),
        ..Default::default()
    };
    log.message(seconds, "/common_tags/common", &refused);
}

/// Two maps and the tags that they have in common.
fn merge(log: &mut LogBuilder) {
    maps(log, TRUTH.2.to_degrees());
    common(log, 3.0, "robot1", "robot2", &noisy_tags(&truth()));
}

fn tags_that_tell_nothing(log: &mut LogBuilder) {
    maps(log, 10.0);
    let place = |index| tag(index, Point2::new(1.0, 2.0), Point2::new(3.0, 4.0));
    common(log, 3.0, "robot1", "robot2", &[place(0), place(1), place(2)]);
    let near = |index: usize| tag(index, Point2::new(0.05 * index as f64, 0.0), Point2::new(0.05 * index as f64, 0.0));
    common(log, 4.0, "robot1", "robot2", &[near(0), near(1), near(2)]);
    let mut wrong = noisy_tags(&truth());
    wrong[1].a[0] += 5.0;
    common(log, 5.0, "robot1", "robot2", &wrong);
}

/// Walls and tags with values that are no numbers, a robot paired with itself, and messages cut short.
fn not_a_number(log: &mut LogBuilder) {
    let bad = [
        Segment { x1: f64::NAN, ..wall(33.0, 4.0, 1.0) },
        Segment { y2: f64::INFINITY, ..wall(33.0, 4.0, 1.0) },
        Segment { reliability: f64::NAN, ..wall(33.0, 4.0, 1.0) },
        wall(33.0, 0.0, 1.0),
    ];
    send(log, 1.0, "robot1", &[&bad[..], &room(TRUTH.2.to_degrees())].concat());
    send(log, 2.0, "robot2", &room(0.0));
    let mut tags = noisy_tags(&truth());
    tags.push(CommonTag { a: [f64::NAN, 0.0], ..tag(4, Point2::origin(), Point2::origin()) });
    tags.push(CommonTag { covariance_b: [f64::NAN; 4], ..tag(5, truth() * Point2::origin(), Point2::origin()) });
    common(log, 3.0, "robot1", "robot2", &tags);
    common(log, 4.0, "robot1", "robot1", &tags);
    log.raw(5.0, "/common_tags/common", "gridweave_msgs/msg/CommonTags", &[0, 1, 0, 0, 9]);
    log.raw(6.0, "/robot1/lines/segments", "gridweave_msgs/msg/Segments", &[0, 1, 0, 0, 9]);
}

/// The same tags twice, the same map again, and a map of a robot in no pair.
fn sent_again(log: &mut LogBuilder) {
    merge(log);
    common(log, 4.0, "robot1", "robot2", &noisy_tags(&truth()));
    send(log, 5.0, "robot2", &room(0.0));
    send(log, 6.0, "robot3", &room(0.0));
    common(log, 7.0, "robot1", "robot2", &noisy_tags(&pose(TRUTH.0, TRUTH.1 + 0.1, TRUTH.2)));
}
