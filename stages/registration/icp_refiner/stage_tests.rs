//! The stage from outside: messages in, messages out.

use crate::shared::geometry::{Pose2, pose};
use crate::shared::test_world::floor_plan::{DrawnMap, FloorPlan, drawing, seen};
use crate::shared::test_world::stage_bench::StageBench;
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{Alignment, Header};

fn first_guess(transform_a_b: &Pose2) -> Alignment {
    let mut alignment = Alignment {
        header: Header::new(LogTime(0), "robot1/map"),
        a: "robot1".into(),
        b: "robot2".into(),
        covariance: [0.04, 0.0, 0.0, 0.0, 0.04, 0.0, 0.0, 0.0, 0.001],
        score: 0.9,
        source: "tags".into(),
        method: "tags".into(),
        accepted: true,
        reason: "three tags".into(),
        ..Default::default()
    };
    alignment.set_transform_a_b(transform_a_b);
    alignment
}

/// West, east, and more of the east.
fn maps() -> (DrawnMap, DrawnMap, DrawnMap) {
    let office = FloorPlan::office();
    let a = office.draw(seen(-0.2, -0.2, 14.0, 12.2), drawing(3.0, 2.0, 0.4));
    let b = office.draw(seen(5.0, -0.2, 18.0, 12.2), drawing(12.0, 6.0, -2.1));
    let more_of_b = office.draw(seen(5.0, -0.2, 20.2, 12.2), drawing(12.0, 6.0, -2.1));
    (a, b, more_of_b)
}

#[test]
fn a_first_guess_is_refined_once_both_maps_are_there() {
    let (a, b, _) = maps();
    let truth = a.transform_to(&b);
    let mut bench = StageBench::new(&super::kind(), "");
    assert_eq!(bench.give(&first_guess(&(truth * pose(0.1, -0.1, 0.02)))), []);
    assert_eq!(bench.give_map("robot1", &a), []);
    let sent = bench.give_map("robot2", &b);
    let [refined] = sent.as_slice() else { panic!("{sent:?}") };
    assert!(refined.accepted, "{}", refined.reason);
    assert_eq!(refined.method, "tags+icp");
    assert_eq!(refined.header, Header::new(LogTime(3_000_000_000), "robot1/map"));
    assert_eq!((refined.score, refined.provisional), (0.9, false), "these are the first guess's");
    assert!(refined.reason.starts_with("three tags; walls are aligned to "), "{}", refined.reason);
    let off = truth.inverse() * refined.transform_a_b();
    assert!(off.translation.vector.norm() < 0.03 && off.rotation.angle().abs() < 0.003, "{off}");
    assert_eq!(bench.finish(), []);
    assert_eq!(bench.counted("registrations"), 1);
}

#[test]
fn nothing_is_sent_or_registered_again_while_maps_and_guess_stay() {
    let (a, b, more_of_b) = maps();
    let truth = a.transform_to(&b);
    let mut bench = StageBench::new(&super::kind(), "");
    bench.give_map("robot1", &a);
    bench.give_map("robot2", &b);
    assert_eq!(bench.give(&first_guess(&truth)).len(), 1);
    assert_eq!(bench.give(&first_guess(&truth)), []);
    assert_eq!(bench.give(&first_guess(&(truth * pose(0.01, 0.01, 0.001)))), []);
    assert_eq!(bench.counted("registrations"), 1);
    assert_eq!(bench.give_map("robot2", &more_of_b).len(), 1);
    assert_eq!(bench.counted("registrations"), 2);
    bench.give(&first_guess(&(truth * pose(0.2, 0.0, 0.0))));
    assert_eq!(bench.counted("registrations"), 3);
}

#[test]
fn a_reused_alignment_names_the_method_of_the_latest_first_guess() {
    let (a, b, _) = maps();
    let truth = a.transform_to(&b);
    let mut bench = StageBench::new(&super::kind(), "");
    bench.give_map("robot1", &a);
    bench.give_map("robot2", &b);
    bench.give(&first_guess(&truth));
    let other = Alignment { method: "few tags".into(), ..first_guess(&truth) };
    let sent = bench.give(&other);
    assert_eq!(sent.len(), 1);
    assert_eq!(sent[0].method, "few tags+icp");
    assert_eq!(bench.counted("registrations"), 1);
}

#[test]
fn a_wrong_first_guess_is_refused_until_a_better_one_comes() {
    let (a, b, _) = maps();
    let truth = a.transform_to(&b);
    let mut bench = StageBench::new(&super::kind(), "");
    bench.give_map("robot1", &a);
    bench.give_map("robot2", &b);
    let sent = bench.give(&first_guess(&(truth * pose(60.0, 1.5, 0.5))));
    assert_eq!(sent.len(), 1);
    assert!(!sent[0].accepted && sent[0].reason.contains("no walls near each other"), "{sent:?}");
    assert!(bench.give(&first_guess(&truth))[0].accepted);
}

#[test]
fn ranked_guesses_are_refined_and_sent_together() {
    let (a, b, more_of_b) = maps();
    let truth = a.transform_to(&b);
    let mut bench = StageBench::new(&super::kind(), "");
    bench.give_map("robot1", &a);
    bench.give_map("robot2", &b);
    let ranked =
        |rank: u32, place: &Pose2| Alignment { rank, hypotheses: 2, source: "maps".into(), ..first_guess(place) };
    assert_eq!(bench.give(&ranked(0, &truth)), []);
    let sent = bench.give(&ranked(1, &(truth * pose(2.0, 1.5, 0.5))));
    assert_eq!(sent.iter().map(|one| (one.rank, one.hypotheses)).collect::<Vec<_>>(), [(0, 2), (1, 2)]);
    assert_eq!(bench.give_map("robot2", &more_of_b).len(), 2, "both, though one may have stayed as it was");
    assert_eq!(bench.give(&ranked(1, &truth)), [], "the first is missing");
    assert_eq!(bench.stage.warnings().len(), 1);
}

#[test]
fn where_a_search_leaves_the_position_open_registration_does_not_constrain_it() {
    let (a, b, _) = maps();
    let truth = a.transform_to(&b);
    let found = |along: f64, method: &str| {
        let mut bench = StageBench::new(&super::kind(), "");
        bench.give_map("robot1", &a);
        bench.give_map("robot2", &b);
        let mut covariance = [0.0; 9];
        (covariance[0], covariance[4], covariance[8]) = (along * along, 0.01, 1e-4);
        let (source, method) = ("maps".into(), method.into());
        let guess = Alignment { hypotheses: 1, source, method, covariance, ..first_guess(&truth) };
        bench.give(&guess).remove(0)
    };
    let open = found(4.0, "maps");
    assert!(!open.accepted && open.reason.contains("bare corridor"), "{}", open.reason);
    assert!(found(0.05, "maps").accepted);
    assert!(found(4.0, "hough_spectrum").accepted, "there the covariance is that of the error");
}
