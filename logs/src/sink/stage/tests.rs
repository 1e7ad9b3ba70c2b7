use super::*;
use crate::sink::kind;
use gridweave_runtime::message::{LogTime, MessageHeader};
use gridweave_runtime::ros::{self, OccupancyGrid, Segments, TFMessage};
use gridweave_runtime::stage::{InputWire, LoneStage};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

const GRID: &str = "nav_msgs/msg/OccupancyGrid";
const TF: &str = "tf2_msgs/msg/TFMessage";
const SEGMENTS: &str = "gridweave_msgs/msg/Segments";

/// A sink with two sources on wires 0 and 1, and results on wires 2 (`/map`), 3 (`/tf_static`) and 4 (segments).
struct Run {
    folder: TempDir,
    sink: LoneStage,
}

fn context() -> Context {
    let wires = [("", ""), ("", ""), (GRID, "/map"), (TF, "/tf_static"), (SEGMENTS, "/{robot}/lines/segments")];
    let wire = |(ros_type, topic): (&str, &str)| InputWire {
        port: "messages",
        ros_type: ros_type.into(),
        topic: topic.into(),
        ..Default::default()
    };
    Context { stage: "sink".into(), inputs: wires.map(wire).to_vec(), ..Default::default() }
}

fn make(file: &Path, more: &str) -> Result<LoneStage, StageError> {
    LoneStage::with_context(&kind(), &format!("file = {file:?}\n{more}"), &context())
}

impl Run {
    fn new(more: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let sink = make(&folder.path().join("out.mcap"), more).unwrap();
        Self { folder, sink }
    }

    fn file(&self) -> PathBuf {
        self.folder.path().join("out.mcap")
    }

    fn announce(&mut self, wire: usize, number: u32, topic: &str, schema_name: &str) {
        let channel = Channel {
            topic: topic.into(),
            message_encoding: "cdr".into(),
            schema_name: schema_name.into(),
            schema_encoding: "ros2msg".into(),
            schema: b"# from the input".to_vec(),
            metadata: BTreeMap::from([("offered_qos_profiles".into(), "theirs".into())]),
        };
        self.sink.node().announce(wire, number, &channel).unwrap();
    }

    /// A message of the input's channel `number`.
    fn input(&mut self, wire: usize, number: u32, time: u64, bytes: &[u8]) -> Result<(), StageError> {
        self.send(wire, number, "/not/used", time, bytes)
    }

    /// A message that a stage has made.
    fn result(&mut self, wire: usize, topic: &str, time: u64, bytes: &[u8]) -> Result<(), StageError> {
        self.send(wire, 0, topic, time, bytes)
    }

    fn send(&mut self, wire: usize, channel: u32, topic: &str, time: u64, bytes: &[u8]) -> Result<(), StageError> {
        let header = MessageHeader {
            log_time: LogTime(time),
            publish_time: time + 1,
            channel,
            log_sequence: 40 + time as u32,
            topic: FixedText::new(topic).unwrap(),
            ..Default::default()
        };
        let message = Message::from_vec(header, bytes.to_vec()).on_wire(wire);
        self.sink.give_message("messages", message)
    }

    fn finish(&mut self) {
        self.sink.finish(LogTime(0)).unwrap();
    }

    fn log(&self) -> Log {
        Log::read(&self.file())
    }
}

/// A message as read back: topic, type, sequence, log time, publish time, bytes.
type Read = (String, String, u32, u64, u64, Vec<u8>);

struct Log {
    messages: Vec<Read>,
    channels: Vec<mcap::Channel<'static>>,
    chunks: usize,
    outcome: BTreeMap<String, String>,
}

