//! The content of a log.

use super::*;

#[test]
fn results_and_input_are_written_with_all_that_is_known_of_them() {
    let mut run = Run::new("");
    run.announce(0, 7, "/robot1/scan", "sensor_msgs/msg/LaserScan");
    run.input(0, 7, 5, b"scan").unwrap();
    let grid = ros::encode(&OccupancyGrid::default()).unwrap();
    run.result(2, "/map", 6, &grid).unwrap();
    run.result(2, "/map", 9, &grid).unwrap();
    run.finish();

    let log = run.log();
    let read = |topic: &str, name: &str, sequence, time, bytes: &[u8]| -> Read {
        (topic.into(), name.into(), sequence, time, time + 1, bytes.to_vec())
    };
    assert_eq!(
        log.messages,
        [
            read("/robot1/scan", "sensor_msgs/msg/LaserScan", 45, 5, b"scan"),
            read("/map", GRID, 0, 6, &grid),
            read("/map", GRID, 1, 9, &grid)
        ]
    );
    let [scan, map] = log.channels.as_slice() else { panic!("two channels") };
    assert_eq!(scan.metadata["offered_qos_profiles"], "theirs");
    assert_eq!(scan.schema.as_ref().unwrap().data.as_ref(), b"# from the input");
    let schema = map.schema.as_ref().unwrap();
    assert_eq!((map.message_encoding.as_str(), schema.encoding.as_str()), ("cdr", "ros2msg"));
    assert_eq!(schema.data.as_ref(), crate::schemas::schema_text(GRID).unwrap().as_bytes());
    assert!(map.metadata["offered_qos_profiles"].contains("durability: 1"));
    assert_eq!(log.outcome, BTreeMap::from([("complete".into(), "true".into())]));
    assert!(run.sink.warnings().is_empty());
}

#[test]
fn equal_channels_of_two_sources_are_one_and_equal_numbers_are_not() {
    let mut run = Run::new("");
    run.announce(0, 1, "/tf", TF);
    run.announce(1, 1, "/robot2/pose", "geometry_msgs/msg/PoseStamped");
    run.announce(1, 2, "/tf", TF);
    for (wire, number, time) in [(0, 1, 1), (1, 1, 2), (1, 2, 3), (0, 1, 4)] {
        run.input(wire, number, time, b"").unwrap();
    }
    run.finish();
    let log = run.log();
    assert_eq!(log.topics(), ["/tf", "/robot2/pose", "/tf", "/tf"]);
    assert_eq!(log.channels.len(), 2);
}

#[test]
fn without_the_input_only_results_are_written() {
    let mut run = Run::new("pass_input = false");
    run.announce(0, 1, "/tf", TF);
    run.input(0, 1, 1, b"").unwrap();
    run.result(4, "/robot1/lines/segments", 2, &ros::encode(&Segments::default()).unwrap()).unwrap();
    run.finish();
    assert_eq!(run.log().topics(), ["/robot1/lines/segments"]);
}

#[test]
fn only_the_topics_that_are_asked_for_are_written() {
    let mut run = Run::new("only_topics = [\"/{robot}/lines/segments\", \"/robot1/scan\"]");
    for (number, topic) in [(1, "/robot1/scan"), (2, "/robot2/scan")] {
        run.announce(0, number, topic, "sensor_msgs/msg/LaserScan");
        run.input(0, number, 1, b"scan").unwrap();
    }
    run.result(2, "/map", 2, b"map").unwrap();
    run.result(4, "/robot1/lines/segments", 3, b"segments").unwrap();
    run.finish();
    assert_eq!(run.log().topics(), ["/robot1/scan", "/robot1/lines/segments"]);
}

#[test]
fn input_messages_on_the_topic_of_a_result_are_dropped() {
    let mut run = Run::new("");
    run.announce(0, 1, "/map", GRID);
    run.announce(0, 2, "/robot1/lines/segments", "std_msgs/msg/String");
    run.announce(0, 3, "/robot1/map", GRID);
    for (number, time) in [(1, 1), (2, 2), (1, 3), (3, 4)] {
        run.input(0, number, time, b"").unwrap();
    }
    run.result(2, "/map", 5, b"ours").unwrap();
    run.finish();
    assert_eq!(run.log().topics(), ["/robot1/map", "/map"]);
    let warnings = run.sink.warnings();
    let warnings: Vec<_> = warnings.iter().map(|(text, count)| (text.as_str(), *count)).collect();
    let text = |topic| format!("the input's messages on {topic} were dropped: a result of this run has that topic");
    assert_eq!(warnings, [(text("/map").as_str(), 2), (text("/robot1/lines/segments").as_str(), 1)]);
}

#[test]
fn transforms_of_input_and_result_share_a_channel() {
    let mut run = Run::new("");
    run.announce(0, 1, "/tf_static", TF);
    run.input(0, 1, 1, b"").unwrap();
    run.result(3, "/tf_static", 2, &ros::encode(&TFMessage::default()).unwrap()).unwrap();
    run.finish();
    let log = run.log();
    assert_eq!(log.topics(), ["/tf_static", "/tf_static"]);
    assert_eq!(log.channels.len(), 1);
    assert!(log.channels[0].metadata["offered_qos_profiles"].contains("durability: 1"));
}

