//! What a stage is, what it is told, and what it may do.
//!
//! A stage of one's own is a struct, its parameters, and a kind that tells both to the pipeline:
//!
//! ```
//! use gridweave_runtime::message::Message;
//! use gridweave_runtime::ros::{OccupancyGrid, PoseStamped};
//! use gridweave_runtime::stage::{
//!     Context, InputPort, Output, OutputPort, ParameterError, Parameters, PortType, Stage, StageError, StageKind,
//! };
//! use schemars::JsonSchema;
//! use serde::Deserialize;
//!
//! /// The doc comments are what `gridweave kinds` shows.
//! #[derive(Deserialize, JsonSchema)]
//! #[serde(default, deny_unknown_fields)]
//! struct CornerParameters {
//!     /// Maps with fewer cells are left out.
//!     min_cells: u32,
//! }
//!
//! impl Default for CornerParameters {
//!     fn default() -> Self {
//!         Self { min_cells: 1 }
//!     }
//! }
//!
//! impl Parameters for CornerParameters {
//!     fn check(&self) -> Vec<ParameterError> {
//!         let wrong = self.min_cells == 0;
//!         wrong.then(|| ParameterError::new("min_cells", "must be above 0")).into_iter().collect()
//!     }
//! }
//!
//! /// Sends the pose of each map's corner.
//! struct Corner {
//!     parameters: CornerParameters,
//! }
//!
//! impl Stage for Corner {
//!     fn receive(&mut self, _port: usize, message: &Message, output: &mut Output<'_>) -> Result<(), StageError> {
//!         let Ok(map) = message.decode::<OccupancyGrid<'_>>() else {
//!             output.warn("messages that are no map");
//!             return Ok(());
//!         };
//!         if map.cells().len() < self.parameters.min_cells as usize {
//!             return Ok(());
//!         }
//!         let corner = PoseStamped { pose: map.info.origin, header: map.header };
//!         output.send(0, message.robot(), &corner)
//!     }
//! }
//!
//! fn kind() -> StageKind {
//!     StageKind::stage(
//!         "map_corner",
//!         "Sends the pose of each map's corner.",
//!         vec![InputPort::one("map", PortType::of::<OccupancyGrid<'_>>(), "the maps")],
//!         vec![OutputPort::new("corner", PortType::of::<PoseStamped>(), "the corners")],
//!         |parameters: CornerParameters, _context: &Context| Ok(Corner { parameters }),
//!     )
//! }
//! # assert_eq!(kind().outputs[0].name, "corner");
//! ```

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
