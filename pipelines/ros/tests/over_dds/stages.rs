//! A source among nodes that publish as robots do, and a sink that they are.

use crate::domain::{Domain, map, poses};
use crate::waiting::{give, sent, wait_for};
use gridweave_runtime::ros::{OccupancyGrid, PoseStamped, RosMessage, encode};

const MAP: &[(&str, &str)] = &[(OccupancyGrid::NAME, "/robot1/map")];

#[track_caller]
fn value_of(message: &gridweave_runtime::message::Message, width: u32) -> u8 {
    let grid: OccupancyGrid<'_> = message.decode().unwrap();
    assert_eq!((grid.info.width, grid.data.len()), (width, (width * width) as usize));
    assert!(grid.data.iter().all(|cell| *cell == grid.data[0]));
    grid.data[0]
}

#[test]
fn a_map_that_was_published_before_comes_and_those_after_it_too() {
    let domain = Domain::new();
    let mut robot = domain.sink("slam", MAP);
    give(&mut robot, 0, "/robot1/map", map(20, 10));
    let mut source = domain.source("");
    let first = sent(&mut source, "map", 1).remove(0);
    assert_eq!((first.robot(), value_of(&first, 20)), ("robot1", 10));
    give(&mut robot, 0, "/robot1/map", map(20, 20));
    assert_eq!(value_of(&sent(&mut source, "map", 1)[0], 20), 20);
}

#[test]
fn a_robot_that_comes_late_and_one_that_comes_again_are_heard() {
    let domain = Domain::new();
    let mut source = domain.source("");
    for value in [1, 2, 3] {
        let mut robot = domain.sink("slam", MAP);
        give(&mut robot, 0, "/robot1/map", map(20, value));
        assert_eq!(value_of(&sent(&mut source, "map", 1)[0], 20), value);
    }
}

#[test]
fn a_source_that_starts_again_has_the_last_map_at_once() {
    let domain = Domain::new();
    let mut robot = domain.sink("slam", MAP);
    give(&mut robot, 0, "/robot1/map", map(20, 7));
    for _ in 0..3 {
        let mut source = domain.source("");
        assert_eq!(value_of(&sent(&mut source, "map", 1)[0], 20), 7);
    }
}

#[test]
fn a_map_of_16_mb_comes_whole() {
    let domain = Domain::new();
    let mut source = domain.source("");
    let mut robot = domain.sink("slam", MAP);
    give(&mut robot, 0, "/robot1/map", map(4000, 10));
    assert_eq!(value_of(&sent(&mut source, "map", 1)[0], 4000), 10);
    // One who comes late has it, too.
    let mut late = domain.source("");
    assert_eq!(value_of(&sent(&mut late, "map", 1)[0], 4000), 10);
}

#[test]
fn messages_come_in_their_order_and_none_is_missing() {
    let domain = Domain::new();
    let mut source = domain.source("keep_last = 10000");
    let mut robot = domain.sink("slam", &[(OccupancyGrid::NAME, "/robot1/map"), (PoseStamped::NAME, "/robot1/pose")]);
    give(&mut robot, 0, "/robot1/map", map(20, 10));
    let pose = |number: u32| {
        let mut pose = PoseStamped::default();
        pose.pose.position.x = f64::from(number);
        encode(&pose).unwrap()
    };
    // Nothing is kept of poses for who comes later.
    let mut first = Vec::new();
    wait_for(&mut source, "pose", |source| {
        give(&mut robot, 1, "/robot1/pose", pose(0));
        first = poses(source);
        !first.is_empty()
    });
    (1..=1000).for_each(|number| give(&mut robot, 1, "/robot1/pose", pose(number)));
    let mut all = first;
    wait_for(&mut source, "last pose", |source| {
        all.extend(poses(source));
        all.last() == Some(&1000.0)
    });
    all.dedup();
    let numbers: Vec<f64> = (0..=1000).map(f64::from).collect();
    assert_eq!(all, numbers);
}

#[test]
fn domains_hear_nothing_of_each_other() {
    let (domain, other) = (Domain::new(), Domain::new());
    let mut source = domain.source("");
    let mut stranger = other.sink("slam", MAP);
    give(&mut stranger, 0, "/robot1/map", map(20, 1));
    // What other sources hear of the stranger has come, and this one has heard nothing.
    let mut subscriber = other.source("");
    sent(&mut subscriber, "map", 1);
    let mut robot = domain.sink("slam", MAP);
    give(&mut robot, 0, "/robot1/map", map(20, 2));
    assert_eq!(value_of(&sent(&mut source, "map", 1)[0], 20), 2);
}
