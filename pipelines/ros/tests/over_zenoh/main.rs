//! The stages, and the whole command, among programs that speak to each other over Zenoh on this machine.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod bridge;
mod bridge_tap;
mod bridge_verb;
mod command;
mod map_updates;
mod network_namespaces;
mod one_map_frame;
mod python_robots;
mod scans;
mod stages;
#[cfg(feature = "tls")]
mod tls;
mod waiting;
mod wire;
