//! Every engine delivers the same inputs in the same order to each stage, loses nothing, and reports a failed stage.

#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout)]

mod worlds;

use gridweave_runtime::engine::{EngineKind, Failure, RunError, RunReport, run};
use gridweave_runtime::pipeline::Pipeline;
use std::collections::BTreeMap;
use std::sync::mpsc;
use std::time::Duration;
use worlds::{PipelineBuilder, registry};

const ENGINES: [EngineKind; 3] = [EngineKind::Single, EngineKind::Threads, EngineKind::ThreadsIpc];

/// Runs a pipeline with a watchdog: a run that hangs fails the test.
fn run_watched(pipeline: &Pipeline, engine: EngineKind) -> Result<RunReport, RunError> {
    let (sender, receiver) = mpsc::channel();
    let pipeline = pipeline.clone();
    std::thread::spawn(move || sender.send(run(&pipeline, engine, &())));
    receiver.recv_timeout(Duration::from_secs(60)).unwrap_or_else(|_| panic!("the run on {engine} hangs"))
}

/// The counts of a pipeline's sinks, by name.
fn seen(pipeline: &Pipeline, engine: EngineKind) -> Vec<(String, BTreeMap<String, u64>)> {
    let report = run_watched(pipeline, engine).unwrap_or_else(|error| panic!("{engine}: {error}"));
    report.stages.into_iter().filter(|stage| stage.kind == "recorder").map(|stage| (stage.name, stage.counts)).collect()
}

fn assert_same_on_every_engine(builder: &PipelineBuilder) {
    let expected = seen(&builder.build(16), EngineKind::Single);
    assert!(!expected.is_empty());
    for engine in ENGINES {
        for depth in [1, 2, 3, 16] {
            assert_eq!(seen(&builder.build(depth), engine), expected, "{engine}, depth {depth}");
        }
    }
}

#[test]
fn a_chain_passes_every_message_on() {
    let mut builder = PipelineBuilder::new(registry());
    builder.stage("source", "counter", "count = 3000\nsize = 40", &[]);
    builder.stage("relay", "relay", "", &["source.a"]);
    builder.stage("sink", "recorder", "", &["relay.out"]);
    let pipeline = builder.build(4);
    for engine in ENGINES {
        let report = run_watched(&pipeline, engine).unwrap();
        let counts: Vec<u64> = report.stages.iter().map(|stage| stage.messages_in).collect();
        assert_eq!(counts, [0, 3000, 3001], "{engine}");
    }
    assert_same_on_every_engine(&builder);
}

#[test]
fn two_sources_are_merged_by_log_time() {
    let mut builder = PipelineBuilder::new(registry());
    builder.stage("even", "counter", "count = 700\nstep = 2", &[]);
    builder.stage("slow", "counter", "count = 50\nstep = 31\nstart = 100\nstall = 300", &[]);
    builder.stage("sink", "recorder", "", &["even.a", "slow.a"]);
    assert_same_on_every_engine(&builder);
}

#[test]
fn a_diamond_whose_one_side_passes_nothing_does_not_hang() {
    let mut builder = PipelineBuilder::new(registry());
    builder.stage("source", "counter", "count = 4000", &[]);
    builder.stage("nothing", "filter", "keep_every = 0", &["source.a"]);
    builder.stage("few", "filter", "keep_every = 97", &["source.a"]);
    builder.stage("sink", "recorder", "", &["nothing.out", "few.out", "source.a"]);
    assert_same_on_every_engine(&builder);
}

#[test]
fn a_diamond_over_two_ports_of_a_source_does_not_hang_at_equal_times() {
    let mut builder = PipelineBuilder::new(registry());
    // All messages have the same log time, so no watermark can ever release them.
    builder.stage("source", "counter", "count = 2000\nstep = 0\nboth = true", &[]);
    builder.stage("nothing", "filter", "keep_every = 0", &["source.b"]);
    builder.stage("sink", "recorder", "", &["nothing.out", "source.a"]);
    assert_same_on_every_engine(&builder);
}

#[test]
fn messages_of_one_log_time_that_must_wait_take_limited_memory() {
    let mut builder = PipelineBuilder::new(registry());
    builder.stage("source", "counter", "count = 200000\nsize = 0\nstep = 0\nboth = true", &[]);
    builder.stage("nothing", "filter", "keep_every = 0", &["source.b"]);
    builder.stage("sink", "recorder", "", &["nothing.out", "source.a"]);
    for depth in [1, 16] {
        let mut pipeline = builder.build(depth);
        pipeline.same_time_limit = 4_000_000;
        for engine in ENGINES {
            let error = run_watched(&pipeline, engine).unwrap_err();
            assert_eq!(error.stage.as_deref(), Some("sink"), "{engine}: {error}");
            let Failure::SameTime { input, messages, bytes, .. } = &error.failure else { panic!("{engine}: {error}") };
            assert_eq!(input, "source.a");
            assert!(*messages > 4_000 && *bytes < 12_000_000, "{engine}, depth {depth}: {error}");
            assert!(error.to_string().contains("same_time_limit"), "{error}");
        }
    }
}

