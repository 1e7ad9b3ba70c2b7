//! Logs that are written: they explain themselves, keep what the input holds beside messages, and may be bags of
//! rosbag2.

use crate::support::{LogBuilder, SMALL_BUILDING, TestMap, gridweave, simulate};
use gridweave_logs::reader::{LogFile, LogReader, SupplementKind};
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{OccupancyGrid, TFMessage, TransformStamped, decode};
use gridweave_tests::header;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// A log with one message, an attachment and a metadata record.
fn write_log_with_attachment(path: &Path) {
    let mut writer = mcap::Writer::new(std::io::BufWriter::new(fs::File::create(path).unwrap())).unwrap();
    let channel_id = writer.add_channel(0, "/notes", "json", &BTreeMap::new()).unwrap();
    let header = mcap::records::MessageHeader { channel_id, sequence: 1, log_time: 5, publish_time: 5 };
    writer.write_to_known_channel(&header, b"{}").unwrap();
    let attachment = mcap::Attachment {
        log_time: 7,
        create_time: 8,
        name: "calibration.txt".into(),
        media_type: "text/plain".into(),
        data: Cow::Borrowed(b"f = 1"),
    };
    writer.attach(&attachment).unwrap();
    let metadata = BTreeMap::from([("weather".to_owned(), "rain".to_owned())]);
    writer.write_metadata(&mcap::records::Metadata { name: "drive".into(), metadata }).unwrap();
    writer.finish().unwrap();
}

#[test]
fn a_log_explains_itself_and_keeps_what_is_beside_the_messages_on_every_engine() {
    let folder = TempDir::new().unwrap();
    write_log_with_attachment(&folder.path().join("notes.mcap"));
    let cut = |engine: &str, output: &str| {
        let args = ["run", "cut", "--input", "notes.mcap", "-o", output, "--engine", engine, "--seed", "3"];
        gridweave(folder.path(), &args).assert(0, &[]);
        fs::read(folder.path().join(output)).unwrap()
    };
    let bytes = cut("single", "a.mcap");
    for (engine, output) in [("threads", "b.mcap"), ("threads-ipc", "c.mcap"), ("processes", "d.mcap")] {
        assert!(cut(engine, output) == bytes, "{engine}");
    }
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let attachment = mcap::read::attachment(&bytes, &summary.attachment_indexes[0]).unwrap();
    assert_eq!((attachment.name.as_str(), &*attachment.data), ("calibration.txt", b"f = 1".as_slice()));
    let log = LogFile::open(folder.path().join("a.mcap")).unwrap();
    assert_eq!(log.metadata("drive").unwrap()["weather"], "rain");
    let pipeline = &log.metadata("gridweave_run").unwrap()["pipeline"];
    assert!(pipeline.contains("seed = 3") && pipeline.contains("mcap_source"), "{pipeline}");
    assert!(log.metadata("gridweave_inputs").unwrap()["1"].contains("notes.mcap"));
    let here = folder.path().to_str().unwrap();
    for (kind, body) in log.supplements().filter(|(kind, _)| *kind == SupplementKind::Metadata) {
        assert!(!String::from_utf8_lossy(&body.unwrap()).contains(here), "{kind:?} names a place");
    }
    let words = ["pipeline cut, seed 3", "notes.mcap  ", "sha256", "metadata records: drive", "attachments: 1"];
    gridweave(folder.path(), &["info", "a.mcap"]).assert(0, &words);

    // What explained an input is not lost.
    gridweave(folder.path(), &["convert", "a.mcap", "-o", "e.mcap"]).assert(0, &["wrote 1 messages"]);
    let log = LogFile::open(folder.path().join("e.mcap")).unwrap();
    assert_eq!(&log.metadata("earlier_gridweave_run").unwrap()["pipeline"], pipeline);
    assert_eq!(log.attachments(), 1);

    // What is recorded is a pipeline that can be run.
    fs::write(folder.path().join("again.toml"), pipeline).unwrap();
    let args = ["run", "again.toml", "--input", "notes.mcap", "-o", "f.mcap"];
    gridweave(folder.path(), &args).assert(0, &[]);
    assert!(fs::read(folder.path().join("f.mcap")).unwrap() == bytes);
}

