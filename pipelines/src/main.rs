//! The command `gridweave`, with the stages that ship.

#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    gridweave::command([])
}
