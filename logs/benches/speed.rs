//! The speed of reading and writing logs, compared with the `mcap` crate on the same data in the same run.
//!
//!     cargo bench -p gridweave-logs --bench speed
//!
//! - Reading: the messages in log time order, compared with a scan of the records with the same checksums
//!   (`mcap::sans_io::LinearReader`), and with `mcap::MessageStream`. All three read the file.
//! - Writing: `LogWriter`, compared with `mcap::Writer` with the same chunks, compression and checksums, both to a file
//!   that does not exist; and `LogWriter` to an existing file, which it replaces only when the new one is on the disk.
//! - `info`: `gridweave info` on a file of 2 GB with an index.
//!
//! The candidates run alternately, and the minimum time of each is reported, since other load on the machine only adds
//! time.

// A benchmark that cannot continue can only stop.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use gridweave_logs::info::glance;
use gridweave_logs::names::{Input, NameRules};
use gridweave_logs::reader::{LogFile, LogReader};
use gridweave_logs::sink::{Compression, LogOptions, LogWriter, Outcome};
use gridweave_runtime::message::Channel;
use gridweave_runtime::stage::RobotTopics;
use mcap::records::{MessageHeader, Record};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::fs::File;
use std::hint::black_box;
use std::io::{BufWriter, Read};
use std::path::Path;
use std::time::{Duration, Instant};

/// The size of all messages in a log, bytes.
const BYTES: usize = 64 << 20;
const SIZES: [(&str, usize); 2] = [("100 B", 100), ("1 MB", 1_000_000)];
const COMPRESSIONS: [(&str, Compression); 3] =
    [("none", Compression::None), ("lz4", Compression::Lz4), ("zstd", Compression::Zstd)];
const ROUNDS: usize = 7;
const CHUNK_SIZE: u64 = 1 << 20;

/// A message that compresses about like maps and scans: runs of one value, and noise.
fn message(size: usize, number: usize) -> Vec<u8> {
    let mut state = number as u64 | 1;
    let mut bytes = Vec::with_capacity(size);
    while bytes.len() < size {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let (value, length) = ((state >> 56) as u8, 1 + (state >> 40) as usize % 24);
        bytes.extend(std::iter::repeat_n(value, length));
    }
    bytes.truncate(size);
    bytes
}

fn channel() -> Channel {
    let (topic, schema_name) = ("/robot1/data".into(), "std_msgs/msg/String".into());
    let (message_encoding, schema_encoding) = ("cdr".into(), "ros2msg".into());
    Channel {
        topic,
        message_encoding,
        schema_name,
        schema_encoding,
        schema: b"string data".to_vec(),
        ..Default::default()
    }
}

fn header(channel_id: u16, sequence: usize) -> MessageHeader {
    let time = 1_000_000_000 + 1000 * sequence as u64;
    MessageHeader { channel_id, sequence: sequence as u32, log_time: time, publish_time: time }
}

/// Writes messages with `LogWriter`, cycling through `messages`.
fn write(path: &Path, compression: Compression, messages: &[Vec<u8>], count: usize) {
    let mut log = LogWriter::create(path, LogOptions { compression, chunk_size: CHUNK_SIZE }).unwrap();
    let channel_id = log.channel(&channel()).unwrap();
    for number in 0..count {
        log.write(&header(channel_id, number), &messages[number % messages.len()]).unwrap();
    }
    log.finish(Outcome::Complete).unwrap();
}

/// The same with `mcap::Writer`.
fn write_bare(path: &Path, compression: Compression, messages: &[Vec<u8>], count: usize) {
    let (compression, level) = match compression {
        Compression::None => (None, 0),
        Compression::Lz4 => (Some(mcap::Compression::Lz4), 0),
        // The level of `LogWriter`.
        Compression::Zstd => (Some(mcap::Compression::Zstd), 1),
    };
    let options = mcap::WriteOptions::new().profile("ros2").chunk_size(Some(CHUNK_SIZE)).compression(compression);
    let options = options.compression_level(level).compression_threads(0);
    let mut writer = options.create(BufWriter::new(File::create(path).unwrap())).unwrap();
    let Channel { topic, message_encoding, schema_name, schema_encoding, schema, metadata } = channel();
    let schema = writer.add_schema(&schema_name, &schema_encoding, &schema).unwrap();
    let channel_id = writer.add_channel(schema, &topic, &message_encoding, &metadata).unwrap();
    for number in 0..count {
        writer.write_to_known_channel(&header(channel_id, number), &messages[number % messages.len()]).unwrap();
    }
    writer.finish().unwrap();
}

