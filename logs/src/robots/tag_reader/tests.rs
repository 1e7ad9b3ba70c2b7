//! Tag readings from custom message definitions, and from the published definitions of detectors.

use super::*;
use crate::robots::{RobotChannels, Role};
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{Header, OccupancyGrid, RosMessage, encode};
use gridweave_runtime::stage::RobotTopics;

const UWB: &str = "std_msgs/Header header\nAnchor[] anchors\n\
    ================================================================================\nMSG: uwb_msgs/Anchor\n\
    uint16 anchor_id\nint32 distance_mm\nfloat32 dbm\nfloat64 deviation\n\
    ================================================================================\nMSG: std_msgs/Header\n\
    builtin_interfaces/Time stamp\nstring frame_id\n\
    ================================================================================\nMSG: builtin_interfaces/Time\n\
    int32 sec\nuint32 nanosec\n";

fn channel(schema_name: &str, text: &str) -> Channel {
    Channel {
        topic: "/robot1/uwb".into(),
        message_encoding: "cdr".into(),
        schema_name: schema_name.into(),
        schema_encoding: "ros2msg".into(),
        schema: text.as_bytes().to_vec(),
        ..Default::default()
    }
}

fn fields(set: impl FnOnce(&mut TagFields)) -> TagFields {
    let mut fields = TagFields { each: Some("anchors".into()), id_field: "anchor_id".into(), ..Default::default() };
    set(&mut fields);
    fields
}

fn uwb() -> Vec<u8> {
    let anchors = vec![(7u16, 1500i32, -60.0f32, 20.0f64), (8, 2500, -40.0, 30.0)];
    encode(&(Header::new(LogTime(3_000_000_004), "robot1/antenna"), anchors)).unwrap()
}

fn read(fields: &TagFields) -> Result<TagMessage, String> {
    TagReader::new(&channel("uwb_msgs/msg/Ranges", UWB), fields)?.read("robot1", &uwb())
}

#[test]
fn every_element_of_an_array_is_a_reading() {
    let found = read(&fields(|fields| {
        fields.range_field = Some("distance_mm".into());
        fields.stddev_field = Some("deviation".into());
        fields.range_unit = Some(0.001);
    }))
    .unwrap();
    let reading = |id: &str, range, stddev| LoggedReading {
        tag_id: id.into(),
        measurement: Measurement::Range { range, stddev, rssi: 0.0 },
    };
    assert_eq!(found.readings, [reading("7", 1.5, 0.02), reading("8", 2.5, 0.03)]);
    assert_eq!((found.stamp, found.frame_id.as_str()), (Time { sec: 3, nanosec: 4 }, "robot1/antenna"));
}

#[test]
fn a_signal_strength_is_a_distance_by_the_model() {
    let path_loss = Some(PathLoss { rssi_at_1m: -40.0, exponent: 2.0, stddev: 4.0 });
    let strength = |fields: &mut TagFields| {
        fields.rssi_field = Some("dbm".into());
        fields.path_loss = path_loss;
    };
    let found = read(&fields(strength)).unwrap();
    let Measurement::Range { range, stddev, rssi } = found.readings[0].measurement else { panic!("{found:?}") };
    assert!((range - 10.0).abs() < 1e-9 && (stddev - 4.605).abs() < 1e-3 && rssi == -60.0);
    let with_stddev = fields(|fields| {
        strength(fields);
        fields.stddev = Some(0.5);
    });
    let Measurement::Range { stddev, .. } = read(&with_stddev).unwrap().readings[1].measurement else { panic!() };
    assert_eq!(stddev, 0.5);
}

