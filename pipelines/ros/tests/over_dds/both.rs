//! A robot that is heard on both middlewares, as behind a bridge between them.

use crate::domain::{Domain, map, poses};
use crate::waiting::{give, wait_for, warned};
use crate::wire::Router;
use gridweave_ros::{sink, source};
use gridweave_runtime::ros::{OccupancyGrid, PoseStamped, RosMessage, encode};
use gridweave_runtime::stage::{Context, InputWire, StageHarness};

fn parameters(domain: &Domain, router: &Router) -> String {
    let connect = router.endpoint();
    let (number, listen) = (domain.number(), "tcp/127.0.0.1:0");
    format!("discovery_range = \"localhost\"\ndomain = {number}\nconnect = [\"{connect}\"]\nlisten = [\"{listen}\"]")
}

#[test]
fn a_robot_on_both_middlewares_is_heard_once() {
    let (domain, router) = (Domain::new(), Router::start());
    let parameters = parameters(&domain, &router);
    let mut source = StageHarness::new(&source::kind(), &format!("{parameters}\nkeep_last = 1000")).unwrap();
    let wire = |(ros_type, topic): (&'static str, &str)| InputWire {
        port: "in",
        from: "a".into(),
        ros_type: ros_type.to_owned(),
        topic: topic.into(),
        ..Default::default()
    };
    let wires = [(OccupancyGrid::NAME, "/robot1/map"), (PoseStamped::NAME, "/robot1/pose")].map(wire);
    let context = Context { stage: "slam".into(), inputs: wires.to_vec(), ..Default::default() };
    let mut robot =
        StageHarness::with_context(&sink::kind(), &format!("{parameters}\nas_robot = true"), &context).unwrap();
    give(&mut robot, 0, "/robot1/map", map(20, 1));
    let pose = |number: u32| {
        let mut pose = PoseStamped::default();
        pose.pose.position.x = f64::from(number);
        encode(&pose).unwrap()
    };
    give(&mut robot, 1, "/robot1/pose", pose(0));
    let text = warned(&mut source, "`/robot1/pose` is published over");
    assert!(text.contains("DDS") && text.contains("Zenoh") && text.contains("alone"), "{text}");
    // Nothing is kept of poses for who subscribes later.
    let mut first = Vec::new();
    wait_for(&mut source, "pose", |source| {
        give(&mut robot, 1, "/robot1/pose", pose(0));
        first = poses(source);
        !first.is_empty()
    });
    (1..=200).for_each(|number| give(&mut robot, 1, "/robot1/pose", pose(number)));
    let mut heard = Vec::new();
    wait_for(&mut source, "last pose", |source| {
        heard.extend(poses(source));
        heard.last() == Some(&200.0)
    });
    heard.retain(|number| *number > 0.0);
    assert_eq!(heard, (1..=200).map(f64::from).collect::<Vec<f64>>());
    assert!(!source.warnings().keys().any(|text| text.contains("two robots of one name")), "{:?}", source.warnings());
}
