//! The stages, and the whole command, among programs that speak DDS to each other on this machine.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod both;
mod built_messages;
#[path = "../over_zenoh/command.rs"]
#[allow(dead_code)]
mod command;
mod domain;
mod network_namespaces;
mod quality;
mod ros_nodes;
mod stages;
#[path = "../over_zenoh/waiting.rs"]
mod waiting;
#[path = "../over_zenoh/wire.rs"]
#[allow(dead_code)]
mod wire;