#[test]
fn a_path_with_a_slash_behind_it_is_a_bag_of_rosbag2() {
    let folder = TempDir::new().unwrap();
    simulate(folder.path(), "in.mcap", &SMALL_BUILDING);
    let path = |name: &str| folder.path().join(name);
    gridweave(folder.path(), &["merge", "in.mcap", "-o", "merged/"]).assert(0, &["merged 2 of 2"]);
    assert_eq!(fs::read_dir(path("merged")).unwrap().count(), 2);
    let description = fs::read_to_string(path("merged/metadata.yaml")).unwrap();
    assert!(description.contains("storage_identifier: mcap") && description.contains("merged_0.mcap"), "{description}");
    gridweave(folder.path(), &["info", "merged"]).assert(0, &["merged_0.mcap", "/map"]);

    // Once more, over itself, and as a file: the log is the same.
    gridweave(folder.path(), &["run", "auto_merge", "--input", "in.mcap", "-o", "merged"]).assert(0, &[]);
    gridweave(folder.path(), &["merge", "in.mcap", "-o", "merged.mcap"]).assert(0, &[]);
    assert!(fs::read(path("merged/merged_0.mcap")).unwrap() == fs::read(path("merged.mcap")).unwrap());
    let frames = ["robot1/base_link", "robot1/map", "robot2/base_link", "robot2/map", "world_origin"];
    assert_eq!(frames_with_one_parent(&path("merged.mcap")), frames);

    gridweave(folder.path(), &["convert", "merged/", "-o", "copy/"]).assert(0, &["wrote ", "to copy/"]);
    assert!(path("copy/copy_0.mcap").exists() && path("copy/metadata.yaml").exists());
    gridweave(folder.path(), &["convert", "merged", "-o", "merged"]).assert(2, &["is an input"]);
    gridweave(folder.path(), &["convert", "in.mcap", "-o", "."]).assert(1, &["of another bag"]);
    gridweave(folder.path(), &["convert", "none.mcap", "-o", "new/"]).assert(1, &["none.mcap"]);
    assert!(!path("new").exists(), "nothing was written");
    gridweave(folder.path(), &["convert", "in.mcap", "-o", "none/new/"]).assert(1, &["none/new"]);
}

#[test]
fn a_path_that_ends_in_bag_is_a_bag_of_ros_1() {
    let folder = TempDir::new().unwrap();
    simulate(folder.path(), "in.mcap", &SMALL_BUILDING);
    gridweave(folder.path(), &["merge", "in.mcap", "-o", "merged.mcap"]).assert(0, &["merged 2 of 2"]);
    gridweave(folder.path(), &["merge", "in.mcap", "-o", "merged.bag"]).assert(0, &["merged 2 of 2"]);
    gridweave(folder.path(), &["convert", "merged.mcap", "-o", "again.bag"]).assert(0, &["wrote ", "to again.bag"]);
    let messages = |name: &str| {
        let mut reader = LogReader::new(vec![LogFile::open(folder.path().join(name)).unwrap()]);
        let files = reader.files().clone();
        assert_eq!(files[0].damage(), []);
        let mut messages = BTreeMap::<String, Vec<(LogTime, Vec<u8>)>>::new();
        while let Some(message) = reader.next_message() {
            let channel = files[0].channel(message.channel).unwrap();
            // ROS 1 has fewer fields of markers.
            let data = if channel.topic.starts_with("/markers") { Vec::new() } else { message.data.to_vec() };
            messages.entry(channel.topic).or_default().push((message.log_time, data));
        }
        messages
    };
    let expected = messages("merged.mcap");
    for bag in ["merged.bag", "again.bag"] {
        let found = messages(bag);
        assert!(found.keys().eq(expected.keys()), "{:?}", found.keys());
        for (topic, messages) in found {
            if !topic.contains("/markers/") {
                assert!(messages == expected[&topic], "{topic} in {bag}");
            }
        }
    }
    // It is merged as the log that it was made from.
    gridweave(folder.path(), &["convert", "in.mcap", "-o", "in.bag"]).assert(0, &[]);
    gridweave(folder.path(), &["merge", "in.bag", "-o", "of_bag.mcap"]).assert(0, &["merged 2 of 2"]);
    gridweave(folder.path(), &["recover", "in.bag", "-o", "out.bag"]).assert(2, &["convert out.mcap -o out.bag"]);
}

