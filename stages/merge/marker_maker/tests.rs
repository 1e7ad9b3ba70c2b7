//! What the golden case does not hold: values that are not finite.

use super::*;
use gridweave_runtime::ros::{
    Alignment, Header, MapDirection, Marker, MarkerArray, Point, Segment, Segments, TagEstimate, TagEstimates,
    TopologicalMap, TopologicalNode, TopologicalPath,
};

const COLOUR: [u8; 3] = [0, 114, 178];

fn header() -> Header {
    Header { frame_id: "robot1/map".into(), ..Default::default() }
}

/// All but the first, which deletes what was shown before.
fn shapes(array: &MarkerArray) -> &[Marker] {
    assert_eq!(array.markers[0].action, Marker::DELETE_ALL);
    &array.markers[1..]
}

#[test]
fn what_is_not_finite_is_not_shown() {
    let wall = |y1| Segment { x1: 1.0, y1, x2: 3.0, y2: 2.0, reliability: 1.0, inliers: 9 };
    let walls = Segments { header: header(), segments: vec![wall(2.0), wall(f64::NAN)], ..Default::default() };
    assert_eq!(shapes(&segments(&walls, COLOUR))[0].points.len(), 2);

    let direction_of = |direction| MapDirection { header: header(), direction, valid: true, ..Default::default() };
    assert_eq!(shapes(&direction(&direction_of(0.3), COLOUR)).len(), 2);
    let invalid = MapDirection { valid: false, ..direction_of(0.3) };
    assert!([direction_of(f64::NAN), invalid].iter().all(|one| shapes(&direction(one, COLOUR)).is_empty()));

    let node = |x| TopologicalNode { x, y: 0.0, kind: "door".into(), probability: 1.0 };
    let points = [0.0, 1.0, f64::NAN, 3.0, 4.0].map(|x| Point { x, ..Default::default() }).to_vec();
    let paths = vec![TopologicalPath { points, probability: 0.5, ..Default::default() }];
    let nodes = vec![node(0.0), node(4.0), node(f64::NAN)];
    let made = ways(&TopologicalMap { header: header(), nodes, paths, ..Default::default() }, COLOUR);
    assert_eq!(shapes(&made).iter().map(|shape| shape.points.len()).collect::<Vec<_>>(), [4, 2]);

    let place = |x| Alignment { header: header(), has_transform: true, x, accepted: true, ..Default::default() };
    let found = [place(1.0), place(f64::NAN), Alignment { has_transform: false, ..place(0.0) }];
    assert_eq!(shapes(&hypotheses(found.iter())).len(), 3, "arrows and text of the first");
}

#[test]
fn a_tag_whose_covariance_is_invalid_is_shown_at_its_position() {
    let tag = |x, covariance| TagEstimate { x, y: 2.0, covariance, ..Default::default() };
    let tags = vec![tag(f64::NAN, [0.0; 4]), tag(2.0, [f64::NAN; 4])];
    let made = super::tags(&TagEstimates { header: header(), tags, ..Default::default() }, COLOUR);
    let [unknown, _] = shapes(&made) else { panic!("{made:?}") };
    assert!(unknown.scale.x > 0.0 && unknown.pose.position.x == 2.0);
}
