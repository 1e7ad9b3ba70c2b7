//! A stage, ready to run, as the engines see it: without its types.

use super::StageError;
use super::output::SentCounts;
use crate::message::{Channel, LogTime, Message};
use std::collections::BTreeMap;
use std::time::Duration;

/// A stage of a pipeline, made and tied to its links.
pub struct Node {
    pub(super) role: Role,
    pub(super) sent: SentCounts,
}

/// What a stage is to the engine that runs it.
pub(super) enum Role {
    /// It has inputs.
    Stage(Box<dyn RunningStage>),
    /// It has none.
    Source(Box<dyn RunningSource>),
    /// It has none, and its messages come from outside of the run.
    External,
}

pub(super) trait RunningStage {
    fn receive(&mut self, port: usize, message: &Message) -> Result<(), StageError>;
    fn announce(&mut self, wire: usize, number: u32, channel: &Channel) -> Result<(), StageError>;
    fn finish(&mut self) -> Result<(), StageError>;
    fn abort(&mut self, reason: &str);
}

pub(super) trait RunningSource {
    fn next(&mut self) -> Result<bool, StageError>;
    fn wait(&mut self, longest: Duration);
    fn finish(&mut self) -> Result<(), StageError>;
    fn progress(&self) -> Option<f64>;
    fn abort(&mut self, reason: &str);
}

impl Node {
    /// Whether the stage is a source.
    pub fn is_source(&self) -> bool {
        matches!(self.role, Role::Source(_))
    }

    /// Whether the messages of the stage come from outside of the run.
    pub fn is_external(&self) -> bool {
        matches!(self.role, Role::External)
    }

    /// Lets a source send the next of its messages. `false` if there are no more, and for a stage that is no source.
    pub fn advance(&mut self) -> Result<bool, StageError> {
        match &mut self.role {
            Role::Source(source) => source.next(),
            Role::Stage(_) | Role::External => Ok(false),
        }
    }

    /// Lets a source wait for something to send.
    pub fn wait(&mut self, longest: Duration) {
        if let Role::Source(source) = &mut self.role {
            source.wait(longest);
        }
    }

    /// How much of its work a source has done, 0 to 1, if it can tell.
    pub fn progress(&self) -> Option<f64> {
        match &self.role {
            Role::Source(source) => source.progress(),
            Role::Stage(_) | Role::External => None,
        }
    }

    /// Hands a message to a stage that has come in on an input port, by its index among the kind's input ports.
    pub fn receive(&mut self, port: usize, message: &Message) -> Result<(), StageError> {
        match &mut self.role {
            Role::Stage(stage) => stage.receive(port, message),
            Role::Source(_) | Role::External => Ok(()),
        }
    }

    /// Tells a stage that the messages of channel `number` that follow on a wire were logged on `channel`.
    pub fn announce(&mut self, wire: usize, number: u32, channel: &Channel) -> Result<(), StageError> {
        match &mut self.role {
            Role::Stage(stage) => stage.announce(wire, number, channel),
            Role::Source(_) | Role::External => Ok(()),
        }
    }

    /// Ends a stage whose inputs have all ended, or a source that is asked to end.
    pub fn finish(&mut self) -> Result<(), StageError> {
        match &mut self.role {
            Role::Stage(stage) => stage.finish(),
            Role::Source(source) => source.finish(),
            Role::External => Ok(()),
        }
    }

    /// Tells a stage that the run has failed.
    pub fn abort(&mut self, reason: &str) {
        match &mut self.role {
            Role::Stage(stage) => stage.abort(reason),
            Role::Source(source) => source.abort(reason),
            Role::External => {}
        }
    }

    /// The log time that the stage has come to.
    pub fn log_time(&self) -> LogTime {
        self.sent.log_time()
    }

    /// Sets the log time that what the stage sends will carry.
    pub fn set_log_time(&self, log_time: LogTime) {
        self.sent.set_log_time(log_time);
    }

    /// How many messages were sent on each output port.
    pub fn messages_sent(&self) -> impl Iterator<Item = u64> {
        self.sent.messages()
    }

    /// What was warned of, and how often.
    pub fn warnings(&self) -> BTreeMap<String, u64> {
        self.sent.warnings()
    }

    /// How often anything was warned of.
    pub fn warning_count(&self) -> u64 {
        self.sent.warning_count()
    }

    /// What the stage has counted of its work.
    pub fn counts(&self) -> BTreeMap<String, u64> {
        self.sent.counts()
    }
}