#[test]
fn the_same_messages_give_the_same_bytes() {
    let write = |compression: &str| {
        let mut run = Run::new(&format!("compression = \"{compression}\"\nchunk_size = 5000"));
        run.announce(0, 1, "/tf", TF);
        for time in 0..500 {
            run.input(0, 1, time, &time.to_le_bytes()).unwrap();
            run.result(2, "/map", time, &[time as u8; 300]).unwrap();
        }
        run.finish();
        assert_eq!(run.log().messages.len(), 1000);
        assert!(run.log().chunks > 10);
        fs::read(run.file()).unwrap()
    };
    for compression in ["zstd", "lz4", "none"] {
        assert!(write(compression) == write(compression), "{compression}");
    }
}

#[test]
fn a_large_message_has_a_separate_chunk() {
    let mut run = Run::new("chunk_size = 10000");
    for size in [10, 20, 50_000, 10] {
        run.result(2, "/map", 1, &vec![0; size]).unwrap();
    }
    run.finish();
    assert_eq!(run.log().chunks, 3);
}

#[test]
fn parameters_out_of_range_are_reported() {
    let check = |text: &str| kind().check_parameters(&text.parse().unwrap());
    assert!(check("chunk_size = 4096").unwrap().is_empty());
    assert_eq!(check("chunk_size = 10").unwrap()[0].field, "chunk_size");
    assert!(check("compression = \"gzip\"").is_err());
    assert!(check("files = \"a.mcap\"").is_err());
}

#[test]
fn a_message_of_unknown_type_is_an_error() {
    let mut run = Run::new("");
    let error = run.result(0, "/other", 1, b"").unwrap_err().to_string();
    assert!(error.starts_with("cannot write a message on /other: its type is unknown"), "{error}");
    let error = run.input(0, 3, 1, b"").unwrap_err().to_string();
    assert!(error.contains("its channel, 3, was not announced"), "{error}");
}

#[test]
fn an_empty_run_leaves_an_empty_log() {
    let mut run = Run::new("");
    run.finish();
    let log = run.log();
    assert_eq!((log.messages.len(), log.outcome["complete"].as_str()), (0, "true"));
}

#[test]
fn a_log_records_the_run_at_its_beginning_and_the_inputs_at_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.mcap");
    fs::write(&input, "abc").unwrap();
    let mut run = Run::new(&format!("recorded_pipeline = '[pipeline]'\nrecorded_files = [{input:?}]"));
    run.announce(0, 1, "/a", GRID);
    run.input(0, 1, 5, b"x").unwrap();
    run.finish();
    let file = crate::reader::LogFile::open(run.file()).unwrap();
    let names: Vec<String> = file.supplements().map(|(_, body)| read_metadata(&body.unwrap()).unwrap().0).collect();
    assert_eq!(names, [RUN_RECORD, INPUTS_RECORD, crate::reader::OUTCOME_RECORD]);
    assert_eq!(file.metadata(RUN_RECORD).unwrap()["pipeline"], "[pipeline]");
    assert_eq!(file.metadata(RUN_RECORD).unwrap()["version"], env!("CARGO_PKG_VERSION"));
    let input = &file.metadata(INPUTS_RECORD).unwrap()["1"];
    assert!(input.starts_with(r#"{"name":"in.mcap","bytes":3,"sha256":"ba7816bf"#), "{input}");
}

#[test]
fn a_failed_run_records_its_pipeline_and_does_not_wait_for_hashes() {
    let mut run = Run::new("recorded_pipeline = '[pipeline]'\nrecorded_files = ['/dev/null']");
    run.announce(0, 1, "/a", GRID);
    run.input(0, 1, 5, b"x").unwrap();
    run.sink.node().abort("it failed");
    let file = crate::reader::LogFile::open(run.file()).unwrap();
    assert!(file.metadata(RUN_RECORD).is_some() && file.metadata(INPUTS_RECORD).is_none());
}

#[test]
fn metadata_is_passed_on_and_earlier_run_records_are_renamed() {
    let metadata = |name: &str| {
        let text = |text: &str| [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat();
        let pairs = [text("key"), text("value")].concat();
        [text(name), (pairs.len() as u32).to_le_bytes().to_vec(), pairs].concat()
    };
    for (more, expected) in
        [("", vec!["theirs", "earlier_gridweave_run", "gridweave"]), ("pass_input = false", vec!["gridweave"])]
    {
        let mut run = Run::new(more);
        run.sink.node().announce(0, 1, &SupplementKind::Metadata.channel()).unwrap();
        for name in ["theirs", RUN_RECORD] {
            run.input(0, 1, 5, &metadata(name)).unwrap();
        }
        run.finish();
        let file = crate::reader::LogFile::open(run.file()).unwrap();
        let names: Vec<String> = file.supplements().map(|(_, body)| read_metadata(&body.unwrap()).unwrap().0).collect();
        assert_eq!(names, expected);
    }
}
