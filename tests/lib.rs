//! What the end-to-end tests, the torture and the program that draws golden inputs have in common: logs and maps that
//! are made up, and what runs do to the machine.

#![allow(clippy::unwrap_used)]

mod log_builder;
pub mod run_files;
mod tag_drives;

pub use log_builder::{LogBuilder, TestMap, header};
pub use tag_drives::{Sense, TagDrive};
