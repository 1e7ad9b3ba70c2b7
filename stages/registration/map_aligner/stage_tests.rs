//! The stage from outside: messages in, messages out.

use crate::registration::search::tests::angular_office;
use crate::shared::test_world::floor_plan::{DrawnMap, FloorPlan, apart, drawing, seen};
use crate::shared::test_world::stage_bench::StageBench;
use gridweave_runtime::ros::OccupancyGrid;
use gridweave_runtime::stage::{Context, InitialPose, InitialPoses, StageHarness};

/// West, east, and more of the east.
fn maps() -> (DrawnMap, DrawnMap, DrawnMap) {
    let office = angular_office();
    let a = office.draw(seen(-0.2, -0.2, 14.0, 12.2), drawing(3.0, 2.0, 0.4));
    let b = office.draw(seen(5.0, -0.2, 18.0, 12.2), drawing(12.0, 6.0, -2.1));
    let more_of_b = office.draw(seen(3.0, -0.2, 20.2, 12.2), drawing(12.0, 6.0, -2.1));
    (a, b, more_of_b)
}

#[test]
fn a_pair_is_aligned_when_both_maps_are_there_and_again_when_one_has_changed() {
    let (a, b, more_of_b) = maps();
    let mut bench = StageBench::new(&super::kind(), "");
    assert_eq!(bench.give_map("robot2", &b), []);
    let first = bench.give_map("robot1", &a);
    assert_eq!((first[0].a.as_str(), first[0].b.as_str()), ("robot1", "robot2"));
    assert_eq!((first[0].method.as_str(), first[0].header.frame_id.as_str()), ("maps", "robot1/map"));
    assert!(first[0].accepted && first[0].provisional, "{}", first[0].reason);
    assert_eq!((first[0].rank, first[0].hypotheses), (0, first.len() as u32));
    assert!(first[0].score > 0.99 && first[1..].iter().all(|other| other.score == 0.0), "{first:?}");
    assert!(first[0].reason.contains("m of walls in common"), "{}", first[0].reason);
    let (metres, radians) = apart(&first[0].transform_a_b(), &a.transform_to(&b), &b);
    assert!(metres < 0.15 && radians < 0.015, "{metres} m, {radians} rad");

    assert_eq!(bench.give_map("robot1", &a), [], "the same map again");
    assert_eq!(bench.counted("searches"), 1);
    let second = bench.give_map("robot2", &more_of_b);
    assert!(second[0].accepted && second.len() == second[0].hypotheses as usize, "{second:?}");
    assert_eq!(bench.counted("searches"), 2);
}

#[test]
fn a_refusal_has_a_reason() {
    let (a, b, _) = maps();
    let corner = angular_office().draw(seen(-0.2, -0.2, 3.0, 3.0), drawing(1.0, 1.0, 1.0));
    let mut bench = StageBench::new(&super::kind(), "min_wall_length = 15.0");
    bench.give_map("robot1", &a);
    let first = bench.give_map("robot3", &b);
    assert!(first.iter().all(|one| one.accepted && one.reason.contains("m of walls in common")), "{first:?}");
    let sent = bench.give_map("robot2", &corner);
    assert!(!sent.is_empty() && sent.iter().all(|one| !one.accepted), "{sent:?}");
    assert!(sent.iter().all(|one| one.reason.contains("too little in common") && one.hypotheses == 0), "{sent:?}");
}

#[test]
fn hypotheses_are_ranked_and_counted_and_their_scores_fall() {
    let hall = FloorPlan::hall();
    let all = seen(-0.2, -0.2, 20.2, 12.2);
    let mut bench = StageBench::new(&super::kind(), "max_hypotheses = 3\nleast_share = 0.0");
    bench.give_map("robot1", &hall.draw(all, drawing(3.0, 2.0, 0.4)));
    let sent = bench.give_map("robot2", &hall.draw(all, drawing(12.0, 6.0, -2.1)));
    assert!((2..=3).contains(&sent.len()), "{sent:?}");
    let ranks: Vec<(u32, u32)> = sent.iter().map(|one| (one.rank, one.hypotheses)).collect();
    assert_eq!(ranks, (0..sent.len() as u32).map(|rank| (rank, sent.len() as u32)).collect::<Vec<_>>());
    assert!(sent[0].score < 0.1, "two poses fit equally well: {sent:?}");
    assert!(sent.is_sorted_by(|one, other| one.score >= other.score));
}

#[test]
fn the_parameters_decide() {
    let (a, b, _) = maps();
    for (parameters, accepted, provisional) in [
        ("provisional = false", true, false),
        ("max_hypotheses = 1", true, true),
        ("min_wall_length = 1000.0", false, false),
        ("max_extent = 10.0", false, false),
    ] {
        let mut bench = StageBench::new(&super::kind(), parameters);
        bench.give_map("robot1", &a);
        let sent = bench.give_map("robot2", &b);
        let said = (sent[0].accepted, sent[0].provisional);
        assert_eq!(said, (accepted, provisional), "{parameters}: {}", sent[0].reason);
        assert!(sent.len() == 1 || !parameters.contains("max_hypotheses"), "{sent:?}");
    }
}

#[test]
fn an_invalid_map_is_left_out_with_a_warning() {
    let (a, b, _) = maps();
    let mut bench = StageBench::new(&super::kind(), "");
    bench.give_map("robot1", &a);
    bench.give_map("robot2", &b);
    assert_eq!(bench.give_grid("robot2", &OccupancyGrid { info: b.info(), ..Default::default() }), []);
    assert_eq!(bench.stage.warnings().len(), 1);
    assert_eq!(bench.give_map("robot2", &b), [], "the map before it is still the last");
}

#[test]
fn invalid_parameters_are_refused() {
    for parameters in
        ["cell = 0.0", "rotation_step = nan", "least_share = 1.5", "max_hypotheses = 0", "max_extent = 9000.0"]
    {
        assert!(StageHarness::new(&super::kind(), parameters).is_err(), "{parameters}");
    }
}

#[test]
fn with_initial_poses_only_poses_near_them_are_found() {
    let hall = FloorPlan::hall();
    let part = seen(-0.2, -0.2, 20.2, 12.2);
    let (a, b) = (hall.draw(part, drawing(3.0, 2.0, 0.4)), hall.draw(part, drawing(12.0, 6.0, -2.1)));
    let found = |initial_poses: InitialPoses| {
        let context = Context { initial_poses, ..Context::default() };
        let mut bench = StageBench::with_context(&super::kind(), "", &context);
        bench.give_map("robot1", &a);
        bench.give_map("robot2", &b)
    };
    assert!(found(InitialPoses::new()).len() > 1, "the hall looks the same after half a turn");
    let truth = a.transform_to(&b);
    let known = |x: f64| InitialPose {
        x: truth.translation.x + x,
        y: truth.translation.y + 0.3,
        yaw: truth.rotation.angle() - 0.1,
        stddev: 0.5,
        yaw_stddev: 0.1,
    };
    let poses = |x: f64| InitialPoses::from([("robot1".into(), InitialPose::ORIGIN), ("robot2".into(), known(x))]);
    let near = found(poses(0.4));
    assert_eq!(near.len(), 1, "{near:?}");
    let (metres, radians) = apart(&near[0].transform_a_b(), &truth, &b);
    assert!(metres < 0.15 && radians < 0.015, "{metres} m, {radians} rad");
    let far = found(poses(9.0));
    assert!(far.iter().all(|one| !one.accepted || apart(&one.transform_a_b(), &truth, &b).0 > 5.0), "{far:?}");
}
