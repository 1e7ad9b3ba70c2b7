//! The two ends of a bridge, on this machine, and a wire between them that can be cut.

use crate::waiting::{sent, wait_for};
use crate::wire::WATCHDOG;
use gridweave_runtime::message::{Channel, FixedText, LogTime, Message, MessageFlags, MessageHeader};
use gridweave_runtime::ros::{Header, MapMetaData, OccupancyGrid, PoseWithCovarianceStamped, RosMessage, encode};
use gridweave_runtime::stage::{Context, InputWire, StageHarness};
use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

pub(crate) fn free_endpoint() -> (String, u16) {
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    (format!("tcp/127.0.0.1:{port}"), port)
}

pub(crate) fn source(endpoint: &str, more: &str) -> StageHarness {
    let parameters = format!("listen = [\"{endpoint}\"]\n{more}");
    StageHarness::new(&gridweave_bridge::source::kind(), &parameters).unwrap()
}

pub(crate) fn sink(endpoint: &str, more: &str) -> StageHarness {
    let wire = |(output, ros_type): (&'static str, &str)| InputWire {
        port: "in",
        from: "robots".into(),
        output,
        ros_type: ros_type.to_owned(),
        ..Default::default()
    };
    let wires =
        [("map", OccupancyGrid::NAME), ("pose", PoseWithCovarianceStamped::NAME), ("conflicts", OccupancyGrid::NAME)];
    let context = Context { stage: "base".into(), inputs: wires.map(wire).to_vec(), ..Default::default() };
    let parameters = format!("connect = [\"{endpoint}\"]\n{more}");
    StageHarness::with_context(&gridweave_bridge::sink::kind(), &parameters, &context).unwrap()
}

pub(crate) fn map(frame: &str, time: u64, size: usize) -> Vec<u8> {
    let info = MapMetaData { width: size as u32, height: size as u32, resolution: 0.05, ..Default::default() };
    let data: Vec<u8> = (0..size * size).map(|at| if at % 7 == time as usize % 7 { 100 } else { 0 }).collect();
    encode(&OccupancyGrid { header: Header::new(LogTime(time), frame), info, data: &data }).unwrap()
}

pub(crate) fn give(sink: &mut StageHarness, wire: usize, robot: &str, topic: &str, time: u64, bytes: Vec<u8>) {
    let (robot, topic) = (FixedText::new(robot).unwrap(), FixedText::new(topic).unwrap());
    let header = MessageHeader { robot, topic, log_time: LogTime(time), publish_time: time, ..Default::default() };
    sink.give_message("in", Message::from_vec(header, bytes).on_wire(wire)).unwrap();
}

pub(crate) fn give_pose(sink: &mut StageHarness, time: u64) {
    let pose = PoseWithCovarianceStamped { header: Header::new(LogTime(time), "robot1/map"), ..Default::default() };
    give(sink, 1, "robot1", "/robot1/pose", time, encode(&pose).unwrap());
}

fn times(messages: &[Message]) -> Vec<u64> {
    messages.iter().map(|message| message.header().log_time.0).collect()
}

#[test]
fn messages_come_as_they_were_sent_on_the_port_that_they_are_for() {
    let (endpoint, _) = free_endpoint();
    let mut source = source(&endpoint, "");
    let mut sink = sink(&endpoint, "");
    let maps: Vec<Vec<u8>> = (1..6).map(|time| map("robot1/map", time, 20 + 10 * time as usize)).collect();
    for (time, bytes) in (1..).zip(&maps) {
        give(&mut sink, 0, "robot1", "/robot1/map", time, bytes.clone());
        give_pose(&mut sink, time);
    }
    give(&mut sink, 2, "", "/map_conflicts", 9, map("world", 9, 3));
    let came = sent(&mut source, "map", 5);
    assert_eq!(times(&came), [1, 2, 3, 4, 5]);
    assert!(came.iter().map(Message::bytes).eq(maps.iter().map(Vec::as_slice)));
    assert_eq!((came[0].robot(), came[0].header().topic.as_str()), ("robot1", "/robot1/map"));
    assert_eq!(times(&sent(&mut source, "pose", 5)), [1, 2, 3, 4, 5]);
    // What there is no port for comes with the others, and its channel says what it is.
    let mut others = Vec::new();
    wait_for(&mut source, "other", |source| {
        others.extend(source.take_messages("other"));
        others.len() >= 2
    });
    let channel = Channel::decode(others[0].bytes()).unwrap();
    assert_eq!((channel.topic.as_str(), channel.schema_name.as_str()), ("/map_conflicts", OccupancyGrid::NAME));
    assert_eq!((others[1].header().channel, others[1].bytes()), (others[0].header().channel, &*map("world", 9, 3)));
}

