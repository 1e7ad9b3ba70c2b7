//! The stage from outside: messages in, messages out.

use crate::shared::test_world::floor_plan::{FloorPlan, apart, drawing, seen};
use crate::shared::test_world::stage_bench::StageBench;
use gridweave_runtime::stage::{Context, InitialPose, InitialPoses};

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
