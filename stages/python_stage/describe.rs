//! Asks a module in Python for the ports and parameters of its stage.

use super::INTERPRETER;
use gridweave_runtime::stage::ParameterError;
use std::ffi::OsStr;
use std::path::Path;
use std::process::{Command, Stdio};

/// Ports and parameters of the stage of a module, in JSON. The module is imported for that.
pub(super) fn describe(python: &OsStr, module: &str) -> Result<String, ParameterError> {
    let mut command = Command::new(python);
    command.args(["-m", "gridweave.describe", module]).stdin(Stdio::null());
    let shown = Path::new(python).display();
    let ended = command.output().map_err(|error| {
        let problem =
            format!("needs an interpreter, and `{shown}` cannot be started: {error}; name one in {INTERPRETER}");
        ParameterError::new("module", problem)
    })?;
    let errors = String::from_utf8_lossy(&ended.stderr);
    if ended.status.success() {
        return String::from_utf8(ended.stdout)
            .map_err(|error| ParameterError::new("module", format!("describes its stage by invalid text: {error}")));
    }
    let is_missing = |name: &str| errors.contains(&format!("No module named {name}"));
    if is_missing("gridweave") || is_missing("'gridweave'") {
        let help = format!(
            "needs the package `gridweave`, which `{shown}` does not have: install it there by `pip install pipelines/python`, or \
             name in {INTERPRETER} the interpreter that has it"
        );
        return Err(ParameterError::new("module", help));
    }
    let last = errors.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or("it printed nothing");
    Err(ParameterError::new("module", format!("cannot be asked for its stage: {last}\n{}", errors.trim_end())))
}
