//! Tests of whether common tags suffice.

use super::{RobotTags, TagFilterParameters, TagJudgement, judge};
use crate::shared::geometry::{Point2, Pose2, pose};
use gridweave_runtime::ros::TagEstimate;

const SHAPE: [(f64, f64); 6] = [(0.0, 0.0), (5.0, 1.0), (9.0, -2.0), (3.0, 7.0), (-4.0, 6.0), (-8.0, -1.0)];

fn tags(transform: &Pose2, places: &[(f64, f64)]) -> Vec<TagEstimate> {
    let tag = |(index, &(x, y)): (usize, &(f64, f64))| {
        let place = transform * Point2::new(x, y);
        TagEstimate {
            tag_id: format!("tag{index}"),
            x: place.x,
            y: place.y,
            covariance: [4e-4, 0.0, 0.0, 4e-4],
            certainty: 0.95,
            readings: 50,
        }
    };
    places.iter().enumerate().map(tag).collect()
}

fn judged(a: &[TagEstimate], b: &[TagEstimate]) -> TagJudgement {
    let robot = |robot, tags| RobotTags { robot, tags };
    judge(robot("robot1", a), robot("robot2", b), &TagFilterParameters::default())
}

fn refused(a: &[TagEstimate], b: &[TagEstimate], part: &str) {
    let judgement = judged(a, b);
    assert!(!judgement.accepted && judgement.fit.is_none(), "{judgement:?}");
    assert!(judgement.reason.contains(part), "{}", judgement.reason);
}

/// Tags in a deformed map: the west is displaced to the south and the east to the north.
fn deformed(most: f64) -> Vec<TagEstimate> {
    let wide = SHAPE.map(|(x, y)| (3.0 * x, 3.0 * y));
    let mut tags = tags(&pose(-4.0, 0.0, 1.0), &wide);
    for (tag, (x, _)) in tags.iter_mut().zip(wide) {
        tag.y += most * (x / 12.0).sin();
        tag.x += most * (x / 9.0).cos();
    }
    tags
}

#[test]
fn tags_in_deformed_maps_agree_within_drift() {
    let a = tags(&pose(1.0, 2.0, 3.0), &SHAPE.map(|(x, y)| (3.0 * x, 3.0 * y)));
    let judgement = judged(&a, &deformed(0.4));
    assert!(judgement.accepted && judgement.tags.len() >= 5, "{judgement:?}");
    let far = judgement.tags.iter().map(|tag| tag.covariance_b[0]).fold(0.0, f64::max);
    assert!(far > 0.03, "the uncertainty grows with the distance from the centroid: {far}");
    refused(&a, &deformed(3.0), "the same ids");
    let rigid = TagFilterParameters { map_drift: 0.0, ..Default::default() };
    let robot = |robot, tags| RobotTags { robot, tags };
    assert!(!judge(robot("robot1", &a), robot("robot2", &deformed(0.4)), &rigid).accepted);
}

#[test]
fn too_few_certain_tags_are_refused() {
    let a = tags(&pose(1.0, 2.0, 0.0), &SHAPE);
    let mut b = a.clone();
    b[1..].iter_mut().for_each(|tag| tag.certainty = 0.5);
    refused(&a, &b, "have 6 tags in common, of which 1 has a certainty of 0.75 in both maps (tag0); 2 are needed");
    let mut b = a.clone();
    b.iter_mut().for_each(|tag| tag.certainty = 0.89);
    refused(&a, &b, "none has a certainty of 0.90");
}

#[test]
fn the_most_certain_tag_must_be_among_those_that_agree() {
    let a = tags(&pose(1.0, 2.0, 0.0), &SHAPE);
    let mut b = a.clone();
    b[..5].iter_mut().for_each(|tag| tag.certainty = 0.8);
    b[5].y += 3.0;
    refused(&a, &b, "none of them has a certainty of 0.90");
}

#[test]
fn the_paper_needs_three_tags() {
    let two = tags(&pose(1.0, 2.0, 3.0), &SHAPE[..2]);
    let robot = |robot| RobotTags { robot, tags: &two };
    let parameters = TagFilterParameters { min_tags: 3, ..Default::default() };
    let judgement = judge(robot("robot1"), robot("robot2"), &parameters);
    assert!(!judgement.accepted && judgement.reason.contains("3 are needed"), "{}", judgement.reason);
}

#[test]
fn two_tags_that_are_farther_apart_in_one_map_are_refused() {
    let a = tags(&pose(0.0, 0.0, 0.0), &SHAPE[..2]);
    let mut b = a.clone();
    b[1].x += 0.35;
    refused(&a, &b, "the tags in common (tag0, tag1) are 5.10 m apart in one map and 5.44 m in the other");
    b[1].x += 2.0;
    refused(&a, &b, "the same ids");
}

#[test]
fn two_tags_that_a_third_contradicts_are_refused() {
    let a = tags(&pose(0.0, 0.0, 0.0), &SHAPE[..3]);
    let mut b = a.clone();
    b[2].x += 1.5;
    refused(&a, &b, "2 of the 3 tags in common agree on one transform (tag0, tag1), but as many would agree by chance");
}

#[test]
fn two_tags_near_each_other_are_refused() {
    for (places, part) in [([(0.0, 0.0), (1.0, 0.5)], "they are too near"), ([(0.0, 0.0), (1.8, 0.5)], "by chance")] {
        let tags = tags(&pose(0.0, 0.0, 0.0), &places);
        refused(&tags, &tags, part);
    }
}

#[test]
fn an_agreement_of_three_that_may_be_chance_is_provisional() {
    let close = [(0.0, 0.0), (1.4, 0.2), (0.3, 1.3)];
    let mut tags = tags(&pose(0.0, 0.0, 0.0), &close);
    let judgement = judged(&tags, &tags);
    assert!(judgement.accepted && judgement.provisional, "{judgement:?}");
    assert!(judgement.reason.starts_with("all 3 tags in common agree"), "{}", judgement.reason);
    tags.push(TagEstimate { tag_id: "tag9".into(), x: -1.0, y: 0.5, ..tags[0].clone() });
    let mut b = tags.clone();
    b[3].x = 2.5;
    refused(&tags, &b, "3 of the 4 tags in common agree on one transform (tag0, tag1, tag2), but as many");
}
