//! Inputs of `tag_filter`: what two robots or three know of tags.

use super::Case;
use gridweave_runtime::ros::{TagEstimate, TagEstimates};
use gridweave_stages::shared::geometry::{Point2, Pose2, pose};
use gridweave_tests::{LogBuilder, header};

/// Places in the building, metres.
const PLACES: [(f64, f64); 6] = [(0.0, 0.0), (5.0, 1.0), (9.0, -2.0), (3.0, 7.0), (-4.0, 6.0), (-8.0, -1.0)];

pub(super) fn cases() -> Vec<Case> {
    let case = |name, write| Case::new("tag_filter", name, write);
    vec![
        case("table_3", table_3),
        case("no_common_tag", |log| {
            robots(log, &tags(&PLACES), &renamed(&tags(&PLACES), "other"));
        }),
        case("one_tag", |log| robots(log, &tags(&PLACES), &tags(&PLACES[..1]))),
        case("two_tags", |log| robots(log, &tags(&PLACES), &tags(&PLACES[..2]))),
        case("one_moved", |log| {
            let mut moved = tags(&PLACES);
            moved[2].x += 1.46;
            robots(log, &tags(&PLACES), &moved);
        }),
        case("stretched_map", |log| {
            // The second robot takes each metre for 1.03 m.
            let wide = |by: f64| tags(&PLACES.map(|(x, y)| (3.0 * by * x, 3.0 * by * y)));
            robots(log, &wide(1.0), &wide(1.03));
        }),
        case("two_buildings", |log| {
            let elsewhere = [(3.0, 1.0), (-6.0, 2.0), (0.5, -7.0), (8.0, 8.0), (-1.0, 4.0), (2.0, -3.0)];
            robots(log, &tags(&PLACES), &tags(&elsewhere));
        }),
        case("mirrored", |log| robots(log, &tags(&PLACES), &tags(&PLACES.map(|(x, y)| (x, -y))))),
        case("near_each_other", |log| {
            let cluster = tags(&[(0.0, 0.0), (0.1, 0.0), (0.0, 0.1), (0.1, 0.1)]);
            robots(log, &cluster, &cluster);
        }),
        case("two_transforms", |log| {
            // The first tag lies where the second half turns about: it is on both.
            let turned = moved(&tags(&PLACES[..5]), &pose(0.0, 0.0, 2.0));
            let half = [&tags(&PLACES[..3])[..], &turned[3..]].concat();
            robots(log, &tags(&PLACES[..5]), &half);
        }),
        case("certainties_at_the_limits", certainties_at_the_limits),
        case("none_certain_enough", |log| {
            let doubtful = with_certainty(&tags(&PLACES), &[0.89; 6]);
            robots(log, &tags(&PLACES), &doubtful);
        }),
        case("not_a_number", not_a_number),
        case("without_a_robot", without_a_robot),
        case("three_robots", |log| {
            robots(log, &tags(&PLACES), &tags(&PLACES));
            send(log, 3.0, "robot3", &moved(&tags(&PLACES[..2]), &pose(-2.0, 5.0, 2.5)));
        }),
        case("small_changes", small_changes),
    ]
}

/// Tags with certainty 0.95, `tag0`, `tag1`, ...
fn tags(places: &[(f64, f64)]) -> Vec<TagEstimate> {
    let tag = |(index, &(x, y)): (usize, &(f64, f64))| TagEstimate {
        tag_id: format!("tag{index}"),
        x,
        y,
        covariance: [4e-4, 0.0, 0.0, 4e-4],
        certainty: 0.95,
        readings: 50,
    };
    places.iter().enumerate().map(tag).collect()
}

fn with_certainty(tags: &[TagEstimate], certainties: &[f64]) -> Vec<TagEstimate> {
    tags.iter().zip(certainties).map(|(tag, &certainty)| TagEstimate { certainty, ..tag.clone() }).collect()
}

fn renamed(tags: &[TagEstimate], prefix: &str) -> Vec<TagEstimate> {
    tags.iter().map(|tag| TagEstimate { tag_id: format!("{prefix} {}", tag.tag_id), ..tag.clone() }).collect()
}

