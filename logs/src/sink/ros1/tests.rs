use super::BagWriter;
use crate::qos;
use crate::reader::tests::read_file;
use crate::reader::{Damage, LogFile};
use crate::sink::routing::result_channel;
use crate::sink::{Compression, LogOptions, Outcome, close_log};
use gridweave_runtime::message::{Channel, LogTime};
use gridweave_runtime::ros::{
    Header, Marker, MarkerArray, OccupancyGrid, PoseStamped, RosMessage, TFMessage, TransformStamped, encode,
};
use mcap::records::MessageHeader;
use std::path::Path;

fn header(channel_id: u16, time: u64) -> MessageHeader {
    MessageHeader { channel_id, sequence: 0, log_time: time, publish_time: time }
}

fn pose(number: u32) -> Vec<u8> {
    let mut pose = PoseStamped { header: Header::new(LogTime(3_000_000_005), "map"), ..Default::default() };
    pose.pose.position.x = f64::from(number);
    encode(&pose).unwrap()
}

fn grid(cells: usize) -> Vec<u8> {
    let data = vec![100; cells];
    encode(&OccupancyGrid { header: Header::new(LogTime(7), "world"), data: &data, ..Default::default() }).unwrap()
}

/// Writes poses and grids to a bag in small chunks.
fn fill(bag: &mut BagWriter) -> Vec<(String, u64, Vec<u8>)> {
    let channels = [("/robot1/pose", PoseStamped::NAME), ("/map", OccupancyGrid::NAME)]
        .map(|(topic, of)| result_channel(topic, of, ""));
    let mut written = Vec::new();
    for number in 0..40 {
        let place = usize::from(number % 10 == 0);
        let message = if place == 1 { grid(5000 * number as usize) } else { pose(number) };
        let id = bag.channel(&channels[place]).unwrap().unwrap();
        let time = 1_000_000_000 + u64::from(number) * 500_000_001;
        bag.write(&header(id, time), &message).unwrap().unwrap();
        written.push((channels[place].topic.clone(), time, message));
    }
    written
}

fn create(path: &Path, compression: Compression) -> BagWriter {
    BagWriter::create(path, LogOptions { compression, chunk_size: 2000 }).unwrap()
}

#[test]
fn messages_are_read_back_as_they_were() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.bag");
    for compression in [Compression::None, Compression::Lz4, Compression::Zstd] {
        let mut bag = create(&path, compression);
        let written = fill(&mut bag);
        assert!(!path.exists() || compression != Compression::None, "it is put in place when it is whole");
        assert_eq!(bag.finish(Outcome::Complete).unwrap(), path);
        let (read, damage) = read_file(&path).unwrap();
        assert_eq!(damage, [], "{compression:?}");
        assert!(read == written, "{compression:?}");
        let file = LogFile::open(&path).unwrap();
        assert_eq!(file.container(), "ROS 1 bag");
        let latched = |topic: &str| {
            let (_, channel) = file.channels().find(|(_, channel)| channel.topic == topic).unwrap();
            qos::is_transient_local(&channel.metadata)
        };
        assert!(latched("/map") && !latched("/robot1/pose"));
    }
}

#[test]
fn fields_that_ros_1_lacks_are_left_out_of_messages() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.bag");
    let marker = |texture: &str| Marker {
        ns: "walls".into(),
        texture_resource: texture.into(),
        text: "wall".into(),
        ..Default::default()
    };
    let mut bag = create(&path, Compression::None);
    let channel = result_channel("/markers", MarkerArray::NAME, "");
    let id = bag.channel(&channel).unwrap().unwrap();
    let markers = |texture| encode(&MarkerArray { markers: vec![marker(texture), marker(texture)] }).unwrap();
    bag.write(&header(id, 5), &markers("some.png")).unwrap().unwrap();
    bag.write(&header(id, 6), &markers("")).unwrap().unwrap();
    bag.finish(Outcome::Complete).unwrap();
    let (read, damage) = read_file(&path).unwrap();
    assert_eq!(damage, []);
    assert_eq!(read[0].2, read[1].2, "they differ in what was left out only");
}

#[test]
fn messages_that_a_bag_cannot_hold_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let mut bag = create(&folder.path().join("out.bag"), Compression::None);
    let json = Channel { topic: "/a".into(), message_encoding: "json".into(), ..Default::default() };
    assert!(bag.channel(&json).unwrap().unwrap_err().contains("`json`"));
    let mut wide = result_channel("/b", "p/msg/Wide", "wstring text");
    assert!(bag.channel(&wide).unwrap().unwrap_err().contains("wstring"));
    wide.schema = b"Unknown field".to_vec();
    assert!(bag.channel(&wide).unwrap().is_err());
    let pose_id = bag.channel(&result_channel("/c", PoseStamped::NAME, "")).unwrap().unwrap();
    let why = bag.write(&header(pose_id, 1), b"\0\x01\0\0short").unwrap().unwrap_err();
    assert!(why.contains("does not match"), "{why}");
    bag.write(&header(pose_id, 2), &pose(1)).unwrap().unwrap();
    let last = u64::from(u32::MAX) * 1_000_000_000 + 999_999_999;
    bag.write(&header(pose_id, last), &pose(1)).unwrap().unwrap();
    let why = bag.write(&header(pose_id, last + 1), &pose(1)).unwrap().unwrap_err();
    assert!(why.contains("after the year 2106") && why.contains("MCAP"), "{why}");
    let path = bag.finish(Outcome::Complete).unwrap();
    assert_eq!(read_file(&path).unwrap().0.len(), 2);
}

#[test]
fn a_bag_of_a_run_that_failed_or_was_killed_has_no_index_and_all_whole_chunks() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("failed.bag");
    let mut bag = create(&path, Compression::Lz4);
    let written = fill(&mut bag);
    bag.finish(Outcome::Incomplete("a stage failed")).unwrap();
    let (read, damage) = read_file(&path).unwrap();
    assert!(read == written && matches!(damage[..], [Damage::NoEnd { .. }]), "{damage:?}");

    let path = folder.path().join("killed.bag");
    let mut bag = create(&path, Compression::Lz4);
    let written = fill(&mut bag);
    // As if the process was killed: nothing more is written.
    drop(bag);
    let part = folder.path().join("killed.bag.part");
    let cut = std::fs::metadata(&part).unwrap().len() - 10;
    std::fs::File::options().write(true).open(&part).unwrap().set_len(cut).unwrap();
    assert_eq!(close_log(&path, "it was killed").unwrap(), Some(path.clone()));
    let (read, damage) = read_file(&path).unwrap();
    assert!(
        read.len() > 30 && written.starts_with(&read) && matches!(damage[..], [Damage::NoEnd { .. }]),
        "{damage:?}"
    );
}

#[test]
fn transforms_have_their_type_of_ros_1() {
    let folder = tempfile::tempdir().unwrap();
    let mut bag = create(&folder.path().join("out.bag"), Compression::None);
    let id = bag.channel(&result_channel("/tf_static", TFMessage::NAME, "")).unwrap().unwrap();
    let transform = TransformStamped { child_frame_id: "robot1/map".into(), ..Default::default() };
    bag.write(&header(id, 5), &encode(&TFMessage { transforms: vec![transform] }).unwrap()).unwrap().unwrap();
    let path = bag.finish(Outcome::Complete).unwrap();
    let bytes = std::fs::read(path).unwrap();
    let has = |text: &[u8]| bytes.windows(text.len()).any(|window| window == text);
    assert!(has(b"type=tf2_msgs/TFMessage") && has(b"md5sum=94810edda583a504dfda3829e70d7eec") && has(b"latching=1"));
}
