//! `builtin_interfaces` and `std_msgs`.

use crate::message::LogTime;
use serde::{Deserialize, Serialize};

/// `builtin_interfaces/msg/Time`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Time {
    /// Whole seconds.
    pub sec: i32,
    /// Nanoseconds of the second.
    pub nanosec: u32,
}

impl From<LogTime> for Time {
    fn from(time: LogTime) -> Self {
        let sec = i32::try_from(time.0 / 1_000_000_000).unwrap_or(i32::MAX);
        Self { sec, nanosec: (time.0 % 1_000_000_000) as u32 }
    }
}

impl From<Time> for LogTime {
    fn from(time: Time) -> Self {
        Self(u64::try_from(time.sec).unwrap_or(0) * 1_000_000_000 + u64::from(time.nanosec))
    }
}

/// `std_msgs/msg/Header`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// The time to which the message's values apply.
    pub stamp: Time,
    /// The frame that the message's values are in.
    pub frame_id: String,
}

impl Header {
    /// A header of the given time and frame.
    pub fn new(time: LogTime, frame_id: impl Into<String>) -> Self {
        Self { stamp: time.into(), frame_id: frame_id.into() }
    }
}
