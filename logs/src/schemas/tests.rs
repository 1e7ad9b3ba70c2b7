//! The definitions are compared with the Rust types by an independent CDR reader that uses only the definitions.

use super::*;
use crate::dynamic::{JsonOptions, Schema};
use gridweave_runtime::ros::*;
use serde::Serialize;
use serde_json::{Value, json};

/// Decodes `message` by the definition of `name`. All its bytes must be used.
fn read_by_schema(name: &str, message: &[u8]) -> Value {
    let schema = Schema::parse(name, &schema_text(name).unwrap()).unwrap();
    assert!(schema.decode(&message[..message.len() - 1]).is_err(), "{name}: every byte is read");
    schema.decode(message).unwrap().to_json(JsonOptions::default())
}

/// Asserts that every field is decoded with its name and value.
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
    let covariance = [3.0, 4.0, 5.0, 6.0];
    let bearing = TagBearing { header: header(), tag_id: "tag1".into(), x: 0.1, y: -0.2, ..Default::default() };
    assert_agrees(&TagBearing { bearing: 1.5, bearing_stddev: 0.02, ..bearing });
    assert_agrees(&TagPosition { header: header(), tag_id: "tag36h11:5".into(), x: 1.0, y: -2.0, covariance });
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
fn markers_agree_with_their_definitions() {
    let color = ColorRGBA { r: 0.25, g: 0.5, b: 0.75, a: 1.0 };
    let marker = |text: &str| Marker {
        header: header(),
        ns: "walls".into(),
        id: 3,
        shape: Marker::LINE_LIST,
        action: Marker::DELETE_ALL,
        pose: pose(),
        scale: Vector3 { x: 1.0, y: 2.0, z: 3.0 },
        color,
        lifetime: Duration { sec: 1, nanosec: 2 },
        frame_locked: true,
        points: vec![Point { x: 1.0, y: 2.0, z: 3.0 }; 3],
        colors: vec![color; 3],
        texture_resource: "a".into(),
        texture: CompressedImage { header: header(), format: "png".into(), data: vec![] },
        uv_coordinates: vec![UVCoordinate { u: 0.5, v: 0.25 }],
        text: text.into(),
        mesh_resource: "b".into(),
        mesh_file: MeshFile { filename: "c".into(), data: vec![] },
        mesh_use_embedded_materials: true,
    };
    assert_agrees(&MarkerArray { markers: vec![marker("tag00"), marker(""), marker("t")] });
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
fn a_topological_map_agrees_with_its_definition() {
    let node = |x: f64, kind: &str| TopologicalNode { x, y: 2.0, kind: kind.into(), probability: 0.75 };
    let path = |start: u32, end: u32| TopologicalPath {
        start,
        end,
        length: 3.5,
        probability: 0.5,
        points: vec![pose().position, Point { x: 4.0, y: 5.0, z: 6.0 }],
    };
    assert_agrees(&TopologicalMap {
        header: header(),
        robot: "robot1".into(),
        nodes: vec![node(1.0, "end"), node(3.0, "junction"), node(5.0, "")],
        paths: vec![path(0, 1), path(2, 1)],
    });
}

#[test]
fn result_messages_agree_with_their_definitions() {
    let covariance = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0];
    assert_agrees(&Alignment {
        header: header(),
        a: "robot1".into(),
        b: "robot2".into(),
        source: "maps".into(),
        has_transform: true,
        x: 1.0,
        y: 2.0,
        yaw: 3.0,
        covariance,
        score: 0.5,
        margin: 0.5,
        method: "icp".into(),
        accepted: true,
        provisional: true,
        rank: 1,
        hypotheses: 3,
        reason: "it fits".into(),
    });
    assert_agrees(&IcpErrors {
        header: header(),
        a: "robot1".into(),
        b: "robot2".into(),
        source: "maps".into(),
        rank: 2,
        accepted: true,
        errors: vec![0.5, 0.25],
    });
    let stage = |name: &str| StageProgress {
        name: name.into(),
        state: "running".into(),
        messages_in: 1,
        messages_out: 2,
        in_per_s: 3.5,
        out_per_s: 4.5,
        busy: 0.25,
        dropped: 5,
        restarts: 6,
        warnings: 7,
    };
    let stages = vec![stage("robots"), stage("map_aligner")];
    assert_agrees(&MachineStages { header: header(), machine: "robot1".into(), interval: 2.0, stages });
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
        groups: vec![RobotGroup {
            reference: "r3".into(),
            frame_id: "world/r3".into(),
            frames: vec![frame("r3"), frame("robot4")],
        }],
    });
}

#[test]
fn deformations_and_agreements_agree_with_their_definitions() {
    let covariance = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0];
    let node = DeformationNode { x: 1.0, y: 2.0, dx: 0.25, dy: 0.5, dyaw: 0.125, covariance };
    assert_agrees(&MapDeformation {
        header: header(),
        robot: "robot22".into(),
        spacing: 3.0,
        nodes: vec![node, node],
        wall_matched: 40.0,
        sharpness_rigid: Sharpness { apart: 0.25, doubled: 0.5 },
        sharpness: Sharpness { apart: 0.0625, doubled: 0.125 },
        bend: 0.5,
        turn: 0.25,
    });
    assert_agrees(&MapAgreement { header: header(), known_to_one: 1.0, known_to_several: 2.0, in_conflict: 0.5 });
}