#[test]
fn a_source_that_is_silent_on_one_port_delays_no_stage() {
    let mut builder = PipelineBuilder::new(registry());
    builder.stage("source", "counter", "count = 3000", &[]);
    builder.stage("late", "relay", "", &["source.b"]);
    builder.stage("sink", "recorder", "", &["late.out", "source.a"]);
    assert_same_on_every_engine(&builder);
}

#[test]
fn stages_that_stall_at_random_change_nothing() {
    let mut builder = PipelineBuilder::new(registry());
    builder.stage("one", "counter", "count = 200\nstep = 3\nstall = 200", &[]);
    builder.stage("two", "counter", "count = 150\nstep = 4\nboth = true", &[]);
    builder.stage("left", "relay", "stall = 300", &["one.a"]);
    builder.stage("right", "filter", "keep_every = 3\nstall = 100", &["two.b"]);
    builder.stage("cross", "join", "stall = 100", &["left.out", "right.out", "two.a"]);
    builder.stage("sink", "recorder", "stall = 50", &["cross.out", "two.a", "one.a"]);
    builder.stage("other", "recorder", "", &["cross.out"]);
    assert_same_on_every_engine(&builder);
}

#[test]
fn large_and_small_messages_keep_their_order() {
    let mut builder = PipelineBuilder::new(registry());
    builder.stage("source", "counter", "count = 300\nsize = 60\nlarge_every = 7\nlarge_size = 200000", &[]);
    builder.stage("relay", "relay", "", &["source.a"]);
    builder.stage("sink", "recorder", "", &["relay.out", "source.a"]);
    assert_same_on_every_engine(&builder);
}

#[test]
fn two_readers_of_two_ports_in_opposite_order_do_not_wait_for_each_other() {
    let mut builder = PipelineBuilder::new(registry());
    let parameters = "count = 45\nboth = true\nlarge_every = 1\nlarge_size = 200_000";
    builder.stage("source", "counter", parameters, &[]);
    builder.stage("one", "recorder", "stall = 50", &["source.a", "source.b"]);
    builder.stage("other", "recorder", "stall = 50", &["source.b", "source.a"]);
    builder.stage("same", "counter", &format!("{parameters}\nstep = 0"), &[]);
    builder.stage("third", "join", "", &["same.b", "source.a"]);
    builder.stage("fourth", "recorder", "", &["third.out", "same.a", "source.b"]);
    builder.stage("fifth", "recorder", "", &["same.a", "third.out"]);
    assert_same_on_every_engine(&builder);
}

#[test]
fn large_messages_that_wait_for_each_other_are_limited_in_memory_and_arrive() {
    let mut builder = PipelineBuilder::new(registry());
    // Together much more than a link may hold; some have the same log time, and some wait for a silent side.
    for step in [0, 1] {
        let parameters = format!("count = 12\nstep = {step}\nboth = true\nlarge_every = 1\nlarge_size = 30_000_000");
        builder.stage(&format!("source{step}"), "counter", &parameters, &[]);
        builder.stage(&format!("nothing{step}"), "filter", "keep_every = 0", &[&format!("source{step}.b")]);
        builder.stage(
            &format!("sink{step}"),
            "recorder",
            "",
            &[&format!("nothing{step}.out"), &format!("source{step}.a")],
        );
    }
    let pipeline = builder.build(16);
    let expected = seen(&pipeline, EngineKind::Single);
    assert_eq!(seen(&pipeline, EngineKind::Threads), expected);
}

#[test]
fn a_map_of_17_million_cells_takes_memory_for_what_is_in_flight_only() {
    let mut builder = PipelineBuilder::new(registry());
    builder.stage("source", "counter", "count = 1\nlarge_every = 1\nlarge_size = 17_000_000", &[]);
    for sink in ["a", "b", "c", "d", "e", "f"] {
        builder.stage(sink, "recorder", "", &["source.a"]);
    }
    // Memory for every sample that these readers could borrow would be more than 100 GB at 8 bytes per cell.
    let pipeline = builder.build(64);
    let expected = seen(&pipeline, EngineKind::Single);
    for engine in [EngineKind::Threads, EngineKind::ThreadsIpc] {
        assert_eq!(seen(&pipeline, engine), expected, "{engine}");
    }
}

#[test]
fn a_stage_may_keep_more_messages_than_its_links_are_deep() {
    let mut builder = PipelineBuilder::new(registry());
    builder.stage("source", "counter", "count = 400\nlarge_every = 1\nlarge_size = 9000", &[]);
    builder.stage("sink", "recorder", "keep = true", &["source.a"]);
    assert_same_on_every_engine(&builder);
}

#[test]
fn pipelines_wired_at_random_give_the_same_on_every_engine() {
    for seed in 1..=12 {
        let builder = random_pipeline(seed);
        let expected = seen(&builder.build(16), EngineKind::Single);
        for engine in [EngineKind::Threads, EngineKind::ThreadsIpc] {
            for depth in [1, 2, 5] {
                assert_eq!(seen(&builder.build(depth), engine), expected, "seed {seed}, {engine}, depth {depth}");
            }
        }
    }
}

