//! `gridweave_msgs`: what a machine does. The `.msg` texts lie in `logs/msg/gridweave_msgs/`.

use super::{Header, ros_messages};
use serde::{Deserialize, Serialize};

/// What the stages of a run on a machine do, told again and again.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MachineStages {
    /// The time of the message that was sent before it. There is no frame.
    pub header: Header,
    /// What the machine is called.
    pub machine: String,
    /// In about so many seconds it is told again.
    pub interval: f64,
    /// The stages, in the order of the pipeline.
    pub stages: Vec<StageProgress>,
}

/// What a stage has done.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StageProgress {
    /// Its name in the pipeline.
    pub name: String,
    /// How it stands: `absent`, `starting`, `running` or `ended`.
    pub state: String,
    /// Messages that it was given.
    pub messages_in: u64,
    /// Messages that it has sent.
    pub messages_out: u64,
    /// Messages a second that it was given since it was told last.
    pub in_per_s: f64,
    /// Messages a second that it has sent since then.
    pub out_per_s: f64,
    /// The share of the time since then that it has worked, 0 to 1.
    pub busy: f64,
    /// Messages that were dropped on their way to it because there was no room.
    pub dropped: u64,
    /// How often it was started again after a failure.
    pub restarts: u64,
    /// How often it has warned of something.
    pub warnings: u64,
}

ros_messages!("gridweave_msgs": MachineStages);
