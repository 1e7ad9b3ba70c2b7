//! MCAP logs: opened, read message by message, looked into by their own schemas, and passed on by the stages that read
//! and write logs.

use super::input::Input;
use super::target::Target;
use gridweave::shipped::registry;
use gridweave_logs::dynamic::{JsonOptions, Schema};
use gridweave_logs::info::inspect;
use gridweave_logs::names::{self, NameRules};
use gridweave_logs::reader;
use gridweave_logs::schemas::schema_text;
use gridweave_runtime::engine::{EngineKind, run};
use gridweave_runtime::pipeline::{Overrides, Pipeline};
use gridweave_runtime::ros::{OccupancyGrid, PoseStamped, RosMessage, TFMessage, TagRange, TransformStamped, encode};
use gridweave_runtime::stage::RobotTopics;
use gridweave_tests::{TestMap, header};
use mcap::records::{MessageHeader, Metadata};
use mcap::{Compression, WriteOptions};
use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

const LOG: &str = "in.mcap";

/// Passes on all of a log.
const PASS_ON: &str = r#"
[pipeline]
name = "pass_on"

[robots]
map = "/{robot}/map"
pose = "/{robot}/pose"
tags = "/{robot}/tag_ranges"

[stages.log]
kind = "mcap_source"

[stages.output]
kind = "mcap_sink"
inputs = ["log.*"]
"#;

#[test]
fn every_log_is_read_or_refused() {
    // Chunks without checksums let through what is changed in them.
    let plain = || WriteOptions::new().compression(None).calculate_chunk_crcs(false);
    let seeds = [
        WriteOptions::new().use_chunks(false),
        plain().calculate_summary_section_crc(false),
        plain().emit_summary_records(false),
        WriteOptions::new().compression(Some(Compression::Lz4)).calculate_chunk_crcs(false),
        WriteOptions::new().compression(Some(Compression::Zstd)),
    ];
    Target {
        name: "mcap_logs",
        files: &[LOG],
        seeds: seeds.into_iter().map(|options| Input(vec![small_log(options)])).collect(),
        words: &["lz4", "zstd", "/robot1/map", "\u{89}MCAP0\r\n"],
        cases: 1500,
        read,
    }
    .check();
}

/// A log of each kind of message that is looked into, in two chunks if it has chunks.
pub(crate) fn small_log(options: WriteOptions) -> Vec<u8> {
    let mut log = mcap::Writer::with_options(Cursor::new(Vec::new()), options.profile("ros2")).unwrap();
    let write = |log: &mut mcap::Writer<_>, topic: &str, name: &str, time: u64, bytes: &[u8]| {
        let schema = log.add_schema(name, "ros2msg", schema_text(name).unwrap().as_bytes()).unwrap();
        let metadata = BTreeMap::from([("offered_qos_profiles".to_owned(), "".to_owned())]);
        let channel_id = log.add_channel(schema, topic, "cdr", &metadata).unwrap();
        let header = MessageHeader { channel_id, sequence: 1, log_time: time, publish_time: time };
        log.write_to_known_channel(&header, bytes).unwrap();
    };
    let cells = vec![0; 12];
    for robot in ["robot1", "robot2"] {
        let header = header(1.0, format!("{robot}/map"));
        let info = TestMap::filled(4, 3, 0.05, 0).info;
        let grid = OccupancyGrid { header: header.clone(), info, data: &cells };
        write(&mut log, &format!("/{robot}/map"), OccupancyGrid::NAME, 1, &encode(&grid).unwrap());
        let pose = PoseStamped { header: header.clone(), ..Default::default() };
        write(&mut log, &format!("/{robot}/pose"), PoseStamped::NAME, 2, &encode(&pose).unwrap());
        let reading = TagRange { header: header.clone(), tag_id: "tag1".into(), range: 1.0, ..Default::default() };
        write(&mut log, &format!("/{robot}/tag_ranges"), TagRange::NAME, 3, &encode(&reading).unwrap());
        let transform = TransformStamped { header, child_frame_id: format!("{robot}/base_link"), ..Default::default() };
        let transforms = TFMessage { transforms: vec![transform] };
        write(&mut log, "/tf", TFMessage::NAME, 4, &encode(&transforms).unwrap());
        log.flush().unwrap();
    }
    let metadata = BTreeMap::from([("complete".to_owned(), "false".to_owned())]);
    log.write_metadata(&Metadata { name: "gridweave".into(), metadata }).unwrap();
    log.finish().unwrap();
    log.into_inner().into_inner()
}

fn read(folder: &Path) {
    let paths = [folder.join(LOG)];
    let log = names::Input { robot: None, path: folder.join(LOG) };
    let info = inspect(&[log], &NameRules::default(), &RobotTopics::default());
    let Ok(mut log) = reader::open(&paths) else { return };
    let files = log.files().clone();
    let (mut messages, mut last) = (0, 0);
    while let Some(message) = log.next_message() {
        messages += 1;
        assert!(message.log_time.0 >= last, "log time goes back");
        last = message.log_time.0;
        let Some(channel) = files[message.file].channel(message.channel) else { continue };
        let Ok(schema) = Schema::of_channel(&channel) else { continue };
        let _ = schema.decode(message.data).map(|value| value.to_json(JsonOptions::default()).to_string());
    }
    log.take_damage().iter().for_each(|(_, damage)| drop(damage.to_string()));
    assert!(info.is_ok_and(|info| info.messages <= messages));

    let mut overrides = Overrides::default();
    overrides.set_for_kind("mcap_source", "files", vec![paths[0].to_str().unwrap().to_owned()]);
    overrides.set_for_kind("mcap_sink", "file", folder.join("out.mcap").to_str().unwrap().to_owned());
    let pipeline = Pipeline::parse("pass_on", PASS_ON, &registry([]), &overrides).unwrap();
    let _ = run(&pipeline, EngineKind::Single, &());
}
