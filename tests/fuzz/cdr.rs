//! Messages of every type that stages exchange, and what announces a channel: decoded, encoded again, and read by the
//! decoder that knows the types by their definitions only.

use super::input::Input;
use super::target::Target;
use gridweave_logs::dynamic::{JsonOptions, Schema};
use gridweave_logs::schemas::schema_text;
use gridweave_runtime::message::Channel;
use gridweave_runtime::ros::{
    Alignment, CommonTag, CommonTags, MapDirection, OccupancyGrid, Odometry, PoseStamped, PoseWithCovarianceStamped,
    RobotFrame, RobotFrames, RobotGroup, RosMessage, Segment, Segments, TFMessage, TagEstimate, TagEstimates, TagRange,
    TransformStamped, UnmergedRobot, decode, encode,
};
use gridweave_tests::{TestMap, header};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::OnceLock;

const MESSAGE: &str = "message.cdr";

#[test]
fn every_message_is_decoded_or_refused() {
    let mut seeds = messages();
    for seed in seeds.clone() {
        // The same in the other byte order, as far as that is known; its values are absurd then.
        let mut bytes = seed;
        bytes[1] = 0;
        seeds.push(bytes);
    }
    Target {
        name: "cdr",
        files: &[MESSAGE],
        seeds: seeds.into_iter().map(|bytes| Input(vec![bytes])).collect(),
        words: &["robot1/map", "\u{e9}", "\0\0\0\0"],
        cases: 15_000,
        read,
    }
    .check();
}

/// A message of each type, with something in each of its lists.
pub(crate) fn messages() -> Vec<Vec<u8>> {
    let header = header(1.0, "robot1/map");
    let info = TestMap::filled(4, 3, 0.05, 0).info;
    let tag = TagEstimate { tag_id: "tag1".into(), x: 1.0, certainty: 0.9, ..Default::default() };
    let frame = RobotFrame { robot: "robot1".into(), ..Default::default() };
    let frames = RobotFrames {
        header: header.clone(),
        reference: "robot1".into(),
        frames: vec![frame.clone()],
        unmerged: vec![UnmergedRobot { robot: "robot2".into(), reason: "far away".into() }],
        groups: vec![RobotGroup { reference: "robot2".into(), frames: vec![frame], ..Default::default() }],
    };
    let channel = Channel {
        topic: "/scan".into(),
        schema: b"float32[] ranges".to_vec(),
        metadata: BTreeMap::from([("a".into(), "b".into())]),
        ..Default::default()
    };
    vec![
        encode(&OccupancyGrid { header: header.clone(), info, data: &[0; 12] }).unwrap(),
        // No cells, and the greatest height that there is.
        encode(&OccupancyGrid { header: header.clone(), info: TestMap::filled(0, u32::MAX, 0.05, 0).info, data: &[] })
            .unwrap(),
        encode(&Odometry { header: header.clone(), child_frame_id: "base_link".into(), ..Default::default() }).unwrap(),
        encode(&PoseStamped { header: header.clone(), ..Default::default() }).unwrap(),
        encode(&PoseWithCovarianceStamped { header: header.clone(), ..Default::default() }).unwrap(),
        encode(&TFMessage { transforms: vec![TransformStamped { header: header.clone(), ..Default::default() }; 2] })
            .unwrap(),
        encode(&TagRange { header: header.clone(), tag_id: "tag1".into(), ..Default::default() }).unwrap(),
        encode(&TagEstimates { header: header.clone(), robot: "robot1".into(), tags: vec![tag; 2] }).unwrap(),
        encode(&Segments { header: header.clone(), robot: "robot1".into(), segments: vec![Segment::default(); 3] })
            .unwrap(),
        encode(&MapDirection { header: header.clone(), valid: true, ..Default::default() }).unwrap(),
        encode(&CommonTags { header: header.clone(), tags: vec![CommonTag::default(); 2], ..Default::default() })
            .unwrap(),
        encode(&Alignment { header, a: "robot1".into(), b: "robot2".into(), ..Default::default() }).unwrap(),
        encode(&frames).unwrap(),
        channel.encode().unwrap(),
    ]
}

fn read(folder: &Path) {
    let bytes = std::fs::read(folder.join(MESSAGE)).unwrap();
    read_as::<OccupancyGrid<'_>>(&bytes);
    read_as::<Odometry>(&bytes);
    read_as::<PoseStamped>(&bytes);
    read_as::<PoseWithCovarianceStamped>(&bytes);
    read_as::<TFMessage>(&bytes);
    read_as::<TagRange>(&bytes);
    read_as::<TagEstimates>(&bytes);
    read_as::<Segments>(&bytes);
    read_as::<MapDirection>(&bytes);
    read_as::<CommonTags>(&bytes);
    read_as::<Alignment>(&bytes);
    read_as::<RobotFrames>(&bytes);
    if let Ok(channel) = Channel::decode(&bytes) {
        assert_eq!(Channel::decode(&channel.encode().unwrap()).unwrap(), channel);
        let _ = Schema::of_channel(&channel);
    }
}

/// The definitions, by the name of the type.
fn schemas() -> &'static BTreeMap<String, Schema> {
    static SCHEMAS: OnceLock<BTreeMap<String, Schema>> = OnceLock::new();
    SCHEMAS.get_or_init(|| {
        let names = gridweave_logs::schemas::schema_names();
        names.map(|name| (name.clone(), Schema::parse(&name, &schema_text(&name).unwrap()).unwrap())).collect()
    })
}

/// What can be decoded can be encoded, and the other decoder reads that. (Of a text without the zero byte at its end
/// one decoder drops the last letter and the other does not, so it is not asked whether both read `bytes` alike.)
fn read_as<'a, T: RosMessage + Serialize + Deserialize<'a>>(bytes: &'a [u8]) {
    let schema = &schemas()[T::NAME];
    let _ = schema.decode(bytes).map(|value| value.to_json(JsonOptions { longest_array: Some(16) }));
    let Ok(message) = decode::<T>(bytes) else { return };
    let again = encode(&message).unwrap();
    let value = schema.decode(&again).unwrap_or_else(|error| panic!("{}: {error}", T::NAME));
    drop(value.to_json(JsonOptions::default()));
}