#[test]
fn a_bearing_is_read_alone_or_beside_the_range() {
    let degrees = |fields: &mut TagFields| {
        fields.bearing_field = Some("dbm".into());
        fields.bearing_unit = Some(-0.01);
        fields.bearing_stddev_field = Some("deviation".into());
    };
    let found = read(&fields(degrees)).unwrap().readings;
    let bearing = |id: &str, bearing: f64, stddev| LoggedReading {
        tag_id: id.into(),
        measurement: Measurement::Bearing { bearing, stddev },
    };
    assert_eq!(found, [bearing("7", 0.6, 0.2), bearing("8", 0.4, 0.3)]);
    let both = |fields: &mut TagFields| {
        degrees(fields);
        fields.range_field = Some("distance_mm".into());
        fields.range_unit = Some(0.001);
        fields.bearing_stddev_field = None;
        fields.bearing_stddev = Some(0.05);
    };
    let found = read(&fields(both)).unwrap().readings;
    assert_eq!((found.len(), &found[1]), (4, &bearing("7", 0.6, 0.05)));
    assert!(matches!(&found[2].measurement, Measurement::Range { range: 2.5, .. }), "{found:?}");
}

#[test]
fn fields_that_are_not_there_are_named() {
    let range = |field: &str| {
        let field = field.to_owned();
        read(&fields(|fields| fields.range_field = Some(field))).unwrap_err()
    };
    assert!(range("distance").contains("`distance`") && range("distance").contains("distance_mm"));
    assert!(range("a b").contains("is not a field path"));
    assert!(read(&fields(|_| ())).unwrap_err().contains("is set"));
    let no_array = TagFields { each: Some("header".into()), ..fields(|fields| fields.range_field = Some("x".into())) };
    assert!(read(&no_array).unwrap_err().contains("`header` is not an array"));
    let no_id = TagFields { id_field: "dbm".into(), ..fields(|fields| fields.range_field = Some("dbm".into())) };
    assert!(read(&no_id).unwrap_err().contains("neither a string nor an integer"));
    let unknown =
        TagReader::new(&channel("p/msg/Unknown", ""), &fields(|fields| fields.range_field = Some("x".into())));
    assert!(unknown.unwrap_err().contains("p/msg/Unknown"));
}

#[test]
fn a_sensors_range_is_named_by_its_frame_without_the_robot() {
    let name = "sensor_msgs/msg/Range";
    let range = (Header::new(LogTime(1), "robot1/tag7"), 1u8, 0.1f32, 0.1f32, 5.0f32, 1.25f32);
    // Humble and older logs may lack definitions; since Iron the type has a variance after the range.
    let before = crate::schemas::schema_text(name).unwrap();
    let since = before.replacen("float32 range\n", "float32 range\nfloat32 variance\n", 1);
    assert_ne!(before, since);
    let old = encode(&range).unwrap();
    let new = |variance: f32| encode(&(range.clone(), variance)).unwrap();
    let cases = [("", old.clone(), 0.0), (&before, old, 0.0), (&since, new(0.0), 0.0), (&since, new(0.25), 0.5)];
    for (text, bytes, stddev) in cases {
        let reader = TagReader::new(&channel(name, text), &known_fields(name).unwrap()).unwrap();
        let found = reader.read("robot1", &bytes).unwrap();
        let measurement = Measurement::Range { range: 1.25, stddev, rssi: 0.0 };
        assert_eq!(found.readings, [LoggedReading { tag_id: "tag7".into(), measurement }]);
        assert!(reader.read("robot1", b"cut").is_err());
    }
}

/// The published definition of a detector message, with those of the types that it uses.
fn published(text: &str, parts: &[(&str, &str)]) -> String {
    let separator = "=".repeat(80);
    let standard = ["geometry_msgs/PoseWithCovarianceStamped", "std_msgs/Header"].map(|name| {
        let text = crate::schemas::schema_text(name).unwrap();
        format!("\n{separator}\nMSG: {name}\n{text}")
    });
    let parts = parts.iter().map(|(name, text)| format!("\n{separator}\nMSG: {name}\n{text}"));
    parts.chain(standard).fold(text.to_owned(), |whole, part| whole + &part)
}

/// A pose whose position is checked: x, y, z and a quaternion.
const POSE: [f64; 7] = [0.5, -0.25, 2.0, 0.0, 0.0, 0.0, 1.0];