#[test]
fn a_map_frame_of_any_name_that_was_placed_before_its_map_came_has_one_parent() {
    let folder = TempDir::new().unwrap();
    let placed = |parent: &str, child: &str| TFMessage {
        transforms: vec![TransformStamped {
            header: header(0.0, parent),
            child_frame_id: child.into(),
            ..Default::default()
        }],
    };
    let map = TestMap::flat();
    let cells: Vec<u8> = map.cells.iter().map(|cell| *cell as u8).collect();
    let mut log = LogBuilder::new(&folder.path().join("in.mcap"));
    for robot in ["robot1", "robot2"] {
        log.message(0.0, "/tf_static", &placed("earth", &format!("{robot}/slam")));
        log.message(0.0, "/tf", &placed("earth", &format!("{robot}/slam")));
    }
    for robot in ["robot1", "robot2"] {
        let header = header(20.0, format!("{robot}/slam"));
        let map = OccupancyGrid { header, info: map.info, data: &cells };
        log.message(20.0, &format!("/{robot}/map"), &map);
        log.message(21.0, "/tf", &placed(&format!("{robot}/slam"), &format!("{robot}/base_link")));
    }
    log.finish();
    for engine in ["single", "threads", "processes"] {
        let ended = gridweave(folder.path(), &["merge", "in.mcap", "-o", "out.mcap", "--engine", engine]);
        ended.assert(0, &["merged 2 of 2", "were dropped: this run places it"]);
        let frames = frames_with_one_parent(&folder.path().join("out.mcap"));
        let expected = ["robot1/base_link", "robot1/slam", "robot2/base_link", "robot2/slam", "world_origin"];
        assert_eq!(frames, expected);
    }
}

#[test]
fn the_world_of_the_input_is_not_placed_below_the_map_frames_that_this_run_places_in_it() {
    let folder = TempDir::new().unwrap();
    let placed = |parent: &str, child: &str| {
        let transform =
            TransformStamped { header: header(0.0, parent), child_frame_id: child.into(), ..Default::default() };
        TFMessage { transforms: vec![transform] }
    };
    for (topic, world) in [("/tf_static", "world"), ("/tf", "/world")] {
        let mut log = LogBuilder::new(&folder.path().join("in.mcap"));
        log.message(0.0, topic, &placed("robot1/map", "robot1/odom")).message(
            0.0,
            topic,
            &placed("robot1/odom", world),
        );
        log.map(1.0, "robot1", &TestMap::flat()).map(1.0, "robot2", &TestMap::flat());
        log.finish();
        let ended = gridweave(folder.path(), &["merge", "in.mcap", "-o", "out.mcap"]);
        ended.assert(0, &["merged 2 of 2", "input transforms that place the frame `world` were dropped"]);
        let frames = frames_with_one_parent(&folder.path().join("out.mcap"));
        assert_eq!(frames, ["robot1/map", "robot1/odom", "robot2/map", "world_origin"]);
    }
}

/// The frames that the transforms of a log place, each in one parent over the whole log.
#[track_caller]
fn frames_with_one_parent(log: &Path) -> Vec<String> {
    let mut parents = BTreeMap::new();
    let bytes = fs::read(log).unwrap();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        if !message.channel.topic.ends_with("tf_static") && !message.channel.topic.ends_with("tf") {
            continue;
        }
        assert!(!message.channel.metadata.keys().any(|key| key.starts_with("gridweave")));
        for one in decode::<TFMessage>(&message.data).unwrap().transforms {
            let parent = parents.entry(one.child_frame_id.clone()).or_insert(one.header.frame_id.clone());
            assert_eq!(*parent, one.header.frame_id, "{}", one.child_frame_id);
        }
    }
    parents.into_keys().collect()
}