#[test]
fn an_end_is_received_and_a_sender_without_one_is_gone() {
    let (endpoint, _) = free_endpoint();
    let mut source = source(&endpoint, "end_after = 1");
    let mut dies = sink(&endpoint, "sender = \"dies\"");
    give_pose(&mut dies, 1);
    sent(&mut source, "pose", 1);
    drop(dies);
    wait_for(&mut source, "gone", |source| source.warnings().keys().any(|text| text.contains("`dies` is gone")));
    let ends = thread::spawn({
        let endpoint = endpoint.clone();
        move || {
            let mut ends = sink(&endpoint, "sender = \"ends\"");
            give_pose(&mut ends, 2);
            ends.finish(LogTime(2)).unwrap();
            (ends.warnings(), ends.counts())
        }
    });
    let until = Instant::now() + WATCHDOG;
    while source.node().advance().unwrap() {
        assert!(Instant::now() < until, "{:?}", source.warnings());
        source.node().wait(Duration::from_millis(20));
    }
    let (warnings, counts) = ends.join().unwrap();
    assert_eq!((warnings.len(), counts["messages taken by the other end"]), (0, 1), "{warnings:?}");
    assert_eq!(source.counts()["senders that have ended"], 1);
    assert!(!source.warnings().keys().any(|text| text.contains("`ends`")), "{:?}", source.warnings());
}

#[test]
fn an_end_without_a_receiver_is_reported() {
    let (endpoint, _) = free_endpoint();
    let mut sink = sink(&endpoint, "linger = 0.1");
    give_pose(&mut sink, 1);
    sink.finish(LogTime(1)).unwrap();
    let warnings = sink.warnings();
    assert!(warnings.keys().any(|text| text.contains("has not acknowledged the end")), "{warnings:?}");
    assert_eq!(sink.counts()["messages that were not acknowledged before the end"], 1);
}

/// A wire between two ports of this machine, which can be cut.
pub(crate) struct Wire {
    is_cut: Arc<AtomicBool>,
    streams: Arc<Mutex<Vec<TcpStream>>>,
    passed: Arc<Mutex<Vec<u8>>>,
}

impl Wire {
    pub(crate) fn new(to: u16) -> (Self, String) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let endpoint = format!("tcp/{}", listener.local_addr().unwrap());
        let (is_cut, streams) = (Arc::<AtomicBool>::default(), Arc::<Mutex<Vec<TcpStream>>>::default());
        let (cut, open) = (Arc::clone(&is_cut), Arc::clone(&streams));
        let passed = Arc::<Mutex<Vec<u8>>>::default();
        let seen = Arc::clone(&passed);
        thread::spawn(move || {
            for near in listener.incoming().flatten() {
                // Nobody answers where the wire is cut.
                let Ok(far) = TcpStream::connect(("127.0.0.1", to)) else { continue };
                if cut.load(Ordering::SeqCst) {
                    continue;
                }
                for (mut from, mut to) in [(near.try_clone().unwrap(), far.try_clone().unwrap()), (far, near)] {
                    open.lock().unwrap().push(from.try_clone().unwrap());
                    let seen = Arc::clone(&seen);
                    thread::spawn(move || {
                        let mut bytes = [0; 4096];
                        while let Ok(count @ 1..) = from.read(&mut bytes) {
                            seen.lock().unwrap().extend_from_slice(&bytes[..count]);
                            if to.write_all(&bytes[..count]).is_err() {
                                break;
                            }
                        }
                        let _ = to.shutdown(Shutdown::Both);
                    });
                }
            }
        });
        (Self { is_cut, streams, passed }, endpoint)
    }

    /// All that has passed, either way.
    pub(crate) fn passed(&self) -> Vec<u8> {
        self.passed.lock().unwrap().clone()
    }

    pub(crate) fn cut(&self) {
        self.is_cut.store(true, Ordering::SeqCst);
        for stream in self.streams.lock().unwrap().drain(..) {
            let _ = stream.shutdown(Shutdown::Both);
        }
    }

    pub(crate) fn restore(&self) {
        self.is_cut.store(false, Ordering::SeqCst);
    }
}