/// Up to three sources and seven stages, each fed by up to three outputs of those before it; all of them are recorded.
fn random_pipeline(seed: u64) -> PipelineBuilder {
    let mut state = seed;
    let mut random = move |below: u64| {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) % below
    };
    let mut builder = PipelineBuilder::new(registry());
    let mut outputs: Vec<String> = Vec::new();
    for source in 0..1 + random(3) {
        let (count, step, start, both) = (random(400), random(4), random(200), random(2) == 0);
        let parameters =
            format!("count = {count}\nstep = {step}\nstart = {start}\nboth = {both}\nstall = {}", random(60));
        builder.stage(&format!("source{source}"), "counter", &parameters, &[]);
        outputs.extend([format!("source{source}.a"), format!("source{source}.b")]);
    }
    for stage in 0..2 + random(6) {
        let mut inputs: Vec<String> =
            (0..1 + random(3)).map(|_| outputs[random(outputs.len() as u64) as usize].clone()).collect();
        inputs.dedup();
        let parameters = format!("keep_every = {}\nstall = {}", random(5), random(60));
        let inputs: Vec<&str> = inputs.iter().map(String::as_str).collect();
        builder.stage(&format!("stage{stage}"), "join", &parameters, &inputs);
        outputs.push(format!("stage{stage}.out"));
    }
    let all: Vec<&str> = outputs.iter().map(String::as_str).collect();
    builder.stage("sink", "recorder", "", &all);
    builder
}

#[test]
fn an_empty_stream_ends() {
    let mut builder = PipelineBuilder::new(registry());
    builder.stage("source", "counter", "count = 0", &[]);
    builder.stage("relay", "relay", "", &["source.a"]);
    builder.stage("sink", "recorder", "", &["relay.out", "source.b"]);
    assert_same_on_every_engine(&builder);
}

#[test]
fn a_failing_stage_ends_the_run_with_its_name_and_the_cause() {
    for (how, where_) in [("fail", "relay"), ("panic", "relay"), ("fail_at_start", "relay"), ("fail", "source")] {
        let mut builder = PipelineBuilder::new(registry());
        let (source, relay) = match where_ {
            "source" => (format!("count = 100000\n{how} = true"), String::new()),
            _ => ("count = 100000".to_owned(), format!("{how} = true")),
        };
        builder.stage("source", "counter", &source, &[]);
        builder.stage("relay", "relay", &relay, &["source.a"]);
        builder.stage("sink", "recorder", "", &["relay.out", "source.a"]);
        for engine in ENGINES {
            let error = run_watched(&builder.build(2), engine).unwrap_err();
            assert_eq!(error.stage.as_deref(), Some(where_), "{engine} {how}");
            match (how, &error.failure) {
                ("panic", Failure::Panic(text)) => assert!(text.contains("on purpose")),
                (_, Failure::Stage(cause)) => assert!(cause.to_string().contains("on purpose")),
                (_, other) => panic!("{engine} {how}: {other}"),
            }
        }
    }
}

#[test]
fn the_other_stages_get_the_reason_of_a_failed_run() {
    let mut builder = PipelineBuilder::new(registry());
    let path = std::env::temp_dir().join(format!("gridweave-abort-{}", std::process::id()));
    builder.stage("source", "counter", "count = 100000", &[]);
    builder.stage("relay", "relay", "fail = true", &["source.a"]);
    builder.stage("sink", "recorder", &format!("abort_file = '{}'", path.display()), &["relay.out"]);
    for engine in ENGINES {
        run_watched(&builder.build(2), engine).unwrap_err();
        let reason = std::fs::read_to_string(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        assert!(reason.contains("`relay`") && reason.contains("on purpose"), "{engine}: {reason}");
    }
}

#[test]
fn going_back_in_log_time_is_an_error() {
    let mut builder = PipelineBuilder::new(registry());
    builder.stage("source", "counter", "count = 10\nbackwards = true", &[]);
    builder.stage("sink", "recorder", "", &["source.a"]);
    for engine in ENGINES {
        let error = run_watched(&builder.build(2), engine).unwrap_err().to_string();
        assert!(error.contains("log time"), "{error}");
    }
}

#[test]
fn a_large_message_is_read_where_it_was_written() {
    let mut builder = PipelineBuilder::new(registry());
    builder.stage("writer", "writer", "size = 1000000", &[]);
    builder.stage("one", "reader", "", &["writer.out"]);
    builder.stage("two", "reader", "", &["writer.out"]);
    for engine in [EngineKind::Single, EngineKind::Threads] {
        let report = run_watched(&builder.build(2), engine).unwrap();
        let places: Vec<u64> = report.stages.iter().map(|stage| stage.counts["places"]).collect();
        assert_eq!(places.len(), 3);
        assert_eq!(places[0], places[1], "{engine}: the first reader sees the memory that was written");
        assert_eq!(places[0], places[2], "{engine}: and so does the second");
    }
}
