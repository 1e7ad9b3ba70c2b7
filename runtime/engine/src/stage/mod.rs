//! What a stage is, what it is told, and what it may do.

mod collected;
mod context;
mod error;
mod kind;
mod output;
mod parameters;
mod registry;

pub use collected::CollectedOutputs;
pub use context::{Context, RobotTopics, TfFrames, match_robot};
pub use error::StageError;
pub use kind::{InputPort, Node, OutputPort, PortType, StageKind};
pub use output::{Output, OutputSink, Sent};
pub use parameters::{ParameterError, Parameters};
pub use registry::Registry;

use crate::message::{Channel, Message};

/// A stage: takes one message at a time and sends any number.
///
/// It keeps its state itself and touches nothing else: no clock, no global, no randomness but what it seeds from
/// [`Context::seed`]. What it sends carries the log time of the message that caused it. So the same inputs give the
/// same outputs on every engine.
pub trait Stage {
    /// One message has come in on an input port: its index among the kind's input ports. Where a port takes many
    /// wires, [`Message::wire`] tells them apart.
    ///
    /// Messages come by log time; at equal times in the order of the kind's input ports (within a port that takes many
    /// in the order of the pipeline file), and within one input as they were sent.
    fn receive(&mut self, port: usize, message: &Message, output: &mut Output<'_>) -> Result<(), StageError>;

    /// The messages of channel `number` that follow on this wire ([`Message::wire`]) were logged on this channel. Comes
    /// before the first of them. Only a stage that passes on what it does not know needs it.
    fn announce(&mut self, _wire: usize, _number: u32, _channel: &Channel) -> Result<(), StageError> {
        Ok(())
    }

    /// All inputs have ended. What is sent here carries the log time that they had come to.
    fn finish(&mut self, _output: &mut Output<'_>) -> Result<(), StageError> {
        Ok(())
    }

    /// The run has failed elsewhere: leave what was made in a state that can be used, and say in it why it is not
    /// complete.
    fn abort(&mut self, _reason: &str) {}

    /// What the stage has found, for the summary of the run, as a JSON object. Asked once, after
    /// [`finish`](Self::finish).
    fn report(&self) -> Option<serde_json::Value> {
        None
    }
}

/// A stage without inputs: it makes the messages that start everything else.
pub trait Source {
    /// Sends the next message or the next few, by rising log time over all ports together. `false` when there are no
    /// more.
    fn next(&mut self, output: &mut Output<'_>) -> Result<bool, StageError>;

    /// How much of its work is done, 0 to 1, if it can tell.
    fn progress(&self) -> Option<f64> {
        None
    }

    /// See [`Stage::report`].
    fn report(&self) -> Option<serde_json::Value> {
        None
    }
}
