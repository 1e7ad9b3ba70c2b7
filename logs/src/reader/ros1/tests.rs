use super::definition::{translate, type_name};
use crate::dynamic::{FieldPath, Schema};
use crate::reader::tests::read_file;
use crate::reader::{ChunkFault, Damage, LogFile};
use crate::test_log::{Folder, layouts};
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{Header, PoseStamped, RosMessage, decode};
use mcap::records::MessageHeader;
use std::collections::BTreeMap;
use std::io::Cursor;

const POSE: &str = "\
# A pose.
Header header
Pose pose
================================================================================
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
================================================================================
MSG: geometry_msgs/Pose
Point position
Quaternion orientation
================================================================================
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
";

/// Builds a bag record by record.
struct Bag(Vec<u8>);

fn fields(fields: &[(&str, &[u8])]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (name, value) in fields {
        bytes.extend_from_slice(&((name.len() + 1 + value.len()) as u32).to_le_bytes());
        bytes.extend_from_slice(name.as_bytes());
        bytes.push(b'=');
        bytes.extend_from_slice(value);
    }
    bytes
}

fn record(header: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    let header = fields(header);
    let mut bytes = (header.len() as u32).to_le_bytes().to_vec();
    bytes.extend_from_slice(&header);
    bytes.extend_from_slice(&(data.len() as u32).to_le_bytes());
    bytes.extend_from_slice(data);
    bytes
}

fn connection(number: u32, topic: &str, type_name: &str, definition: &str) -> Vec<u8> {
    let described = fields(&[
        ("topic", topic.as_bytes()),
        ("type", type_name.as_bytes()),
        ("message_definition", definition.as_bytes()),
        ("latching", b"1"),
    ]);
    record(&[("op", &[7]), ("conn", &number.to_le_bytes()), ("topic", topic.as_bytes())], &described)
}

fn time_bytes(time: u64) -> Vec<u8> {
    let (seconds, rest) = ((time / 1_000_000_000) as u32, (time % 1_000_000_000) as u32);
    [seconds.to_le_bytes(), rest.to_le_bytes()].concat()
}

fn message(number: u32, time: u64, data: &[u8]) -> Vec<u8> {
    record(&[("op", &[2]), ("conn", &number.to_le_bytes()), ("time", &time_bytes(time))], data)
}

impl Bag {
    fn new(is_closed: bool) -> Self {
        let place: u64 = if is_closed { 4117 } else { 0 };
        let header: [(&str, &[u8]); 4] = [
            ("op", &[3]),
            ("index_pos", &place.to_le_bytes()),
            ("conn_count", &1_u32.to_le_bytes()),
            ("chunk_count", &1_u32.to_le_bytes()),
        ];
        Self([super::MAGIC.to_vec(), record(&header, &[b' '; 100])].concat())
    }

    fn chunk(mut self, compression: &str, contents: &[u8], times: &[u64]) -> Self {
        let data = match compression {
            "lz4" => {
                let mut encoder = lz4::EncoderBuilder::new().build(Vec::new()).unwrap();
                std::io::Write::write_all(&mut encoder, contents).unwrap();
                encoder.finish().0
            }
            "bz2" => {
                let mut encoder = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::default());
                std::io::Write::write_all(&mut encoder, contents).unwrap();
                encoder.finish().unwrap()
            }
            _ => contents.to_vec(),
        };
        let size = (contents.len() as u32).to_le_bytes();
        self.0.extend(record(&[("op", &[5]), ("compression", compression.as_bytes()), ("size", &size)], &data));
        let entries: Vec<u8> = times.iter().flat_map(|time| [time_bytes(*time), vec![0; 4]].concat()).collect();
        let count = (times.len() as u32).to_le_bytes();
        let header: [(&str, &[u8]); 4] = [("op", &[4]), ("ver", &[1, 0, 0, 0]), ("conn", &[0; 4]), ("count", &count)];
        self.0.extend(record(&header, &entries));
        self
    }

    fn end(mut self, connections: &[Vec<u8>]) -> Vec<u8> {
        connections.iter().for_each(|connection| self.0.extend_from_slice(connection));
        self.0
    }
}

/// A pose in ROS 1 encoding.
fn pose(x: f64) -> Vec<u8> {
    let mut bytes = [7_u32, 3, 5, 3].map(u32::to_le_bytes).concat();
    bytes.extend_from_slice(b"map");
    for number in [x, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0] {
        bytes.extend_from_slice(&number.to_le_bytes());
    }
    bytes
}

