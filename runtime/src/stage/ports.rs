//! The ports of a stage kind: what it takes and what it gives.

use crate::ros::RosMessage;
use std::fmt;

/// The type of the messages of a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PortType {
    /// One ROS 2 type, by name.
    Ros(&'static str),
    /// Any: each message's channel says what it is.
    Any,
}

impl PortType {
    /// The port type of `T`.
    pub const fn of<T: RosMessage>() -> Self {
        Self::Ros(T::NAME)
    }

    /// The name of the ROS 2 type; empty for any.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ros(name) => name,
            Self::Any => "",
        }
    }
}

impl fmt::Display for PortType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Ros(name) => name,
            Self::Any => "any",
        })
    }
}

/// An input of a stage kind.
#[derive(Clone, Debug)]
pub struct InputPort {
    /// Its name.
    pub name: &'static str,
    /// The type it takes.
    pub port_type: PortType,
    /// Whether any number of outputs may be wired to it; otherwise it is one.
    pub many: bool,
    /// Whether it may be left unwired.
    pub optional: bool,
    /// What it is for.
    pub summary: &'static str,
}

/// An output of a stage kind.
#[derive(Clone, Debug)]
pub struct OutputPort {
    /// Its name.
    pub name: &'static str,
    /// The type it gives.
    pub port_type: PortType,
    /// The topic that its messages get in a log, where it is not `/{robot}/{stage}/{port}` or, for messages about no robot in
    /// particular, `/{stage}/{port}`; `{robot}` and `{stage}` are put in.
    pub topic: Option<&'static str>,
    /// Whether it is beside what the stage is for: the name of a stage alone stands for its only output that is not.
    pub side: bool,
    /// What it carries.
    pub summary: &'static str,
}