fn moved(tags: &[TagEstimate], transform: &Pose2) -> Vec<TagEstimate> {
    let moved = |tag: &TagEstimate| {
        let place = transform * Point2::new(tag.x, tag.y);
        TagEstimate { x: place.x, y: place.y, ..tag.clone() }
    };
    tags.iter().map(moved).collect()
}

fn send(log: &mut LogBuilder, seconds: f64, robot: &str, tags: &[TagEstimate]) {
    let header = header(seconds, format!("{robot}/map"));
    let estimates = TagEstimates { header, robot: robot.into(), tags: tags.to_vec() };
    log.message(seconds, &format!("/{robot}/tags/estimates"), &estimates);
}

/// Two robots, the second with a map frame of its own. The tags are given in the frame of the first.
fn robots(log: &mut LogBuilder, first: &[TagEstimate], second: &[TagEstimate]) {
    send(log, 1.0, "robot1", first);
    send(log, 2.0, "robot2", &moved(second, &pose(3.0, -2.0, 0.5).inverse()));
}

/// Table 3: tags 5, 7 and 9 in the order of their ids.
fn table_3(log: &mut LogBuilder) {
    let mut tags = tags(&[(3.0, 1.0), (14.0, 7.0), (6.0, 12.0)]);
    for (tag, id) in tags.iter_mut().zip(["5", "7", "9"]) {
        tag.tag_id = id.into();
    }
    robots(log, &with_certainty(&tags, &[0.82, 0.99, 0.91]), &with_certainty(&tags, &[0.92, 0.76, 0.92]));
}

fn certainties_at_the_limits(log: &mut LogBuilder) {
    let first = with_certainty(&tags(&PLACES), &[0.90, 0.75, 0.749, 0.95, 0.80, 0.95]);
    let second = with_certainty(&tags(&PLACES), &[0.90, 0.95, 0.95, 0.75, 0.80, 0.70]);
    robots(log, &first, &second);
}

fn not_a_number(log: &mut LogBuilder) {
    let good = TagEstimate { x: 1.0, y: 2.0, ..tags(&PLACES)[0].clone() };
    let bad = [
        TagEstimate { tag_id: "x".into(), x: f64::NAN, ..good.clone() },
        TagEstimate { tag_id: "y".into(), y: f64::INFINITY, ..good.clone() },
        TagEstimate { tag_id: "certainty".into(), certainty: f64::NAN, ..good.clone() },
        TagEstimate { tag_id: "variance".into(), covariance: [f64::NAN, 0.0, 0.0, 4e-4], ..good.clone() },
        TagEstimate { tag_id: "negative variance".into(), covariance: [4e-4, 0.0, 0.0, -4e-4], ..good.clone() },
        TagEstimate { tag_id: String::new(), ..good.clone() },
    ];
    let also_good = bad.each_ref().map(|tag| TagEstimate { tag_id: tag.tag_id.clone(), ..good.clone() });
    let with = |more: &[TagEstimate]| [&tags(&PLACES[..4])[..], more].concat();
    robots(log, &with(&bad), &with(&also_good[..5]));
}

/// A robot that is named only by the topic, and estimates without the name of a robot.
fn without_a_robot(log: &mut LogBuilder) {
    let estimates = |seconds, frame_id: &str| {
        let header = header(seconds, frame_id);
        TagEstimates { header, robot: String::new(), tags: tags(&PLACES) }
    };
    send(log, 1.0, "robot1", &tags(&PLACES));
    log.message(2.0, "/robot2/tags/estimates", &estimates(2.0, "robot2/map"));
    log.message(3.0, "/tags/estimates", &estimates(3.0, "map"));
}

/// Moves below `min_change`, which wait, and above it; the last waits for the end.
fn small_changes(log: &mut LogBuilder) {
    let mut tags = tags(&PLACES);
    send(log, 1.0, "robot1", &tags);
    for (seconds, tag, metres) in [(2.0, 0, 0.0), (3.0, 0, 0.01), (4.0, 1, 0.03), (5.0, 0, 0.01)] {
        tags[tag].x += metres;
        send(log, seconds, "robot2", &tags);
    }
}