fn expected(x: f64) -> PoseStamped {
    let mut pose = PoseStamped { header: Header::new(LogTime(3_000_000_005), "map"), ..Default::default() };
    (pose.pose.position.x, pose.pose.position.y, pose.pose.position.z) = (x, 2.0, 3.0);
    pose
}

#[test]
fn messages_are_read_by_time_and_converted_to_ros_2() {
    let folder = Folder::new();
    let described = connection(0, "/robot1/pose", "geometry_msgs/PoseStamped", POSE);
    for compression in ["none", "lz4", "bz2"] {
        let late =
            [described.clone(), message(0, 2_000_000_009, &pose(1.0)), message(0, 1_000_000_000, &pose(4.0))].concat();
        let bag = Bag::new(true).chunk(compression, &late, &[2_000_000_009, 1_000_000_000]);
        let bag = bag.chunk(compression, &message(0, 1_500_000_000, &pose(5.0)), &[1_500_000_000]);
        let path = folder.write("a.bag", &bag.end(std::slice::from_ref(&described)));
        let (messages, damage) = read_file(&path).unwrap();
        assert_eq!(damage, []);
        let times: Vec<u64> = messages.iter().map(|(_, time, _)| *time).collect();
        assert_eq!(times, [1_000_000_000, 1_500_000_000, 2_000_000_009]);
        let poses: Vec<PoseStamped> = messages.iter().map(|(.., data)| decode(data).unwrap()).collect();
        assert_eq!(poses, [4.0, 5.0, 1.0].map(expected));

        let file = LogFile::open(&path).unwrap();
        let (_, channel) = file.channels().next().unwrap();
        assert_eq!((channel.schema_name.as_str(), channel.message_encoding.as_str()), (PoseStamped::NAME, "cdr"));
        assert!(crate::qos::is_transient_local(&channel.metadata));
        let schema = Schema::of_channel(&channel).unwrap();
        let field: FieldPath = "header.stamp.sec".parse().unwrap();
        assert_eq!(schema.decode(&messages[0].2).unwrap().find(&field).unwrap().to_string(), "3");
        assert_eq!(file.container(), "ROS 1 bag");
    }
}

#[test]
fn ros_1_messages_in_mcap_are_converted_too() {
    let folder = Folder::new();
    for (options, latching) in layouts().into_iter().zip(["True", "1", "", "false"]) {
        let mut log = mcap::Writer::with_options(Cursor::new(Vec::new()), options.profile("ros1")).unwrap();
        let schema = log.add_schema("geometry_msgs/PoseStamped", "ros1msg", POSE.as_bytes()).unwrap();
        let unusable = log.add_schema("a/B", "ros1msg", b"C c").unwrap();
        let metadata = BTreeMap::from([("latching".to_owned(), latching.to_owned())]);
        let poses = log.add_channel(schema, "robot1/pose", "ros1", &metadata).unwrap();
        let other = log.add_channel(unusable, "/raw", "ros1", &BTreeMap::new()).unwrap();
        let messages = [(poses, pose(1.0)), (other, b"raw".to_vec()), (poses, b"short".to_vec()), (poses, pose(2.0))];
        for (time, (channel_id, data)) in (1_u64..).zip(messages) {
            let header = MessageHeader { channel_id, sequence: 9, log_time: time, publish_time: time };
            log.write_to_known_channel(&header, &data).unwrap();
        }
        log.finish().unwrap();
        let path = folder.write("a.mcap", &log.into_inner().into_inner());
        let (messages, damage) = read_file(&path).unwrap();
        assert_eq!(damage, [Damage::LostMessages { count: 1 }]);
        let found: Vec<(&str, u64)> = messages.iter().map(|(topic, time, _)| (topic.as_str(), *time)).collect();
        assert_eq!(found, [("/robot1/pose", 1), ("/raw", 2), ("/robot1/pose", 4)]);
        assert_eq!(decode::<PoseStamped>(&messages[0].2).unwrap(), expected(1.0));
        assert_eq!(decode::<PoseStamped>(&messages[2].2).unwrap(), expected(2.0));
        assert_eq!(messages[1].2, b"raw");
        let channels: Vec<_> = LogFile::open(&path).unwrap().channels().map(|(_, channel)| channel).collect();
        assert_eq!(
            (channels[0].schema_name.as_str(), channels[0].message_encoding.as_str()),
            (PoseStamped::NAME, "cdr")
        );
        assert_eq!(crate::qos::is_transient_local(&channels[0].metadata), ["True", "1"].contains(&latching));
        assert_eq!(channels[1].message_encoding, "ros1");
    }
}

