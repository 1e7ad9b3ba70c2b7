//! The stage as a whole: messages in, messages out.

use super::kind;
use crate::shared::geometry::{Point2, Pose2, pose};
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{Alignment, CommonTag, CommonTags, Header, Segment, Segments};
use gridweave_runtime::stage::{Context, InputWire, StageHarness};

struct Run(StageHarness);

impl Run {
    fn new(parameters: &str) -> Self {
        Self(StageHarness::new(&kind(), parameters).unwrap())
    }

    /// Sends walls to the stage, and returns the alignments that it sends.
    fn segments(&mut self, segments: &Segments) -> Vec<Alignment> {
        self.0.give::<Segments>("segments", "", LogTime(7), segments).unwrap();
        self.0.take("alignment").unwrap()
    }

    /// Sends common tags to the stage, and returns the alignments that it sends.
    fn common(&mut self, common: &CommonTags) -> Vec<Alignment> {
        self.0.give::<CommonTags>("common", "", LogTime(7), common).unwrap();
        self.0.take("alignment").unwrap()
    }
}

/// A room with walls at `angle`.
fn segments(robot: &str, angle: f64) -> Segments {
    let wall = |(x1, y1, x2, y2): (f64, f64, f64, f64)| {
        let turn = pose(0.0, 0.0, angle);
        let (a, b) = (turn * Point2::new(x1, y1), turn * Point2::new(x2, y2));
        Segment { x1: a.x, y1: a.y, x2: b.x, y2: b.y, reliability: 1.0, inliers: 50 }
    };
    let room = [(0.0, 0.0, 8.0, 0.0), (8.0, 0.0, 8.0, 5.0), (8.0, 5.0, 0.0, 5.0), (0.0, 5.0, 0.0, 0.0)];
    let header = Header { frame_id: format!("{robot}/map"), ..Default::default() };
    Segments { header, robot: robot.into(), segments: room.map(wall).to_vec() }
}

fn common(transform_a_b: &Pose2) -> CommonTags {
    let tag = |(x, y): (f64, f64)| {
        let a = transform_a_b * Point2::new(x, y);
        let covariance = [0.001, 0.0, 0.0, 0.001];
        CommonTag {
            a: [a.x, a.y],
            b: [x, y],
            covariance_a: covariance,
            covariance_b: covariance,
            certainty_a: 0.95,
            certainty_b: 0.9,
            ..Default::default()
        }
    };
    let tags = [(1.0, 0.0), (8.0, 2.0), (3.0, 5.0)].map(tag).to_vec();
    let (robot_a, robot_b) = ("robot1".into(), "robot2".into());
    CommonTags { robot_a, robot_b, tags, accepted: true, ..Default::default() }
}

#[test]
fn walls_may_be_left_unwired_where_the_rotation_is_from_the_tags() {
    let common = InputWire { port: "common", ..Default::default() };
    let context = Context { inputs: vec![common], ..Default::default() };
    let make = |parameters: &str| StageHarness::with_context(&kind(), parameters, &context).err();
    assert!(make("rotation = \"tags\"").is_none());
    for rotation in ["directions", "both"] {
        let error = make(&format!("rotation = \"{rotation}\"")).unwrap().to_string();
        assert!(error.contains("`segments` is not wired"), "{error}");
    }
}

#[test]
fn two_tags_wait_for_both_maps_and_stay_provisional() {
    let mut run = Run::new("");
    let truth = pose(4.0, -2.0, 2.5);
    let all = common(&truth);
    let two = CommonTags { tags: all.tags[..2].to_vec(), provisional: true, ..all.clone() };
    run.segments(&segments("robot1", 2.5));
    let sent = run.common(&two);
    assert!(!sent[0].accepted && sent[0].reason.contains("a map is missing so far"), "{}", sent[0].reason);
    let sent = run.segments(&segments("robot2", 0.0));
    assert_eq!((sent[0].accepted, sent[0].provisional), (true, true));
    assert_eq!(sent[0].method, "few tags+directions");
    assert!(sent[0].reason.starts_with("2 common tags only"), "{}", sent[0].reason);
    let error = sent[0].transform_a_b() * truth.inverse();
    assert!(error.translation.vector.norm() < 1e-6 && error.rotation.angle().abs() < 1e-9);
    let sent = run.common(&all);
    assert_eq!((sent[0].accepted, sent[0].provisional), (true, false), "the third tag suffices");
    let sent = run.segments(&segments("robot2", 0.3));
    assert!(sent[0].accepted, "directions that contradict three tags are left out");
    let sent = run.common(&two);
    assert!(!sent[0].accepted && sent[0].reason.contains("must confirm"), "{}", sent[0].reason);
}

#[test]
fn a_single_tag_proposes_every_quarter_turn_if_it_may() {
    let truth = pose(4.0, -2.0, 2.5);
    let all = common(&truth);
    let one = CommonTags { tags: all.tags[..1].to_vec(), accepted: false, reason: "one tag".into(), ..all };
    let mut run = Run::new("");
    run.segments(&segments("robot1", 2.5));
    run.segments(&segments("robot2", 0.0));
    assert_eq!(run.common(&one)[0].reason, "one tag", "it is not asked for");
    let mut run = Run::new("single_tag = true");
    run.segments(&segments("robot1", 2.5));
    run.segments(&segments("robot2", 0.0));
    let sent = run.common(&one);
    let ranks: Vec<(u32, u32, bool, bool)> =
        sent.iter().map(|one| (one.rank, one.hypotheses, one.accepted, one.provisional)).collect();
    assert_eq!(ranks, [(0, 4, true, true), (1, 4, true, true), (2, 4, true, true), (3, 4, true, true)]);
    assert!(sent.iter().all(|one| one.method == "one tag+directions" && one.source == "tags"));
    assert!(run.common(&one).is_empty(), "nothing has changed");
    let vague = CommonTags { tags: vec![CommonTag { certainty_a: 0.8, ..one.tags[0].clone() }], ..one.clone() };
    assert!(!run.common(&vague)[0].accepted);
}