impl Log {
    fn read(path: &Path) -> Self {
        let bytes = fs::read(path).unwrap();
        let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
        let messages = mcap::MessageStream::new(&bytes).unwrap().map(|message| {
            let message = message.unwrap();
            let schema = message.channel.schema.as_ref().map(|schema| schema.name.clone()).unwrap_or_default();
            let (log_time, publish_time) = (message.log_time, message.publish_time);
            (message.channel.topic.clone(), schema, message.sequence, log_time, publish_time, message.data.to_vec())
        });
        let outcome = summary.metadata_indexes.iter().find(|index| index.name == "gridweave").unwrap();
        let mut channels: Vec<_> = summary.channels.values().map(|channel| (**channel).clone()).collect();
        channels.sort_by_key(|channel| channel.id);
        Self {
            messages: messages.collect(),
            channels,
            chunks: summary.chunk_indexes.len(),
            outcome: mcap::read::metadata(&bytes, outcome).unwrap().metadata,
        }
    }

    fn topics(&self) -> Vec<&str> {
        self.messages.iter().map(|message| message.0.as_str()).collect()
    }
}

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
fn the_input_cannot_pass_for_a_result() {
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
    let text = |topic| format!("the input's messages on {topic} were left out: a result of this run has that topic");
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
fn a_large_message_has_a_chunk_of_its_own() {
    let mut run = Run::new("chunk_size = 10000");
    for size in [10, 20, 50_000, 10] {
        run.result(2, "/map", 1, &vec![0; size]).unwrap();
    }
    run.finish();
    assert_eq!(run.log().chunks, 3);
}

#[test]
fn a_failed_run_leaves_a_log_that_says_so() {
    let mut run = Run::new("");
    run.result(2, "/map", 1, b"grid").unwrap();
    run.sink.node().abort("stage `lines` failed");
    let log = run.log();
    assert_eq!(log.topics(), ["/map"]);
    let expected = [("complete", "false"), ("reason", "stage `lines` failed")];
    assert_eq!(log.outcome, expected.map(|(key, value)| (key.into(), value.into())).into());
}

#[test]
fn a_run_that_fails_at_once_leaves_the_log_of_an_earlier_run_alone() {
    let mut run = Run::new("");
    fs::write(run.file(), "earlier").unwrap();
    run.sink.node().abort("no input");
    assert_eq!(fs::read(run.file()).unwrap(), b"earlier");
}

#[test]
fn a_sink_that_is_dropped_leaves_a_log_that_is_not_complete() {
    let mut run = Run::new("");
    run.result(2, "/map", 1, b"grid").unwrap();
    let Run { folder, sink, .. } = run;
    drop(sink);
    let log = Log::read(&folder.path().join("out.mcap"));
    assert_eq!((log.topics(), log.outcome["complete"].as_str()), (vec!["/map"], "false"));
}

#[test]
fn what_was_closed_can_be_read_while_the_run_goes_on() {
    let mut run = Run::new("chunk_size = 1024");
    for time in 0..100 {
        run.result(2, "/map", time, &[7; 100]).unwrap();
    }
    let bytes = fs::read(run.folder.path().join("out.mcap.part")).unwrap();
    let options = mcap::read::Options::IgnoreEndMagic.into();
    let stream = mcap::MessageStream::new_with_options(&bytes, options).unwrap();
    let readable = stream.map_while(Result::ok).count();
    assert!((92..100).contains(&readable), "{readable} of 100, with 8 in the open chunk");
}

#[test]
fn a_program_that_has_the_earlier_file_open_keeps_what_it_reads() {
    use std::io::Read;
    let mut run = Run::new("");
    fs::write(run.file(), "earlier").unwrap();
    let mut open = fs::File::open(run.file()).unwrap();
    run.finish();
    let mut text = String::new();
    open.read_to_string(&mut text).unwrap();
    assert_eq!(text, "earlier");
    assert_eq!(run.log().outcome["complete"], "true");
}

#[test]
fn a_sink_that_never_ran_leaves_the_earlier_file_alone() {
    let run = Run::new("");
    fs::write(run.file(), "earlier").unwrap();
    let Run { folder, sink, .. } = run;
    drop(sink);
    assert_eq!(fs::read(folder.path().join("out.mcap")).unwrap(), b"earlier");
}

#[test]
fn bad_paths_are_refused_with_what_would_mend_them() {
    let folder = tempfile::tempdir().unwrap();
    let error = |path: &Path| make(path, "").err().unwrap().to_string();
    let at = |name: &str| folder.path().join(name);

    assert_eq!(
        error(Path::new("")),
        "cannot write the log of stage `sink`: it has no file; give --output LOG or file = \"LOG\""
    );
    assert!(error(folder.path()).ends_with("is a folder; name a file in it"));
    let missing = at("missing");
    let expected = format!("there is no folder {}; make it, or name a file elsewhere", missing.display());
    assert_eq!(error(&missing.join("out.mcap")), format!("cannot write the log: {expected}"));
    fs::write(at("file"), "").unwrap();
    assert!(error(&at("file").join("out.mcap")).contains("there is no folder"));
}

#[test]
fn of_two_sinks_with_one_file_the_second_is_refused_and_touches_nothing() {
    let mut run = Run::new("");
    let error = make(&run.file(), "").err().unwrap().to_string();
    assert!(error.contains("out.mcap is being written by process"), "{error}");
    run.result(2, "/map", 1, b"grid").unwrap();
    run.finish();
    assert_eq!(run.log().topics(), ["/map"]);
}

#[test]
fn a_failed_run_does_not_take_the_place_of_an_earlier_log() {
    let mut run = Run::new("");
    fs::write(run.file(), "earlier").unwrap();
    run.result(2, "/map", 1, b"grid").unwrap();
    run.sink.node().abort("stage `lines` failed");
    assert_eq!(fs::read(run.file()).unwrap(), b"earlier");
    let log = Log::read(&run.folder.path().join("out.mcap.part"));
    assert_eq!((log.topics(), log.outcome["complete"].as_str()), (vec!["/map"], "false"));
}

#[test]
fn parameters_out_of_range_are_told() {
    let check = |text: &str| kind().check_parameters(&text.parse().unwrap());
    assert!(check("chunk_size = 4096").unwrap().is_empty());
    assert_eq!(check("chunk_size = 10").unwrap()[0].field, "chunk_size");
    assert!(check("compression = \"gzip\"").is_err());
    assert!(check("files = \"a.mcap\"").is_err());
}

#[test]
fn a_message_of_which_nothing_is_known_is_an_error() {
    let mut run = Run::new("");
    let error = run.result(0, "/other", 1, b"").unwrap_err().to_string();
    assert!(error.starts_with("cannot write a message on /other: nothing says what type it has"), "{error}");
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
fn a_log_says_at_its_beginning_what_writes_it_and_at_its_end_from_what() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.mcap");
    fs::write(&input, "abc").unwrap();
    let mut run = Run::new(&format!("recorded_pipeline = '[pipeline]'\nrecorded_files = [{input:?}]"));
    run.announce(0, 1, "/a", GRID);
    run.input(0, 1, 5, b"x").unwrap();
    run.finish();
    let file = crate::reader::LogFile::open(run.file()).unwrap();
    let names: Vec<String> = file.supplements().map(|(_, body)| read_metadata(&body.unwrap()).unwrap().0).collect();
    assert_eq!(names, [RUN_RECORD, INPUTS_RECORD, crate::sink::OUTCOME_RECORD]);
    assert_eq!(file.metadata(RUN_RECORD).unwrap()["pipeline"], "[pipeline]");
    assert_eq!(file.metadata(RUN_RECORD).unwrap()["version"], env!("CARGO_PKG_VERSION"));
    let input = &file.metadata(INPUTS_RECORD).unwrap()["1"];
    assert!(input.starts_with(r#"{"name":"in.mcap","bytes":3,"sha256":"ba7816bf"#), "{input}");
}

#[test]
fn a_run_that_fails_says_what_it_was_and_does_not_wait_for_hashes() {
    let mut run = Run::new("recorded_pipeline = '[pipeline]'\nrecorded_files = ['/dev/null']");
    run.announce(0, 1, "/a", GRID);
    run.input(0, 1, 5, b"x").unwrap();
    run.sink.node().abort("it failed");
    let file = crate::reader::LogFile::open(run.file()).unwrap();
    assert!(file.metadata(RUN_RECORD).is_some() && file.metadata(INPUTS_RECORD).is_none());
}

#[test]
fn what_a_log_holds_beside_messages_is_passed_on_and_what_explained_it_is_not_what_explains_this_one() {
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
