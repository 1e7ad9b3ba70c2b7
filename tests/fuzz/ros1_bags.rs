//! Bags of ROS 1.

use super::input::Input;
use super::target::Target;
use gridweave_logs::dynamic::Schema;
use gridweave_logs::reader::{LogFile, LogReader};
use std::path::Path;

const FILE: &str = "log.bag";
/// A type with every kind of field: also some that take no bytes.
const DEFINITION: &str =
    "Header header\nstring name\nfloat64[] numbers\nint8[0] none\nstd_msgs/Empty[] empty\nPart[] parts
================================================================================
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
================================================================================
MSG: std_msgs/Empty
================================================================================
MSG: p/Part
int8[0] nothing
uint8 value
";

fn fields(fields: &[(&str, &[u8])]) -> Vec<u8> {
    let field = |&(name, value): &(&str, &[u8])| {
        let length = (name.len() + 1 + value.len()) as u32;
        [&length.to_le_bytes(), name.as_bytes(), b"=", value].concat()
    };
    fields.iter().flat_map(field).collect()
}

fn record(header: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    let header = fields(header);
    let lengths = [header.len() as u32, data.len() as u32].map(u32::to_le_bytes);
    [&lengths[0], header.as_slice(), &lengths[1], data].concat()
}

/// A closed bag with two chunks, the first with `compression`.
fn bag(compression: &str) -> Vec<u8> {
    let number = 0_u32.to_le_bytes();
    let described = fields(&[("topic", b"/x"), ("type", b"p/X"), ("message_definition", DEFINITION.as_bytes())]);
    let connection = record(&[("op", &[7]), ("conn", &number), ("topic", b"/x")], &described);
    let text = |text: &str| [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat();
    let message = |seconds: u32| {
        let stamp = [9, seconds, 5].map(u32::to_le_bytes).concat();
        let numbers = [&2_u32.to_le_bytes()[..], &1.5_f64.to_le_bytes(), &2.5_f64.to_le_bytes()].concat();
        // One empty message, which takes no bytes, and two parts.
        let rest = [&1_u32.to_le_bytes()[..], &2_u32.to_le_bytes(), &[7, 8]].concat();
        let data = [stamp, text("map"), text("a name"), numbers, rest].concat();
        let time = [seconds, 0].map(u32::to_le_bytes).concat();
        record(&[("op", &[2]), ("conn", &number), ("time", &time)], &data)
    };
    let chunk = |compression: &str, seconds: [u32; 2]| {
        let contents = [connection.clone(), message(seconds[0]), message(seconds[1])].concat();
        let data = match compression {
            "lz4" => {
                let mut encoder = lz4::EncoderBuilder::new().build(Vec::new()).unwrap();
                std::io::Write::write_all(&mut encoder, &contents).unwrap();
                encoder.finish().0
            }
            _ => contents.clone(),
        };
        let size = (contents.len() as u32).to_le_bytes();
        let chunk = record(&[("op", &[5]), ("compression", compression.as_bytes()), ("size", &size)], &data);
        let entries: Vec<u8> =
            seconds.iter().flat_map(|second| [*second, 0, 0].map(u32::to_le_bytes).concat()).collect();
        let head: [(&str, &[u8]); 4] =
            [("op", &[4]), ("ver", &[1, 0, 0, 0]), ("conn", &number), ("count", &[2, 0, 0, 0])];
        [chunk, record(&head, &entries)].concat()
    };
    let head: [(&str, &[u8]); 4] = [
        ("op", &[3]),
        ("index_pos", &[9, 0, 0, 0, 0, 0, 0, 0]),
        ("conn_count", &[1, 0, 0, 0]),
        ("chunk_count", &[2, 0, 0, 0]),
    ];
    let parts = [record(&head, &[b' '; 20]), chunk(compression, [1, 2]), chunk("none", [2, 3]), connection.clone()];
    [b"#ROSBAG V2.0\n".to_vec(), parts.concat()].concat()
}

#[test]
fn every_bag_of_ros_1_is_read_or_refused() {
    let seeds = ["none", "lz4"].map(|compression| Input(vec![bag(compression)]));
    Target {
        name: "ros1_bags",
        files: &[FILE],
        seeds: seeds.into(),
        words: &[
            "op=",
            "bz2",
            "std_msgs/Empty[] e\n",
            "int8[0] f\n",
            "[4294967295]",
            "time[]",
            "MSG: p/X\n",
            "\u{7f}\u{7f}\u{7f}\u{7f}",
        ],
        cases: 3000,
        read,
    }
    .check();
}

fn read(folder: &Path) {
    let log = match LogFile::open(folder.join(FILE)) {
        Ok(log) => log,
        Err(error) => return drop(error.to_string()),
    };
    let mut log = LogReader::new(vec![log]);
    let files = log.files().clone();
    while let Some(message) = log.next_message() {
        let channel = files[0].channel(message.channel);
        // What was converted to CDR can be decoded.
        let schema = channel
            .filter(|channel| channel.message_encoding == "cdr")
            .map(|channel| Schema::of_channel(&channel).unwrap());
        schema.into_iter().for_each(|schema| drop(schema.decode(message.data).map(|value| value.to_string().len())));
    }
    drop(log.take_damage());
}
