//! What the end-to-end tests and the program that draws golden inputs have in common: logs and maps that are made up.

#![allow(clippy::unwrap_used)]

mod log_builder;

pub use log_builder::{LogBuilder, TestMap, header};