#[test]
fn a_wire_that_is_cut_again_and_again_delays_and_no_more() {
    let (endpoint, port) = free_endpoint();
    let mut source = source(&endpoint, "");
    let (wire, by_wire) = Wire::new(port);
    let mut sink = sink(&by_wire, "sender = \"robot\"\ninterval = 0.0");
    let (mut time, mut poses, mut maps) = (0, Vec::new(), Vec::new());
    for round in 0..3 {
        for _ in 0..20 {
            time += 1;
            give_pose(&mut sink, time);
            give(&mut sink, 0, "robot1", "/robot1/map", time, map("robot1/map", time, 100 + 10 * round));
        }
        let so_far = poses.len();
        poses.extend(sent(&mut source, "pose", 5));
        assert!(poses.len() > so_far);
        wire.cut();
        let gone = |source: &StageHarness| {
            source.warnings().iter().filter(|(text, _)| text.contains("is gone")).map(|(_, count)| *count).sum::<u64>()
        };
        wait_for(&mut source, "gone", |source| gone(source) > round as u64);
        wire.restore();
    }
    let is_data = |message: &Message| message.header().flags.contains(MessageFlags::DATA);
    wait_for(&mut source, "all", |source| {
        poses.extend(source.take_messages("pose").into_iter().filter(is_data));
        maps.extend(source.take_messages("map").into_iter().filter(is_data));
        poses.len() >= 60 && maps.len() >= 60
    });
    assert_eq!(times(&poses), (1..=60).collect::<Vec<_>>());
    assert_eq!(times(&maps), (1..=60).collect::<Vec<_>>());
    assert_eq!(maps[59].bytes(), map("robot1/map", 60, 120));
}

#[test]
fn a_base_that_is_started_again_gets_the_last_of_each_topic() {
    let (endpoint, _) = free_endpoint();
    let mut first = source(&endpoint, "");
    let mut sink = sink(&endpoint, "");
    for time in 1..4 {
        give(&mut sink, 0, "robot1", "/robot1/map", time, map("robot1/map", time, 50));
    }
    sent(&mut first, "map", 3);
    drop(first);
    let mut second = source(&endpoint, "");
    let came = sent(&mut second, "map", 1);
    assert_eq!((times(&came), came[0].bytes()), (vec![3], &*map("robot1/map", 3, 50)));
    give(&mut sink, 0, "robot1", "/robot1/map", 4, map("robot1/map", 4, 60));
    let came = sent(&mut second, "map", 1);
    assert_eq!((times(&came), came[0].bytes()), (vec![4], &*map("robot1/map", 4, 60)));
}

#[test]
fn the_merged_map_of_a_base_is_the_map_of_a_robot_to_the_next() {
    let (endpoint, _) = free_endpoint();
    let mut source = source(&endpoint, "");
    let mut sink = sink(&endpoint, "robot = \"floor1\"");
    give(&mut sink, 0, "", "/map", 5, map("world", 5, 10));
    let came = sent(&mut source, "map", 1).remove(0);
    assert_eq!((came.robot(), came.header().topic.as_str()), ("floor1", "/floor1/map"));
    assert_eq!(came.decode::<OccupancyGrid<'_>>().unwrap().header.frame_id, "floor1/world");
}

#[test]
fn two_senders_of_one_name_and_a_missing_base_are_reported() {
    let (endpoint, _) = free_endpoint();
    let mut lonely = sink(&endpoint, "bridge = \"other\"");
    let mut source = source(&endpoint, "");
    let (mut one, mut two) = (sink(&endpoint, "sender = \"twin\""), sink(&endpoint, "sender = \"twin\""));
    give_pose(&mut one, 1);
    give_pose(&mut two, 2);
    assert_eq!(sent(&mut source, "pose", 2).len(), 2);
    wait_for(&mut source, "twins", |source| {
        source.warnings().keys().any(|text| text.contains("two senders are called `twin`"))
    });
    let until = Instant::now() + WATCHDOG;
    while !lonely.warnings().keys().any(|text| text.contains("no receiver of the bridge `other`")) {
        assert!(Instant::now() < until, "{:?}", lonely.warnings());
        give_pose(&mut lonely, 3);
        thread::yield_now();
    }
}

#[test]
fn access_by_others_must_be_configured() {
    for (kind, parameters) in [
        (gridweave_bridge::source::kind(), "listen = [\"tcp/0.0.0.0:0\"]"),
        (gridweave_bridge::sink::kind(), "connect = [\"tcp/10.0.0.1:7448\"]"),
    ] {
        let error = StageHarness::new(&kind, parameters).err().unwrap().to_string();
        assert!(error.contains("not encrypted") && error.contains("insecure = true"), "{error}");
    }
}
