use super::*;
use gridweave_runtime::ros::{
    Alignment, Header, MapDirection, Marker, MarkerArray, Point, Segment, Segments, TagEstimate, TagEstimates, Time,
    TopologicalMap, TopologicalNode, TopologicalPath,
};

const COLOUR: [u8; 3] = [0, 114, 178];

fn header() -> Header {
    Header { frame_id: "robot1/map".into(), ..Default::default() }
}

/// All but the first, which deletes what was shown before.
#[track_caller]
fn shapes(array: &MarkerArray) -> &[Marker] {
    assert_eq!(array.markers[0].action, Marker::DELETE_ALL);
    assert!(!array.markers[0].header.frame_id.is_empty());
    let shapes = &array.markers[1..];
    assert!(shapes.iter().all(|shape| shape.action == Marker::ADD && !shape.header.frame_id.is_empty()));
    let ids: Vec<i32> = shapes.iter().map(|shape| shape.id).collect();
    assert_eq!(ids, (0..shapes.len() as i32).collect::<Vec<_>>(), "each has a number of its own");
    shapes
}

#[test]
fn walls_are_lines_that_are_fainter_the_less_reliable_they_are() {
    let wall = |y1, reliability| Segment { x1: 1.0, y1, x2: 3.0, y2: 2.0, reliability, inliers: 9 };
    let walls = vec![wall(2.0, 1.0), wall(0.0, 0.2), wall(f64::NAN, 1.0)];
    let made = segments(&Segments { header: header(), segments: walls, ..Default::default() }, COLOUR);
    let [lines] = shapes(&made) else { panic!("{made:?}") };
    assert_eq!((lines.shape, lines.points.len(), lines.colors.len()), (Marker::LINE_LIST, 4, 4));
    assert_eq!((lines.points[0].x, lines.points[1].y), (1.0, 2.0));
    assert!(lines.colors[0].a > 0.99 && (lines.colors[2].a - 0.4).abs() < 1e-6);
}

#[test]
fn a_tag_is_an_ellipse_of_two_standard_deviations_with_its_name() {
    let tag =
        |x: f64, covariance| TagEstimate { tag_id: "a".into(), x, y: 2.0, covariance, certainty: 0.5, readings: 3 };
    let tags = vec![tag(1.0, [0.04, 0.0, 0.0, 0.01]), tag(f64::NAN, [0.0; 4]), tag(2.0, [f64::NAN; 4])];
    let made = super::tags(&TagEstimates { header: header(), tags, ..Default::default() }, COLOUR);
    let [ellipse, name, unknown, _] = shapes(&made) else { panic!("{made:?}") };
    let (long, short) = (ellipse.scale.x.max(ellipse.scale.y), ellipse.scale.x.min(ellipse.scale.y));
    assert!((long - 0.8).abs() < 1e-9 && (short - 0.4).abs() < 1e-9);
    let along_x = ellipse.scale.x > ellipse.scale.y;
    let angle = ellipse.pose.orientation.yaw() + if along_x { 0.0 } else { std::f64::consts::FRAC_PI_2 };
    assert!(angle.sin().abs() < 1e-9, "the long axis lies along x");
    assert_eq!(name.text, "a 50 %");
    assert!(unknown.scale.x > 0.0 && unknown.pose.position.x == 2.0);
}

#[test]
fn a_topological_map_is_lines_and_balls() {
    let node = |x| TopologicalNode { x, y: 0.0, kind: "door".into(), probability: 1.0 };
    let points = [0.0, 1.0, f64::NAN, 3.0, 4.0].map(|x| Point { x, ..Default::default() }).to_vec();
    let paths = vec![TopologicalPath { points, probability: 0.5, ..Default::default() }];
    let map = TopologicalMap {
        header: header(),
        nodes: vec![node(0.0), node(4.0), node(f64::NAN)],
        paths,
        ..Default::default()
    };
    let made = ways(&map, COLOUR);
    let [lines, places] = shapes(&made) else { panic!("{made:?}") };
    assert_eq!((lines.points.len(), places.points.len(), places.colors.len()), (4, 2, 2));
}

#[test]
fn a_direction_is_two_arrows_across_each_other_or_nothing() {
    let found = MapDirection { header: header(), direction: 0.3, valid: true, ..Default::default() };
    let made = direction(&found, COLOUR);
    let yaws: Vec<f64> = shapes(&made).iter().map(|arrow| arrow.pose.orientation.yaw()).collect();
    assert!((yaws[0] - 0.3).abs() < 1e-9 && (yaws[1] - yaws[0] - std::f64::consts::FRAC_PI_2).abs() < 1e-9);
    for nothing in [MapDirection { valid: false, ..found.clone() }, MapDirection { direction: f64::NAN, ..found }] {
        assert!(shapes(&direction(&nothing, COLOUR)).is_empty());
    }
}

#[test]
fn a_hypothesis_shows_the_pose_of_the_map_and_whether_it_was_accepted() {
    let place = |x, accepted, rank| Alignment {
        header: Header { stamp: Time { sec: 3, nanosec: 0 }, frame_id: "robot1/map".into() },
        a: "robot1".into(),
        b: "robot2".into(),
        has_transform: true,
        x,
        accepted,
        rank,
        score: 0.25,
        ..Default::default()
    };
    let none = Alignment { has_transform: false, ..place(0.0, true, 0) };
    let found = [place(1.0, true, 0), place(2.0, false, 1), place(f64::NAN, true, 2), none];
    let made = hypotheses(found.iter());
    let shown = shapes(&made);
    let sorts: Vec<&str> = shown.iter().map(|shape| shape.ns.as_str()).collect();
    assert_eq!(sorts, ["accepted", "accepted", "accepted", "refused", "refused", "refused"]);
    assert_eq!(shown[5].text, "robot2 on robot1, no. 2: 0.250");
    assert_eq!(shown[4].points[1].x, 2.0);
}
