//! Messages for a stage, and waiting for what it does.

use crate::wire::WATCHDOG;
use gridweave_runtime::message::{FixedText, Message, MessageFlags, MessageHeader};
use gridweave_runtime::stage::StageHarness;
use std::time::{Duration, Instant};

/// Lets a stage go on until this is so.
#[track_caller]
pub(crate) fn wait_for(stage: &mut StageHarness, what: &str, mut is_so: impl FnMut(&mut StageHarness) -> bool) {
    let until = Instant::now() + WATCHDOG;
    while !is_so(stage) {
        assert!(Instant::now() < until, "still waits for {what}: {:?} {:?}", stage.warnings(), stage.counts());
        stage.node().wait(Duration::from_millis(20));
        stage.node().advance().unwrap();
    }
}

/// Lets a source go on until it has sent so many messages on an output, and gives them.
#[track_caller]
pub(crate) fn sent(source: &mut StageHarness, output: &str, count: usize) -> Vec<Message> {
    let mut messages = Vec::new();
    wait_for(source, output, |source| {
        // Before the first message its channel is announced.
        let is_data = |message: &Message| message.header().flags.contains(MessageFlags::DATA);
        messages.extend(source.take_messages(output).into_iter().filter(is_data));
        messages.len() >= count
    });
    messages
}

/// Lets a source go on until it has warned of something, and gives that.
#[track_caller]
pub(crate) fn warned(source: &mut StageHarness, of: &str) -> String {
    let mut text = None;
    wait_for(source, &format!("warning of {of}"), |source| {
        text = source.warnings().into_keys().find(|text| text.contains(of));
        text.is_some()
    });
    text.unwrap()
}

/// Publishes a message by a sink.
pub(crate) fn give(sink: &mut StageHarness, wire: usize, topic: &str, bytes: Vec<u8>) {
    let topic = FixedText::new(topic).unwrap();
    let message = Message::from_vec(MessageHeader { topic, ..Default::default() }, bytes);
    sink.give_message("in", message.on_wire(wire)).unwrap();
}
