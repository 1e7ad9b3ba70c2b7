//! The input and output ports of a stage kind.

use crate::ros::RosMessage;
use std::fmt;

/// The type of the messages of a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PortType {
    /// One ROS 2 type, by name.
    Ros(&'static str),
    /// Any type: the channel of each message says which.
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
    /// The name of the port.
    pub name: &'static str,
    /// The type of its messages.
    pub port_type: PortType,
    /// Whether several outputs may be wired to it.
    pub many: bool,
    /// Whether it may be left unwired.
    pub optional: bool,
    /// A description of its messages.
    pub summary: &'static str,
}

/// An output of a stage kind.
#[derive(Clone, Debug)]
pub struct OutputPort {
    /// The name of the port.
    pub name: &'static str,
    /// The type of its messages.
    pub port_type: PortType,
    /// The topic of its messages in a log, in which `{robot}` and `{stage}` are replaced; if none,
    /// `/{robot}/{stage}/{port}` or, for messages about no robot in particular, `/{stage}/{port}`.
    pub topic: Option<&'static str>,
    /// Whether it is a side output: where a pipeline names only a stage, its only output that is not a side output is
    /// meant.
    pub side: bool,
    /// A description of its messages.
    pub summary: &'static str,
}
