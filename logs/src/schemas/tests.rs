//! The definitions are held against the Rust types by a reader of CDR that knows nothing but the definitions.

use super::*;
use gridweave_runtime::ros::*;
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// Reads CDR as a schema says.
struct Walker<'a> {
    types: BTreeMap<String, Vec<(String, String)>>,
    body: &'a [u8],
    at: usize,
}

impl<'a> Walker<'a> {
    fn new(name: &str, schema: &str, message: &'a [u8]) -> Self {
        assert_eq!(message[..4], [0, 1, 0, 0], "little-endian CDR");
        let mut types = BTreeMap::new();
        let mut current = name.replacen("/msg/", "/", 1);
        for section in schema.split(&format!("{}\n", "=".repeat(80))) {
            let body = match section.strip_prefix("MSG: ") {
                Some(rest) => {
                    let (name, body) = rest.split_once('\n').unwrap();
                    current = name.to_owned();
                    body
                }
                None => section,
            };
            let fields = body.lines().filter_map(|line| {
                let mut words = line.split('#').next().unwrap().split_whitespace();
                Some((words.next()?.to_owned(), words.next().unwrap().to_owned()))
            });
            assert!(types.insert(current.clone(), fields.collect()).is_none(), "{current} is defined twice");
        }
        Self { types, body: &message[4..], at: 0 }
    }

    fn take<const N: usize>(&mut self) -> [u8; N] {
        self.at = self.at.next_multiple_of(N);
        let bytes = self.body[self.at..self.at + N].try_into().unwrap();
        self.at += N;
        bytes
    }

    fn value(&mut self, of: &str) -> Value {
        if let Some((element, count)) = of.strip_suffix(']').and_then(|of| of.split_once('[')) {
            let count = match count {
                "" => u32::from_le_bytes(self.take()) as usize,
                fixed => fixed.parse().unwrap(),
            };
            return (0..count).map(|_| self.value(element)).collect();
        }
        match of {
            "bool" => json!(self.take::<1>() == [1]),
            "int8" => json!(i8::from_le_bytes(self.take())),
            "int32" => json!(i32::from_le_bytes(self.take())),
            "uint32" => json!(u32::from_le_bytes(self.take())),
            "float32" => json!(f32::from_le_bytes(self.take())),
            "float64" => json!(f64::from_le_bytes(self.take())),
            "string" => {
                let length = u32::from_le_bytes(self.take()) as usize;
                let text = &self.body[self.at..self.at + length];
                self.at += length;
                json!(std::str::from_utf8(text).unwrap().strip_suffix('\0').unwrap())
            }
            name => {
                let fields = self.types.get(name).unwrap_or_else(|| panic!("{name} is not defined")).clone();
                fields.into_iter().map(|(of, field)| (field, self.value(&of))).collect::<Map<_, _>>().into()
            }
        }
    }
}

/// What the schema of `name` reads in the bytes of `message`, all of which it must use.
fn read_by_schema(name: &str, message: &[u8]) -> Value {
    let schema = schema_text(name).unwrap();
    let mut walker = Walker::new(name, &schema, message);
    let value = walker.value(&name.replacen("/msg/", "/", 1));
    assert_eq!(walker.at, walker.body.len(), "{name}: every byte is read");
    value
}

/// Every field is read with its name and value.
#[track_caller]
fn assert_agrees<T: RosMessage + Serialize>(message: &T) {
    assert_eq!(read_by_schema(T::NAME, &encode(message).unwrap()), serde_json::to_value(message).unwrap());
}

fn header() -> Header {
    Header { stamp: Time { sec: 7, nanosec: 9 }, frame_id: "robot1/map".into() }
}

fn pose() -> Pose {
    let orientation = Quaternion { x: 0.1, y: 0.2, z: 0.3, w: 0.4 };
    Pose { position: Point { x: 1.5, y: -2.5, z: 3.5 }, orientation }
}

#[test]
fn tag_messages_agree_with_their_definitions() {
    assert_agrees(&TagRange { header: header(), tag_id: "t".into(), range: 2.5, range_stddev: 0.05, rssi: -61.5 });
    let estimate = |tag_id: &str| TagEstimate {
        tag_id: tag_id.into(),
        x: 1.0,
        y: 2.0,
        covariance: [3.0, 4.0, 5.0, 6.0],
        certainty: 0.75,
        readings: 12,
    };
    let tags = vec![estimate("tag00"), estimate(""), estimate("tag1")];
    assert_agrees(&TagEstimates { header: header(), robot: "robot1".into(), tags });
    let common = |tag_id: &str| CommonTag {
        tag_id: tag_id.into(),
        a: [1.0, 2.0],
        b: [3.0, 4.0],
        covariance_a: [5.0, 6.0, 7.0, 8.0],
        covariance_b: [9.0, 10.0, 11.0, 12.0],
        certainty_a: 0.8,
        certainty_b: 0.9,
    };
    assert_agrees(&CommonTags {
        header: header(),
        robot_a: "robot1".into(),
        robot_b: "robot22".into(),
        tags: vec![common("tag00"), common("tag1")],
        accepted: true,
        provisional: true,
        reason: "three tags".into(),
    });
}

