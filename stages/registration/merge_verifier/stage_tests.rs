//! The stage from outside: messages in, messages out.

use crate::shared::geometry::{Pose2, pose};
use crate::shared::test_world::floor_plan::{FloorPlan, drawing, seen};
use crate::shared::test_world::stage_bench::StageBench;
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{Alignment, Header};
use gridweave_runtime::stage::{Context, InitialPose, InitialPoses};

/// The office looks a little like itself after half a turn, so that half of it is not as probable as is required by
/// default.
const LIKELY: &str = "accept = 0.95";

fn proposed(source: &str, transform_a_b: &Pose2) -> Alignment {
    let mut alignment = Alignment {
        header: Header::new(LogTime(0), "robot1/map"),
        a: "robot1".into(),
        b: "robot2".into(),
        covariance: [1e-4, 0.0, 0.0, 0.0, 1e-4, 0.0, 0.0, 0.0, 1e-6],
        score: 0.3,
        margin: 0.5,
        source: source.into(),
        method: source.into(),
        accepted: true,
        reason: "somebody says so".into(),
        ..Default::default()
    };
    alignment.set_transform_a_b(transform_a_b);
    alignment
}

#[test]
fn hypotheses_are_judged_together_and_replace_the_earlier_ones_of_their_source() {
    let (a, b) = FloorPlan::west_and_east_of_the_office();
    let mut bench = StageBench::new(&super::kind(), LIKELY);
    bench.give_map("robot1", &a);
    bench.give_map("robot2", &b);
    let truth = a.transform_to(&b);
    let ranked =
        |rank: u32, place: &Pose2| Alignment { provisional: true, rank, hypotheses: 2, ..proposed("maps", place) };
    let wrong = pose(1.5, 0.0, 0.0) * truth;
    assert_eq!(bench.give(&ranked(0, &wrong)), []);
    let sent = bench.give(&ranked(1, &truth));
    assert!(sent[0].accepted && (sent[0].rank, sent[0].hypotheses) == (0, 0), "{sent:?}");
    assert_eq!(sent[0].transform_a_b(), ranked(1, &truth).transform_a_b());
    let sent = bench.give(&Alignment { hypotheses: 1, ..ranked(0, &wrong) });
    assert!(!sent[0].accepted, "{}", sent[0].reason);
    let sent = bench.give(&proposed("tags", &truth));
    assert!(sent[0].accepted && sent[0].method == "tags", "{sent:?}");
}

/// An alignment of a plug-in that reports no uncertainty.
fn by_a_plug_in(transform_a_b: &Pose2) -> Alignment {
    Alignment { score: 1.0, hypotheses: 1, method: "tags".into(), ..proposed("a plug-in", transform_a_b) }
}

#[test]
fn a_wrong_plug_in_is_not_trusted_however_certain_it_is() {
    let (a, b) = FloorPlan::west_and_east_of_the_office();
    let mut bench = StageBench::new(&super::kind(), "");
    bench.give_map("robot1", &a);
    bench.give_map("robot2", &b);
    let truth = a.transform_to(&b);
    for wrong in [pose(1.5, 0.0, 0.0), pose(0.0, -3.0, 0.3), pose(100.0, 0.0, 0.0), pose(0.0, 0.0, 3.1)] {
        let sent = bench.give(&by_a_plug_in(&(wrong * truth)));
        assert!(!sent[0].accepted && sent[0].score < 0.5, "{wrong}: {sent:?}");
    }
}

#[test]
fn a_plug_in_is_trusted_where_a_search_of_the_maps_finds_the_same_pose_only() {
    let (a, b) = FloorPlan::west_and_east_of_the_office();
    let mut bench = StageBench::new(&super::kind(), LIKELY);
    bench.give_map("robot1", &a);
    bench.give_map("robot2", &b);
    let sent = bench.give(&by_a_plug_in(&a.transform_to(&b)));
    assert!(sent[0].accepted && sent[0].source == "a plug-in", "{sent:?}");
    // A hall fits half a turn on, too, and only a search shows that.
    let draw = |at| FloorPlan::hall().draw(seen(-0.2, -0.2, 20.2, 12.2), at);
    let (a, b) = (draw(drawing(3.0, 2.0, 0.4)), draw(drawing(12.0, 6.0, -2.1)));
    let mut bench = StageBench::new(&super::kind(), "");
    bench.give_map("robot1", &a);
    bench.give_map("robot2", &b);
    let sent = bench.give(&by_a_plug_in(&a.transform_to(&b)));
    assert!(!sent[0].accepted && sent[0].score < 0.9, "{sent:?}");
}

/// Two robots with known initial poses.
fn knowing(parameters: &str) -> StageBench {
    let robot2 = InitialPose { x: 5.0, y: 1.0, yaw: 0.5, ..InitialPose::default() };
    let initial_poses = InitialPoses::from([("robot1".into(), InitialPose::ORIGIN), ("robot2".into(), robot2)]);
    StageBench::with_context(&super::kind(), parameters, &Context { initial_poses, ..Context::default() })
}

#[test]
fn an_initial_pose_is_used_as_it_is_if_the_user_chooses_it() {
    let (a, b) = FloorPlan::west_and_east_of_the_office();
    let mut bench = knowing("hypotheses = { robot2 = 0 }");
    bench.give_map("robot1", &a);
    bench.give_map("robot2", &b);
    let nothing = Alignment { accepted: false, has_transform: false, ..proposed("maps", &Pose2::identity()) };
    let sent = bench.give(&nothing);
    let [aligned] = sent.as_slice() else { panic!("{sent:?}") };
    assert!(aligned.accepted && aligned.source == "initial poses", "{aligned:?}");
    assert_eq!((aligned.x, aligned.y, aligned.yaw), (5.0, 1.0, 0.5));
    assert!((aligned.covariance[0] - 1.0).abs() < 1e-9 && (aligned.covariance[8] - 0.04).abs() < 1e-9, "{aligned:?}");
    assert_eq!(aligned.header.frame_id, "robot1/map");

    let mut bench = StageBench::new(&super::kind(), "hypotheses = { robot2 = 0 }");
    bench.give_map("robot1", &a);
    bench.give_map("robot2", &b);
    let sent = bench.give(&nothing);
    assert!(!sent[0].accepted && sent[0].reason.contains("--initial robot2=X,Y,YAW"), "{sent:?}");
}

#[test]
fn a_choice_that_matches_no_pair_gives_a_warning() {
    let (a, b) = FloorPlan::west_and_east_of_the_office();
    let warnings = |parameters: &str| {
        let mut bench = knowing(parameters);
        bench.give_map("robot1", &a);
        bench.give_map("robot2", &b);
        bench.give(&proposed("maps", &a.transform_to(&b)));
        bench.finish();
        bench.stage.warnings().len()
    };
    assert_eq!(warnings("hypotheses = { robot2 = 1 }"), 0);
    assert_eq!(warnings("hypotheses = { \"robot2/robot1\" = 1 }"), 0);
    assert_eq!(warnings("hypotheses = { robot3 = 1 }"), 1);
    assert_eq!(warnings("hypotheses = { \"robot2/robot2\" = 1 }"), 1);
}