#[test]
fn tags_of_isaac_ros_are_read_by_its_published_definition() {
    let name = "isaac_ros_apriltag_interfaces/msg/AprilTagDetectionArray";
    let detection = "string family\nint32 id\ngeometry_msgs/Point center      # centre in (x,y) pixel coordinates\n\
        geometry_msgs/Point[4] corners  # corners of tag ((x1,y1),(x2,y2),...)\n\
        geometry_msgs/PoseWithCovarianceStamped pose\n";
    let text = published(
        "std_msgs/Header header\nAprilTagDetection[] detections\n",
        &[("isaac_ros_apriltag_interfaces/AprilTagDetection", detection)],
    );
    let header = Header::new(LogTime(3_000_000_004), "camera");
    let covariance = [[0.0f64; 6]; 6];
    let of_tag = |id: i32| ("36h11", id, [320.0f64, 240.0, 0.0], [[0.0f64; 3]; 4], (header.clone(), POSE, covariance));
    let bytes = encode(&(header.clone(), vec![of_tag(5), of_tag(12)])).unwrap();
    let reader = TagReader::new(&channel(name, &text), &known_fields(name).unwrap()).unwrap();
    let found = reader.read("robot1", &bytes).unwrap();
    let seen = |id: &str| LoggedReading {
        tag_id: id.into(),
        measurement: Measurement::Position(Point3::new(0.5, -0.25, 2.0)),
    };
    assert_eq!(found.readings, [seen("36h11:5"), seen("36h11:12")]);
    assert_eq!((found.stamp, found.frame_id.as_str()), (Time { sec: 3, nanosec: 4 }, "camera"));
}

/// The published definition of `aruco_opencv_msgs/msg/ArucoDetection`.
fn aruco_opencv() -> String {
    published(
        "std_msgs/Header header\naruco_opencv_msgs/MarkerPose[] markers\naruco_opencv_msgs/BoardPose[] boards",
        &[
            ("aruco_opencv_msgs/MarkerPose", "uint16 marker_id\ngeometry_msgs/Pose pose\n"),
            ("aruco_opencv_msgs/BoardPose", "string board_name\ngeometry_msgs/Pose pose\n"),
        ],
    )
}

#[test]
fn tags_of_aruco_opencv_are_read_by_its_published_definition() {
    let name = "aruco_opencv_msgs/msg/ArucoDetection";
    let text = aruco_opencv();
    let header = Header::new(LogTime(1), "camera");
    let bytes = encode(&(header, vec![(7u16, POSE)], vec![("board", POSE)])).unwrap();
    let reader = TagReader::new(&channel(name, &text), &known_fields(name).unwrap()).unwrap();
    let measurement = Measurement::Position(Point3::new(0.5, -0.25, 2.0));
    assert_eq!(reader.read("robot1", &bytes).unwrap().readings, [LoggedReading { tag_id: "7".into(), measurement }]);
}

#[test]
fn tags_on_a_topic_that_is_too_long_are_no_robots() {
    let map = Channel { topic: "/robot1/map".into(), ..channel(OccupancyGrid::NAME, "") };
    let tags = |length: usize| Channel {
        topic: format!("/robot1/{}", "x".repeat(length - 8)),
        ..channel("aruco_opencv_msgs/msg/ArucoDetection", &aruco_opencv())
    };
    for (length, role) in [(128, Role::TagMessage), (129, Role::Other)] {
        let tags = tags(length);
        let roles = RobotChannels::new(RobotTopics::default(), [&map, &tags].into_iter());
        assert_eq!(roles.classify(&tags).role, role, "{length} bytes");
    }
}

#[test]
fn frames_of_tags_are_distinguished_from_other_frames() {
    let of = |frame| tag_of_frame(frame);
    assert_eq!((of("tag36h11:5"), of("robot1/36h11:12")), (Some("tag36h11:5"), Some("36h11:12")));
    for other in ["base_link", "robot1/base_link", "a:b", ":1", "a:", "robot1/", ""] {
        assert_eq!(of(other), None, "{other}");
    }
}
