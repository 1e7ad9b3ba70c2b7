//! Starts the program of a process.

use super::Launch;
use crate::engine::Failure;
use std::env;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use tracing::{Level, event_enabled};

/// The environment variable with the log filter.
const LOG_FILTER: &str = "RUST_LOG";

/// Starts the program of the process called `name`, of the run with this folder. Its input and output are pipes.
pub(super) fn spawn(launch: &Launch, folder: &Path, name: &str) -> Result<Child, Failure> {
    let mut command = Command::new(&launch.program);
    // The other processes log at the level of this one.
    if let Some(level) = verbose_log_level().filter(|_| env::var_os(LOG_FILTER).is_none()) {
        command.env(LOG_FILTER, level);
    }
    command
        .args(&launch.arguments)
        .arg(folder)
        .arg(name)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        // An interrupt from the terminal is for the supervisor, which stops the others.
        .process_group(0)
        .spawn()
        .map_err(|error| Failure::Process(format!("cannot start {}: {error}", launch.program.display())))
}

/// The most verbose log level that is enabled, if it is more verbose than warnings.
fn verbose_log_level() -> Option<&'static str> {
    let levels = [
        ("trace", event_enabled!(Level::TRACE)),
        ("debug", event_enabled!(Level::DEBUG)),
        ("info", event_enabled!(Level::INFO)),
    ];
    levels.into_iter().find_map(|(level, is_enabled)| is_enabled.then_some(level))
}