#[test]
fn definitions_have_the_names_of_ros_2() {
    assert_eq!(type_name("nav_msgs/OccupancyGrid"), "nav_msgs/msg/OccupancyGrid");
    assert_eq!(type_name("nav_msgs/msg/OccupancyGrid"), "nav_msgs/msg/OccupancyGrid");
    assert_eq!(type_name("tf/tfMessage"), "tf2_msgs/msg/TFMessage");
    let text = translate(
        "time[] at\nduration d\nbyte b\nchar c\nint32 A=1 # time\nHeader header\nstd_msgs/Header h\nfloat32[3] x",
    );
    let own: Vec<&str> = text.lines().take(8).collect();
    let expected = [
        "builtin_interfaces/Time[] at",
        "builtin_interfaces/Duration d",
        "int8 b",
        "uint8 c",
        "int32 A=1 # time",
        "std_msgs/Header header",
        "std_msgs/Header h",
        "float32[3] x",
    ];
    assert_eq!(own, expected);
    Schema::parse("a/A", &text).unwrap();
}

#[test]
fn a_truncated_or_unclosed_bag_is_read_as_far_as_possible() {
    let folder = Folder::new();
    let described = connection(0, "/robot1/pose", "geometry_msgs/PoseStamped", POSE);
    let first = [described.clone(), message(0, 1, &pose(1.0))].concat();
    let bag = Bag::new(false).chunk("none", &first, &[1]).chunk("none", &message(0, 2, &pose(2.0)), &[2]);
    let bytes = bag.end(&[]);
    let (messages, damage) = read_file(&folder.write("open.bag", &bytes)).unwrap();
    assert_eq!(messages.len(), 2);
    assert!(matches!(damage[..], [Damage::NoEnd { .. }]), "{damage:?}");
    for length in 0..bytes.len() {
        if let Ok((messages, damage)) = read_file(&folder.write("cut.bag", &bytes[..length])) {
            assert!(
                messages.len() <= 2 && damage.iter().any(|damage| matches!(damage, Damage::NoEnd { .. })),
                "{length}"
            );
        }
    }
}

#[test]
fn unreadable_messages_are_counted_and_the_rest_is_read() {
    let folder = Folder::new();
    let described = connection(0, "/p", "geometry_msgs/PoseStamped", POSE);
    let unknown = connection(1, "/q", "a/B", "C c");
    let contents =
        [message(0, 1, b"short"), message(0, 2, &pose(1.0)), message(1, 3, b"raw"), message(9, 4, b"?")].concat();
    let bag = Bag::new(true).chunk("none", &contents, &[1, 2, 3, 4]).chunk("lzo", b"", &[5]);
    let path = folder.write("a.bag", &bag.end(&[described, unknown]));
    let (messages, damage) = read_file(&path).unwrap();
    let found: Vec<(&str, u64)> = messages.iter().map(|(topic, time, _)| (topic.as_str(), *time)).collect();
    assert_eq!(found, [("/p", 2), ("/q", 3), ("", 4)]);
    assert_eq!(messages[1].2, b"raw");
    assert_eq!(LogFile::open(&path).unwrap().channels().nth(1).unwrap().1.message_encoding, "ros1");
    assert!(damage.contains(&Damage::LostMessages { count: 1 }), "{damage:?}");
    assert!(damage.contains(&Damage::BadChunk { fault: ChunkFault::UnknownCompression("lzo".into()) }), "{damage:?}");
}

#[test]
fn a_topic_without_a_slash_at_its_beginning_gets_one() {
    let folder = Folder::new();
    let contents = message(0, 1, &pose(1.0));
    let bag = Bag::new(true).chunk("none", &contents, &[1]);
    let path = folder.write("a.bag", &bag.end(&[connection(0, "robot1/pose", "geometry_msgs/PoseStamped", POSE)]));
    let (messages, damage) = read_file(&path).unwrap();
    assert_eq!((messages[0].0.as_str(), messages.len(), damage.len()), ("/robot1/pose", 1, 0));
}
