//! The middlewares of ROS 2.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fmt;

/// What carries the messages of ROS 2.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Middleware {
    /// DDS, the default: `rmw_fastrtps_cpp`, `rmw_cyclonedds_cpp`.
    Dds,
    /// Zenoh: `rmw_zenoh_cpp`.
    Zenoh,
}

impl fmt::Display for Middleware {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Dds => "DDS",
            Self::Zenoh => "Zenoh",
        })
    }
}

/// The middlewares that a stage speaks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Middlewares {
    /// Both.
    #[default]
    Auto,
    /// DDS alone, the default of ROS 2: Fast DDS and Cyclone DDS.
    Dds,
    /// Zenoh alone, as `rmw_zenoh_cpp` speaks it.
    Zenoh,
}

impl Middlewares {
    pub(crate) fn has(self, middleware: Middleware) -> bool {
        match self {
            Self::Auto => true,
            Self::Dds => middleware == Middleware::Dds,
            Self::Zenoh => middleware == Middleware::Zenoh,
        }
    }
}