#[test]
fn a_truth_agrees_with_its_definition() {
    assert_agrees(&SimulationTruth {
        header: header(),
        resolution: 0.05,
        frames: vec![TrueFrame { robot: "robot1".into(), x: 1.0, y: 2.0, yaw: 3.0, centre: [4.0, 5.0] }],
        tags: vec![TrueTag { tag_id: "tag1".into(), x: 1.0, y: 2.0 }],
        common: vec![CommonPlace { first: [1.0, 2.0], second: [3.0, 4.0] }; 2],
    });
}

#[test]
fn standard_messages_agree_with_their_definitions() {
    let stamped = PoseStamped { header: header(), pose: pose() };
    assert_agrees(&stamped);
    assert_agrees(&Path { header: header(), poses: vec![stamped.clone(), stamped] });
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
    let info = MapMetaData { map_load_time, resolution: 0.0625, width: 3, height: 1, origin: pose() };
    let message = encode(&OccupancyGrid { header: header(), info, data: &[0xff, 0, 100] }).unwrap();
    let expected = json!({ "header": header(), "info": info, "data": [-1, 0, 100] });
    assert_eq!(read_by_schema(OccupancyGrid::NAME, &message), expected);
}

#[test]
fn a_grid_update_agrees_with_its_definition() {
    let update = OccupancyGridUpdate { header: header(), x: -1, y: 2, width: 3, height: 1, data: &[0xff, 0, 100] };
    let expected = json!({ "header": header(), "x": -1, "y": 2, "width": 3, "height": 1, "data": [-1, 0, 100] });
    assert_eq!(read_by_schema(OccupancyGridUpdate::NAME, &encode(&update).unwrap()), expected);
}

/// The Rust types store covariances as rows, and the twist in parts, so the field names differ; the values must be in
/// the same order.
#[test]
fn odometry_and_poses_with_covariance_agree_with_their_definitions() {
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
    let pose = PoseWithCovarianceStamped { header: header(), pose: message.pose };
    for (name, bytes, value) in [
        (Odometry::NAME, encode(&message).unwrap(), serde_json::to_value(&message).unwrap()),
        (PoseWithCovarianceStamped::NAME, encode(&pose).unwrap(), serde_json::to_value(&pose).unwrap()),
    ] {
        let (mut read, mut written) = (Vec::new(), Vec::new());
        numbers(&read_by_schema(name, &bytes), &mut read);
        numbers(&value, &mut written);
        assert_eq!(read, written, "{name}");
        assert!(read.len() >= 45);
    }
}

#[test]
fn every_definition_uses_only_defined_types() {
    assert_eq!(schema_names().count(), DEFINITIONS.len());
    for name in schema_names() {
        Schema::parse(&name, &schema_text(&name).unwrap()).unwrap();
    }
    assert!(DEFINITIONS.is_sorted());
}

#[test]
fn a_schema_has_the_format_of_a_bag() {
    let schema = schema_text("geometry_msgs/msg/PoseStamped").unwrap();
    let titles: Vec<&str> = schema.lines().filter(|line| line.starts_with("MSG: ")).collect();
    let expected = ["std_msgs/Header", "builtin_interfaces/Time", "geometry_msgs/Pose", "geometry_msgs/Point"];
    assert_eq!(titles[..4], expected.map(|name| format!("MSG: {name}")));
    assert_eq!(titles[4..], ["MSG: geometry_msgs/Quaternion"]);
    assert_eq!(schema.lines().filter(|line| *line == "=".repeat(80)).count(), 5);
    assert_eq!(schema_text("geometry_msgs/PoseStamped").unwrap(), schema);
    assert_eq!(schema_text("visualization_msgs/msg/MenuEntry"), None);
    assert_eq!(schema_text(""), None);
}

#[test]
fn scans_agree_with_their_definitions() {
    let ranges = vec![1.5, 2.5, 3.5];
    assert_agrees(&LaserScan {
        header: header(),
        angle_min: -1.5,
        angle_max: 1.5,
        angle_increment: 0.25,
        time_increment: 0.125,
        scan_time: 0.5,
        range_min: 0.0625,
        range_max: 30.0,
        ranges: ranges.clone(),
        intensities: vec![7.0],
    });
    let beam = |echoes: &[f32]| LaserEcho { echoes: echoes.to_vec() };
    assert_agrees(&MultiEchoLaserScan {
        header: header(),
        angle_min: -1.5,
        ranges: vec![beam(&[1.5, 2.5]), beam(&[]), beam(&[3.5])],
        intensities: vec![beam(&[7.0])],
        ..Default::default()
    });
    assert_agrees(&PointCloud2 {
        header: header(),
        height: 2,
        width: 3,
        fields: vec![PointField { name: "x".into(), offset: 4, datatype: PointField::FLOAT32, count: 1 }],
        is_bigendian: true,
        point_step: 5,
        row_step: 15,
        data: &[7; 30],
        is_dense: true,
    });
    assert_agrees(&RangeScan {
        header: header(),
        x: 0.25,
        y: -0.5,
        yaw: 0.125,
        angle_min: -1.5,
        angle_increment: 0.25,
        time_increment: 0.0625,
        range_min: 0.5,
        range_max: 30.0,
        ranges,
    });
}
