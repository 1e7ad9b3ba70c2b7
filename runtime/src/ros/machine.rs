//! `gridweave_msgs`: the state of a machine. The `.msg` texts are in `logs/msg/gridweave_msgs/`.

use super::{Header, ros_messages};
use serde::{Deserialize, Serialize};

/// The progress of the stages of a run on a machine, sent periodically.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MachineStages {
    /// The time of the message that was sent before this one. There is no frame.
    pub header: Header,
    /// The name of the machine.
    pub machine: String,
    /// The approximate time to the next message, seconds.
    pub interval: f64,
    /// The stages, in the order of the pipeline.
    pub stages: Vec<StageProgress>,
}

/// The progress of a stage.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StageProgress {
    /// The name of the stage in the pipeline.
    pub name: String,
    /// Its state: `absent`, `starting`, `running` or `ended`.
    pub state: String,
    /// Messages that it has received.
    pub messages_in: u64,
    /// Messages that it has sent.
    pub messages_out: u64,
    /// Messages per second that it has received since the previous report.
    pub in_per_s: f64,
    /// Messages per second that it has sent since the previous report.
    pub out_per_s: f64,
    /// The share of the time since the previous report that it has worked, 0 to 1.
    pub busy: f64,
    /// Messages to it that were dropped because it had not granted credit for them.
    pub dropped: u64,
    /// How often it was restarted after a failure.
    pub restarts: u64,
    /// The number of its warnings.
    pub warnings: u64,
}

ros_messages!("gridweave_msgs": MachineStages);