/// The size of all messages, read with `LogReader`.
fn read(path: &Path) -> usize {
    let mut reader = LogReader::new(vec![LogFile::open(path).unwrap()]);
    let mut bytes = 0;
    while let Some(message) = reader.next_message() {
        bytes += black_box(message.data).len();
    }
    assert!(reader.take_damage().is_empty());
    bytes
}

/// The same by scanning the records.
fn read_bare(path: &Path) -> usize {
    let mut file = File::open(path).unwrap();
    let mut walk = LinearReader::new_with_options(LinearReaderOptions::default().with_validate_chunk_crcs(true));
    let mut bytes = 0;
    while let Some(event) = walk.next_event() {
        match event.unwrap() {
            LinearReadEvent::ReadRequest(wanted) => {
                let read = file.read(walk.insert(wanted)).unwrap();
                walk.notify_read(read);
            }
            LinearReadEvent::Record { data, opcode } => {
                if let Record::Message { data, .. } = mcap::parse_record(opcode, data).unwrap() {
                    bytes += black_box(data).len();
                }
            }
        }
    }
    bytes
}

/// The same with `mcap::MessageStream`.
fn read_stream(path: &Path) -> usize {
    let file = std::fs::read(path).unwrap();
    mcap::MessageStream::new(&file).unwrap().map(|message| black_box(message.unwrap().data).len()).sum()
}

/// The minimum time of each candidate, which run alternately. The time of `before` is not counted.
fn race<const N: usize>(before: impl Fn(), contestants: [&dyn Fn(); N]) -> [Duration; N] {
    let mut least = [Duration::MAX; N];
    for _ in 0..ROUNDS {
        for (least, contestant) in least.iter_mut().zip(contestants) {
            before();
            let start = Instant::now();
            contestant();
            *least = (*least).min(start.elapsed());
        }
    }
    least
}

fn main() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    println!(
        "| messages | compression | read, MB/s | x bare walk | x MessageStream | written, MB/s | x bare writer | replaced, MB/s |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    for (name, size) in SIZES {
        let count = BYTES / size;
        let messages: Vec<Vec<u8>> = (0..count.min(5000)).map(|number| message(size, number)).collect();
        for (label, compression) in COMPRESSIONS {
            let fresh = folder.path().join("fresh.mcap");
            let remove = || drop(std::fs::remove_file(&fresh));
            let [written, written_bare] = race(
                remove,
                [&|| write(&fresh, compression, &messages, count), &|| {
                    write_bare(&fresh, compression, &messages, count)
                }],
            );
            let [replaced] = race(|| (), [&|| write(&path, compression, &messages, count)]);
            let expected = count * size;
            let [read, walked, streamed] = race(
                || (),
                [&|| assert_eq!(read(&path), expected), &|| assert_eq!(read_bare(&path), expected), &|| {
                    assert_eq!(read_stream(&path), expected)
                }],
            );
            let speed = |time: Duration| expected as f64 * 1e-6 / time.as_secs_f64();
            let times = |other: Duration, own: Duration| other.as_secs_f64() / own.as_secs_f64();
            println!(
                "| {name} | {label} | {:.0} | {:.2} | {:.2} | {:.0} | {:.2} | {:.0} |",
                speed(read),
                times(walked, read),
                times(streamed, read),
                speed(written),
                times(written_bare, written),
                speed(replaced)
            );
        }
    }
    let large: Vec<Vec<u8>> = (0..20).map(|number| message(1_000_000, number)).collect();
    write(&path, Compression::None, &large, 2_000);
    let look = || drop(glance(&[Input::new(&path)], &NameRules::default(), &RobotTopics::default()).unwrap());
    let [time] = race(|| (), [&look]);
    let size = std::fs::metadata(&path).unwrap().len() as f64 * 1e-9;
    println!("\n`info` on {size:.2} GB with an index: {:.1} ms", time.as_secs_f64() * 1e3);
}
