//! What does not fit is told, once, and the rest goes on.

use crate::domain::{Domain, give, map, sent, warned};
use gridweave_runtime::ros::{OccupancyGrid, PoseStamped, RosMessage, encode};

#[test]
fn two_robots_of_one_name_are_told_with_the_names_of_their_nodes() {
    let domain = Domain::new();
    let mut source = domain.source("");
    let mut robots = ["slam_a", "slam_b"].map(|node| domain.sink(node, &[(OccupancyGrid::NAME, "/robot1/map")]));
    robots.iter_mut().for_each(|robot| give(robot, 0, "/robot1/map", map(20, 1)));
    let text = warned(&mut source, "2 programs at once");
    assert!(text.contains("/slam_a") && text.contains("/slam_b"), "{text}");
    sent(&mut source, "map", 1);
}

#[test]
fn a_topic_of_another_type_is_told_and_the_others_are_heard() {
    let domain = Domain::new();
    let mut source = domain.source("");
    let mut robot = domain.sink("slam", &[(PoseStamped::NAME, "/robot1/map"), (OccupancyGrid::NAME, "/robot2/map")]);
    give(&mut robot, 0, "/robot1/map", encode(&PoseStamped::default()).unwrap());
    give(&mut robot, 1, "/robot2/map", map(20, 1));
    warned(&mut source, "/robot1/map");
    assert_eq!(sent(&mut source, "map", 1)[0].robot(), "robot2");
}

#[test]
fn a_domain_with_nobody_in_it_is_told() {
    let domain = Domain::new();
    let mut source = domain.source("discovery_timeout = 0.2");
    let text = warned(&mut source, "nobody publishes over DDS");
    assert!(text.contains(&format!("domain {}", domain.number())), "{text}");
}
