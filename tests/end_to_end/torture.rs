//! A few rounds of the torture: see `tests/torture`, which has longer forms of it.

use crate::support::{gridweave_program, start_program};
use tempfile::TempDir;

/// Runs are killed, halted, sent signals, started twice and left without room; then every promise is checked.
#[test]
fn whatever_is_done_to_runs_every_promise_holds() {
    let folder = TempDir::new().unwrap();
    let program = gridweave_program().to_str().unwrap();
    let args = ["rounds", "--rounds", "14", "--seed", "7", "--program", program];
    start_program(env!("CARGO_BIN_EXE_torture").as_ref(), folder.path(), &args, &[])
        .wait()
        .assert(0, &["every promise held"]);
}
