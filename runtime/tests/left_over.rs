//! A run leaves nothing behind. This is the only test of its program, so that everything found belongs to its own run.

#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout)]

mod worlds;

use gridweave_runtime::engine::{EngineKind, run};
use worlds::{PipelineBuilder, registry};

#[test]
fn a_run_that_fails_leaves_nothing_in_shared_memory() {
    let mut builder = PipelineBuilder::new(registry());
    builder.stage("source", "counter", "count = 500", &[]);
    builder.stage("relay", "relay", "fail = true", &["source.a"]);
    builder.stage("sink", "recorder", "", &["relay.out"]);
    run(&builder.build(2), EngineKind::ThreadsIpc, &()).unwrap_err();
    let own = format!("gw{}_", std::process::id());
    let names = std::fs::read_dir("/dev/shm").unwrap().map(|entry| entry.unwrap().file_name());
    let left: Vec<String> = names.map(|name| name.to_string_lossy().into_owned()).collect();
    assert!(left.iter().all(|name| !name.starts_with(&own)), "{left:?}");
}