#[test]
fn wall_messages_agree_with_their_definitions() {
    let segment = Segment { x1: 1.0, y1: 2.0, x2: 3.0, y2: 4.0, reliability: 0.5, inliers: 33 };
    assert_agrees(&Segments { header: header(), robot: "r".into(), segments: vec![segment, segment] });
    assert_agrees(&MapDirection {
        header: header(),
        robot: "robot1".into(),
        direction: 0.1,
        deviation: 0.2,
        groups: [0.3, 0.4],
        agreement: 0.5,
        valid: true,
    });
}

#[test]
fn result_messages_agree_with_their_definitions() {
    let covariance = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0];
    assert_agrees(&Alignment {
        header: header(),
        a: "robot1".into(),
        b: "robot2".into(),
        x: 1.0,
        y: 2.0,
        yaw: 3.0,
        covariance,
        score: 0.5,
        method: "icp".into(),
        accepted: true,
        provisional: true,
        reason: "it fits".into(),
    });
    let frame = |robot: &str| RobotFrame {
        robot: robot.into(),
        frame_id: format!("{robot}/map"),
        x: 1.0,
        y: 2.0,
        yaw: 3.0,
        covariance,
    };
    assert_agrees(&RobotFrames {
        header: header(),
        reference: "robot1".into(),
        frames: vec![frame("robot1"), frame("robot10")],
        unmerged: vec![UnmergedRobot { robot: "r3".into(), reason: "no common tags".into() }; 2],
    });
}

#[test]
fn standard_messages_agree_with_their_definitions() {
    assert_agrees(&PoseStamped { header: header(), pose: pose() });
    let transform = TransformStamped {
        header: header(),
        child_frame_id: "robot2/map".into(),
        transform: Transform { translation: Vector3 { x: 1.0, y: 2.0, z: 3.0 }, rotation: pose().orientation },
    };
    assert_agrees(&TFMessage { transforms: vec![transform.clone(), transform] });
}

#[test]
fn a_grid_agrees_with_its_definition() {
    let map_load_time = Time { sec: 3, nanosec: 4 };
    let info = MapMetaData { map_load_time, resolution: 0.05, width: 3, height: 1, origin: pose() };
    let message = encode(&OccupancyGrid { header: header(), info, data: &[0xff, 0, 100] }).unwrap();
    let expected = json!({ "header": header(), "info": info, "data": [-1, 0, 100] });
    assert_eq!(read_by_schema(OccupancyGrid::NAME, &message), expected);
}

/// The Rust type holds the twist in parts, so that names differ; the values must come in the same order.
#[test]
fn odometry_agrees_with_its_definition() {
    fn numbers(value: &Value, into: &mut Vec<f64>) {
        match value {
            Value::Array(items) => items.iter().for_each(|item| numbers(item, into)),
            Value::Object(fields) => fields.values().for_each(|field| numbers(field, into)),
            other => into.extend(other.as_f64()),
        }
    }
    let square = |start: usize| std::array::from_fn(|r| std::array::from_fn(|c| (start + r * 6 + c) as f64));
    let message = Odometry {
        header: header(),
        child_frame_id: "base".into(),
        pose: PoseWithCovariance { pose: pose(), covariance: square(100) },
        twist_linear: Vector3 { x: 1.0, y: 2.0, z: 3.0 },
        twist_angular: Vector3 { x: 4.0, y: 5.0, z: 6.0 },
        twist_covariance: square(200),
    };
    let (mut read, mut written) = (Vec::new(), Vec::new());
    numbers(&read_by_schema(Odometry::NAME, &encode(&message).unwrap()), &mut read);
    numbers(&serde_json::to_value(&message).unwrap(), &mut written);
    assert_eq!(read, written);
}

#[test]
fn every_definition_uses_only_types_that_are_there() {
    let basic = ["bool", "int8", "int32", "uint32", "float32", "float64", "string"];
    assert_eq!(schema_names().count(), DEFINITIONS.len());
    for name in schema_names() {
        let schema = schema_text(&name).unwrap();
        let walker = Walker::new(&name, &schema, &[0, 1, 0, 0]);
        for (of, field) in walker.types.values().flatten() {
            let element = of.split('[').next().unwrap();
            assert!(basic.contains(&element) || walker.types.contains_key(element), "{name}: {of} {field}");
        }
    }
    assert!(DEFINITIONS.is_sorted());
}

#[test]
fn a_schema_is_laid_out_as_in_a_bag() {
    let schema = schema_text("geometry_msgs/msg/PoseStamped").unwrap();
    let titles: Vec<&str> = schema.lines().filter(|line| line.starts_with("MSG: ")).collect();
    let expected = ["std_msgs/Header", "builtin_interfaces/Time", "geometry_msgs/Pose", "geometry_msgs/Point"];
    assert_eq!(titles[..4], expected.map(|name| format!("MSG: {name}")));
    assert_eq!(titles[4..], ["MSG: geometry_msgs/Quaternion"]);
    assert_eq!(schema.lines().filter(|line| *line == "=".repeat(80)).count(), 5);
    assert_eq!(schema_text("geometry_msgs/PoseStamped").unwrap(), schema);
    assert_eq!(schema_text("sensor_msgs/msg/LaserScan"), None);
    assert_eq!(schema_text(""), None);
}
