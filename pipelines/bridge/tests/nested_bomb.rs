//! A forged sender over the network: a batch of few bytes whose messages expand to gigabytes.

#![allow(clippy::unwrap_used)]

use gridweave_bridge::source;
use gridweave_bridge::zenoh_session::{join, peer_config};
use gridweave_runtime::message::{Message, MessageFlags};
use gridweave_runtime::ros::{OccupancyGrid, RosMessage, decode, encode};
use gridweave_runtime::stage::StageHarness;
use serde::{Deserialize, Serialize};
use std::fs;
use std::net::TcpListener;
use std::time::{Duration, Instant};
use zenoh::{Session, Wait};

/// A test that waits for longer hangs.
const WATCHDOG: Duration = Duration::from_secs(120);
/// What one message of the bomb expands to, the largest that a receiver allows, and the number of messages.
const LARGE: usize = 128 << 20;
const MESSAGES: usize = 72;
/// More than the receiver may take for one batch, and far less than the 9 GB that it expands to.
const MOST_MEMORY: u64 = 2 << 30;

/// A batch as the protocol has it on the wire.
#[derive(Clone, Default, Serialize)]
struct Batch {
    sender: String,
    session: u64,
    handshake: u64,
    number: u64,
    receiver: u64,
    clock_offset: i64,
    dropped: u64,
    is_end: bool,
    links: Vec<Link>,
    entries: Vec<Entry>,
}

#[derive(Clone, Serialize)]
struct Link {
    port: String,
    ros_type: String,
}

#[derive(Clone, Serialize)]
struct Entry {
    link: u32,
    form: Form,
    channel: u32,
    log_sequence: u32,
    log_time: u64,
    publish_time: u64,
    robot: String,
    topic: String,
    bytes: Vec<u8>,
}

#[derive(Clone, Copy, Serialize)]
#[allow(dead_code)]
enum Form {
    Whole,
    Difference,
    Beginning,
}

#[derive(Debug, PartialEq, Deserialize)]
struct Answer {
    receiver: u64,
    number: u64,
    outcome: Outcome,
    came: i64,
    answered: i64,
    text: String,
}

#[derive(Debug, PartialEq, Deserialize)]
enum Outcome {
    Taken,
    Unknown,
    Unreadable,
}

fn packed(plain: &[u8]) -> Vec<u8> {
    let mut compressor = zstd::bulk::Compressor::new(19).unwrap();
    compressor.include_checksum(true).unwrap();
    compressor.compress(plain).unwrap()
}

fn on_the_wire(batch: &Batch) -> Vec<u8> {
    [&1_u32.to_le_bytes()[..], &packed(&encode(batch).unwrap())].concat()
}

/// A forged sender, and the receiver that it sends to.
struct World {
    session: Session,
    receiver: StageHarness,
    messages: Vec<Message>,
}

impl World {
    fn new() -> Self {
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let endpoint = format!("tcp/127.0.0.1:{port}");
        let receiver = StageHarness::new(&source::kind(), &format!("listen = [\"{endpoint}\"]")).unwrap();
        let session = join(peer_config(&[endpoint], &[], &[("scouting/multicast/enabled", "false")])).unwrap();
        Self { session, receiver, messages: Vec::new() }
    }

    /// Sends a batch until it is answered.
    fn send(&mut self, batch: &Batch) -> Answer {
        let (bytes, until) = (on_the_wire(batch), Instant::now() + WATCHDOG);
        loop {
            let query = self.session.get("gridweave/bridge/base/receiver/*/*").payload(bytes.clone()).timeout(WATCHDOG);
            let replies = query.wait().unwrap();
            // No reply is left once the receiver has answered, or if it is not known yet.
            while !replies.is_disconnected() || !replies.is_empty() {
                assert!(Instant::now() < until, "{:?}", self.receiver.warnings());
                if let Ok(Some(reply)) = replies.try_recv() {
                    let bytes = reply.result().unwrap().payload().to_bytes();
                    let plain = zstd::bulk::decompress(&bytes[4..], 1 << 20).unwrap();
                    return decode(&plain).unwrap();
                }
                self.receiver.node().wait(Duration::from_millis(5));
                self.receiver.node().advance().unwrap();
                let is_data = |message: &Message| message.header().flags.contains(MessageFlags::DATA);
                self.messages.extend(self.receiver.take_messages("map").into_iter().filter(is_data));
            }
        }
    }
}

/// A batch of one sender.
fn batch(session: u64, receiver: u64, entries: Vec<Entry>) -> Batch {
    let number = u64::from(receiver != 0);
    let links = match receiver {
        0 => vec![Link { port: "map".into(), ros_type: OccupancyGrid::NAME.into() }],
        _ => Vec::new(),
    };
    Batch { sender: "forged".into(), session, handshake: 1, number, receiver, links, entries, ..Default::default() }
}

fn entry(form: Form, bytes: Vec<u8>) -> Entry {
    let (robot, topic) = ("robot1".into(), "/robot1/map".into());
    Entry { link: 0, form, channel: 0, log_sequence: 0, log_time: 1, publish_time: 1, robot, topic, bytes }
}

/// The most memory that this process has used so far, bytes.
fn peak_memory() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
    1024 * line.trim().trim_end_matches(" kB").parse::<u64>().unwrap()
}

#[test]
fn a_batch_of_few_bytes_that_expands_to_gigabytes_is_refused_and_the_receiver_goes_on() {
    let mut world = World::new();
    let bomb = vec![entry(Form::Beginning, packed(&vec![0; LARGE])); MESSAGES];
    let handshake = world.send(&batch(7, 0, Vec::new()));
    assert_eq!(handshake.outcome, Outcome::Taken);
    let bomb = batch(7, handshake.receiver, bomb);
    let size = on_the_wire(&bomb).len();
    assert!(size < 2000, "{size} bytes");
    let answer = world.send(&bomb);
    assert_eq!(answer.outcome, Outcome::Unreadable);
    assert!(answer.text.contains("expands to") || answer.text.contains("too many large messages"), "{}", answer.text);
    let warnings = world.receiver.warnings();
    assert!(warnings.keys().any(|text| text.contains("cannot read a batch of the sender `forged`")), "{warnings:?}");
    assert!(peak_memory() < MOST_MEMORY, "{} bytes", peak_memory());

    // Another sender is taken as before.
    let handshake = world.send(&batch(8, 0, Vec::new()));
    let good = world.send(&batch(8, handshake.receiver, vec![entry(Form::Whole, vec![1, 2, 3])]));
    assert_eq!((good.outcome, good.text.as_str()), (Outcome::Taken, ""));
    assert_eq!(world.messages.last().map(Message::bytes), Some(&[1, 2, 3][..]));
}
