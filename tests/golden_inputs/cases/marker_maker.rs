//! The input of `marker_maker`: a little of each that can be found.

use super::Case;
use gridweave_runtime::ros::{
    Alignment, Header, MapDirection, Point, Segment, Segments, TagEstimate, TagEstimates, TopologicalMap,
    TopologicalNode, TopologicalPath, Verdict, Verdicts,
};
use gridweave_tests::{LogBuilder, header};

pub(super) fn cases() -> Vec<Case> {
    vec![Case::new("marker_maker", "all", |log| {
        for (seconds, robot) in [(1.0, "robot1"), (2.0, "robot2"), (3.0, "robot1")] {
            findings(log, seconds, robot);
        }
        for (rank, accepted) in [(0, true), (1, false)] {
            log.message(4.0, "/icp/alignment", &place(rank, accepted));
        }
        let alignment = Alignment { header: Header::default(), ..place(0, true) };
        log.message(
            5.0,
            "/verdicts",
            &Verdicts { verdicts: vec![Verdict { alignment, checked: true }], ..Default::default() },
        );
    })]
}

fn findings(log: &mut LogBuilder, seconds: f64, robot: &str) {
    let header = || header(seconds, format!("{robot}/map"));
    let of_robot = || robot.to_owned();
    let wall = |reliability| Segment { x1: 0.0, y1: 0.0, x2: 4.0, y2: seconds, reliability, inliers: 40 };
    let segments = Segments { header: header(), robot: of_robot(), segments: vec![wall(1.0), wall(0.5)] };
    log.message(seconds, &format!("/{robot}/lines/segments"), &segments);
    let direction =
        MapDirection { header: header(), robot: of_robot(), direction: 0.3, valid: true, ..Default::default() };
    log.message(seconds, &format!("/{robot}/quadrants/direction"), &direction);
    let covariance = [0.04, 0.0, 0.0, 0.01];
    let tag = TagEstimate { tag_id: "tag1".into(), x: 1.0, y: 2.0, covariance, certainty: 0.75, readings: 9 };
    let tags = TagEstimates { header: header(), robot: of_robot(), tags: vec![tag] };
    log.message(seconds, &format!("/{robot}/tags/estimates"), &tags);
    let node = |x| TopologicalNode { x, y: 1.0, kind: "door".into(), probability: 1.0 };
    let points = [1.0, 2.0, 3.0].map(|x| Point { x, y: 1.0, z: 0.0 }).to_vec();
    let way = TopologicalPath { start: 0, end: 1, length: 2.0, probability: 0.5, points };
    let map =
        TopologicalMap { header: header(), robot: of_robot(), nodes: vec![node(1.0), node(3.0)], paths: vec![way] };
    log.message(seconds, &format!("/{robot}/topology"), &map);
}

fn place(rank: u32, accepted: bool) -> Alignment {
    Alignment {
        header: header(4.0, "robot1/map"),
        a: "robot1".into(),
        b: "robot2".into(),
        has_transform: true,
        x: 2.0 + f64::from(rank),
        y: 1.0,
        yaw: 0.5,
        score: 0.9,
        accepted,
        rank,
        hypotheses: 2,
        ..Default::default()
    }
}
