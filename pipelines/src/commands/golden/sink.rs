//! The sink of a case: keeps the messages of the stage.

use super::recording::Recorded;
use gridweave_logs::sink::result_channel;
use gridweave_runtime::message::{Channel, Message};
use gridweave_runtime::stage::{Context, InputWire, Output, StageError, StageKind};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

/// Received messages, by log time.
pub(super) type Received = Arc<Mutex<Vec<Recorded>>>;

/// Makes the kind of a sink that keeps all messages in `received`. Its wires are the output ports of the stage, in
/// order.
pub(super) fn kind(name: &'static str, received: Received) -> StageKind {
    let make = move |(): (), context: &Context| {
        let inputs = context.inputs.clone();
        Ok(CaseSink { received: Arc::clone(&received), inputs, channels: BTreeMap::new() })
    };
    StageKind::stage(name, "Keeps the messages of a stage.", make)
        .any_inputs("messages", "the messages of the stage", CaseSink::receive)
        .announce(CaseSink::announce)
        .build()
}

struct CaseSink {
    received: Received,
    inputs: Vec<InputWire>,
    /// Channels by wire, number and topic; results of the stage have the number 0.
    channels: BTreeMap<(usize, u32, String), Arc<Channel>>,
}

impl CaseSink {
    fn announce(&mut self, wire: usize, number: u32, channel: &Channel) -> Result<(), StageError> {
        self.channels.insert((wire, number, channel.topic.clone()), Arc::new(channel.clone()));
        Ok(())
    }

    fn receive(&mut self, message: &Message, _: &Output<()>) -> Result<(), StageError> {
        let (header, wire) = (message.header(), message.wire());
        let topic = header.topic.as_str();
        let key = (wire, header.channel, topic.to_owned());
        let channel = match self.channels.get(&key) {
            Some(channel) => Arc::clone(channel),
            None => {
                let input = self.inputs.get(wire).filter(|input| !input.ros_type.is_empty() && header.channel == 0);
                let input = input.ok_or_else(|| {
                    StageError::new(format!("keep a message on {topic}"), "its type is not known")
                        .with_help("announce a channel before the message, or give the output port a type")
                })?;
                let channel = Arc::new(result_channel(topic, &input.ros_type, &input.definition));
                self.channels.insert(key, Arc::clone(&channel));
                channel
            }
        };
        let recorded = Recorded {
            channel,
            port: Some(wire),
            log_time: header.log_time,
            publish_time: header.publish_time,
            bytes: message.bytes().to_vec(),
        };
        // A sink that has panicked while it held the lock has ended the run.
        let mut received = self.received.lock().map_err(|error| StageError::new("keep a message", error))?;
        received.push(recorded);
        Ok(())
    }
}
