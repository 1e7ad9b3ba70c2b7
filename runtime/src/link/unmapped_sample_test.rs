//! A sample whose memory a reader cannot map, as when its address space or its files are used up.

use super::{
    InputQueue, LinkReceiver, LinkSender, LinkShape, Order, PortCounters, ReaderEnd, RunNames, SenderRole,
    SharedCounters, StageState,
};
use crate::message::{LogTime, MessageFlags, MessageHeader};
use crate::pipeline::Overflow;
use iceoryx2::service::ipc::Service as Ipc;
use std::fs;
use std::path::Path;

const DEPTH: usize = 4;

/// The segments of samples of a run.
fn segments(prefix: &str) -> Vec<String> {
    let files = fs::read_dir(super::shared_memory::SHARED_MEMORY_FOLDER).unwrap().flatten();
    let names = files.map(|file| file.file_name().to_string_lossy().into_owned());
    names.filter(|name| name.starts_with(prefix) && name.ends_with(".data")).collect()
}

#[test]
fn a_sample_that_a_reader_of_a_replay_cannot_map_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let prefix = format!("gwunmapped{}_", std::process::id());
    let names = RunNames::shared(&prefix, folder.path().to_string_lossy());
    let counters = SharedCounters::new(&[(0, 1), (1, 0)]);
    counters.stage(1).set_state(StageState::Running);
    let node = names.node::<Ipc>().unwrap();
    let (order, overflow) = (Order::LogTime, Overflow::Wait);
    let shape = LinkShape { stage: "a", port: "b", readers: 1, depth: DEPTH, order, overflow };
    let end = || ReaderEnd { counters: counters.stage(1), wire: 0, depth: DEPTH };
    let port = || PortCounters { counters: counters.stage(0), port: 0 };
    let role = SenderRole::Owner;
    let mut sender = LinkSender::<Ipc>::new(&node, &names, &shape, vec![end()], port(), role, false).unwrap();
    let mut reader = LinkReceiver::<Ipc>::new(&node, &names, &shape, end(), port()).unwrap();
    let mut queue = InputQueue::default();
    let mut send = |size: usize, time: u64| {
        let header = MessageHeader {
            log_time: LogTime(time),
            length: size as u64,
            flags: MessageFlags::DATA,
            ..Default::default()
        };
        assert!(sender.has_credit());
        sender.send_bytes(header, &vec![1; size]).unwrap();
    };
    reader.receive(&mut queue).unwrap();
    send(3, 1);
    reader.receive(&mut queue).unwrap();
    assert_eq!(queue.len(), 1);

    // A large sample is in another segment, which is gone before the reader maps it.
    let before = segments(&prefix);
    send(1 << 20, 2);
    let added: Vec<String> = segments(&prefix).into_iter().filter(|name| !before.contains(name)).collect();
    assert_eq!(added.len(), 1, "{before:?} {added:?}");
    let segment = Path::new(super::shared_memory::SHARED_MEMORY_FOLDER).join(&added[0]);
    fs::remove_file(segment).unwrap();
    let error = reader.receive(&mut queue).unwrap_err().to_string();
    assert!(error.contains("cannot receive from a.b") && error.contains("cannot be mapped"), "{error}");
}
