//! A stage as used by the engines, with its types erased.

use super::StageError;
use super::output::SentCounts;
use crate::message::{Channel, LogTime, Message};
use std::collections::BTreeMap;
use std::time::Duration;

/// A stage that was created and connected to its links.
pub struct Node {
    pub(super) role: Role,
    pub(super) sent: SentCounts,
}

/// The role of a stage for the engine.
pub(super) enum Role {
    /// A stage with inputs.
    Stage(Box<dyn RunningStage>),
    /// A source.
    Source(Box<dyn RunningSource>),
    /// An external source: programs outside of the run send its messages.
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

    /// Whether the stage is an external source: programs outside of the run send its messages.
    pub fn is_external(&self) -> bool {
        matches!(self.role, Role::External)
    }

    /// Lets a source send its next messages. Returns `false` if there are no more, and for a stage that is no source.
    pub fn advance(&mut self) -> Result<bool, StageError> {
        match &mut self.role {
            Role::Source(source) => source.next(),
            Role::Stage(_) | Role::External => Ok(false),
        }
    }

    /// Lets a source wait until there is something to send, for at most `longest`.
    pub fn wait(&mut self, longest: Duration) {
        if let Role::Source(source) = &mut self.role {
            source.wait(longest);
        }
    }

    /// The share of its work that a source has done, 0 to 1, if known.
    pub fn progress(&self) -> Option<f64> {
        match &self.role {
            Role::Source(source) => source.progress(),
            Role::Stage(_) | Role::External => None,
        }
    }

    /// Passes a message to a stage; `port` is the index among the kind's input ports.
    pub fn receive(&mut self, port: usize, message: &Message) -> Result<(), StageError> {
        match &mut self.role {
            Role::Stage(stage) => stage.receive(port, message),
            Role::Source(_) | Role::External => Ok(()),
        }
    }

    /// Announces to a stage that the messages of channel `number` that follow on a wire were logged on `channel`.
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

    /// Notifies a stage that the run has failed.
    pub fn abort(&mut self, reason: &str) {
        match &mut self.role {
            Role::Stage(stage) => stage.abort(reason),
            Role::Source(source) => source.abort(reason),
            Role::External => {}
        }
    }

    /// The log time that the stage has reached.
    pub fn log_time(&self) -> LogTime {
        self.sent.log_time()
    }

    /// Sets the log time of the messages that the stage sends.
    pub fn set_log_time(&self, log_time: LogTime) {
        self.sent.set_log_time(log_time);
    }

    /// The number of messages sent on each output port.
    pub fn messages_sent(&self) -> impl Iterator<Item = u64> {
        self.sent.messages()
    }

    /// The warnings, each with the number of times.
    pub fn warnings(&self) -> BTreeMap<String, u64> {
        self.sent.warnings()
    }

    /// Takes the texts of warnings that have not been logged.
    pub fn take_unlogged(&self) -> Vec<String> {
        self.sent.take_unlogged()
    }

    /// The number of all warnings.
    pub fn warning_count(&self) -> u64 {
        self.sent.warning_count()
    }

    /// The counts of what the stage has done.
    pub fn counts(&self) -> BTreeMap<String, u64> {
        self.sent.counts()
    }
}
