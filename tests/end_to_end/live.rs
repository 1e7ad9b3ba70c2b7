//! Live runs: what is sent arrives, what is dropped is counted, and an interrupt loses nothing.
use crate::support::{
    Ended, LOG, LogBuilder, OUTPUT, POSES, RECEIVE, Run, TROUBLED, counts, gridweave, processes, read, signal,
    simulate, start, wait_until,
};
use gridweave_runtime::ros::{MapMetaData, OccupancyGrid};
use std::fs;
use tempfile::TempDir;

#[test]
fn an_interrupt_ends_a_live_run_when_all_that_was_sent_is_handled() {
    let run = Run::start("live", &[]);
    let (log, truth) = run.simulate();
    run.command(&["play", LOG, "--rate", "0"]).wait().assert(0, &["played 7857 messages into live"]);
    let done = run.interrupt();
    done.assert_done();
    done.ended.assert(0, &["merged 2 of 2 robots"]);
    done.assert_right(&truth);
    let (sent, output) = (read(&log), done.output());
    for topic in ["/robot1/map", "/robot2/map", "/robot1/tag_ranges", "/robot2/tag_ranges"] {
        assert!(sent[topic] == output[topic], "{topic}");
    }
    assert_eq!(counts(&sent), counts(&output));
    assert!(output.contains_key("/map") && output.contains_key("/tf_static"), "{:?}", output.keys());
}

#[test]
fn maps_without_tags_are_merged_live() {
    let run = Run::start("live_merge", &[]);
    let args = ["--robots", "2", "--seed", "1001", "--set", "tags=0"];
    let (_, truth) = simulate(run.folder.path(), LOG, &args);
    run.command(&["play", LOG, "--rate", "0"]).wait().assert(0, &["into live_merge"]);
    let done = run.interrupt();
    done.assert_done();
    done.ended.assert(0, &["merged 2 of 2 robots"]);
    done.assert_right(&truth);
}

#[test]
fn warnings_are_logged_while_the_run_goes_on() {
    let run = Run::start("live_merge", &[]);
    let mut log = LogBuilder::new(&run.path(LOG));
    let info = MapMetaData { resolution: 0.05, width: 10, height: 10, ..MapMetaData::default() };
    let grid = OccupancyGrid { info, data: &[0; 50], ..OccupancyGrid::default() };
    log.message(1.0, "/robot1/map", &grid).message(2.0, "/robot1/map", &grid);
    log.finish();
    run.command(&["play", LOG, "--rate", "0"]).wait().assert(0, &["into live_merge"]);
    let done = run.interrupt();
    let stderr = &done.ended.stderr;
    assert_eq!(stderr.matches("maps: a map of robot1 was left out").count(), 1, "{stderr}");
}

#[test]
fn players_that_are_killed_leave_room_for_others_and_the_run_goes_on() {
    let run = Run::start(RECEIVE, &[]);
    let (log, _) = run.simulate();
    simulate(run.folder.path(), "one.mcap", &["--robots", "1", "--set", "duration=10"]);
    for _ in 0..11 {
        let before = run.number("output", "messages_in");
        let player = run.command(&["play", "one.mcap", "--rate", "0", "--loop"]);
        // More than may still be under way of what others have sent.
        wait_until("messages", || run.number("output", "messages_in") > before + 1000);
        signal(player.id(), "KILL");
        player.wait();
    }
    run.command(&["play", LOG, "--rate", "0"]).wait().assert(0, &["played 7857 messages"]);
    let done = run.interrupt();
    done.assert_done();
    assert_eq!(done.numbers("output", ["dropped"]), [0]);
    // The killed ones have sent nothing of robot 2.
    let (sent, output) = (read(&log), done.output());
    for topic in ["/robot2/map", "/robot2/tag_ranges"] {
        assert!(sent[topic] == output[topic], "{topic}");
    }
    assert_eq!(sent["/robot2/pose"].len(), output["/robot2/pose"].len());
}

#[test]
fn the_log_that_a_run_writes_is_no_output_of_another_program_whatever_it_is_called() {
    let run = Run::start(RECEIVE, &[]);
    let mut log = LogBuilder::new(&run.path("other.mcap"));
    log.pose(1.0, "robot1", 1.0, 2.0);
    log.finish();
    wait_until("partial log", || run.path("out.mcap.part").exists());
    for output in [OUTPUT, "out.mcap.part"] {
        let args = ["convert", "other.mcap", "-o", output];
        gridweave(&run.path("."), &args).assert(1, &["is being written by process"]);
    }
    run.interrupt().assert_done();
}

#[test]
fn a_run_can_be_ended_while_robots_send() {
    let run = Run::start(RECEIVE, &[]);
    run.simulate();
    let players = [(); 2].map(|()| run.command(&["play", LOG, "--rate", "0", "--loop"]));
    wait_until("messages", || run.number("output", "messages_in") > 5000);
    let done = run.interrupt();
    done.assert_done();
    players.into_iter().for_each(|player| player.wait().assert(1, &["the run ended before the log did"]));
    let [given] = done.numbers("output", ["messages_in"]);
    assert_eq!(done.output().values().map(Vec::len).sum::<usize>() as u64, given);
}

#[test]
fn processes_that_are_halted_for_a_moment_go_on_and_nothing_is_lost() {
    let run = Run::start(TROUBLED, &[]);
    wait_until("messages", || run.number("output", "messages_in") > 0);
    for _ in 0..3 {
        for (process, _) in processes(run.id()) {
            signal(process, "STOP");
            signal(process, "CONT");
        }
    }
    let before = run.number("output", "messages_in");
    wait_until("more messages", || run.number("output", "messages_in") > before);
    let done = run.interrupt();
    done.assert_done();
    for stage in ["middle", "output"] {
        assert_eq!(done.numbers(stage, ["dropped", "restarts"]), [0, 0], "{stage}");
    }
}

/// Numbers of a stage that stands still at its first message until its source has sent `sent` messages: those sent to
/// it, given to it, and dropped.
fn standing_stage(overflow: &str, count: u64, sent: u64) -> [u64; 3] {
    let text = TROUBLED.replace("\"wait\"", overflow).replace("pause = 1000\n", "");
    let settings = [&format!("source.count={count}"), "middle.gates=[1]"];
    let run = Run::start(&text, &settings.map(|setting| ["--set", setting]).concat());
    wait_until("messages", || run.number("source", "messages_out") >= sent);
    run.open_gate(1);
    let done = run.wait();
    done.assert_done();
    let [sent] = done.numbers("source", ["messages_out"]);
    let [given, dropped] = done.numbers("middle", ["messages_in", "dropped"]);
    let written: usize = done.output().values().map(Vec::len).sum();
    assert_eq!(written as u64, given);
    [sent, given, dropped]
}

#[test]
fn a_link_that_drops_the_oldest_does_not_slow_its_sender_and_counts_every_drop() {
    let [sent, given, dropped] = standing_stage("\"drop_oldest\"", 3000, 3000);
    assert_eq!((sent, given + dropped), (3000, 3000), "{given} were given, {dropped} dropped");
    // The one at which the stage stood, and what there is room for on a link of depth 16.
    assert!((1..=64).contains(&given), "{given} were given, {dropped} dropped");
}

#[test]
fn a_link_that_waits_drops_nothing() {
    assert_eq!(standing_stage("\"wait\"", 400, 8), [400, 400, 0]);
}

#[test]
fn what_two_players_send_at_once_all_arrives() {
    let run = Run::start(RECEIVE, &[]);
    let (log, _) = run.simulate();
    let players = [("--end", "80.0137"), ("--start", "80.0137")]
        .map(|(name, value)| run.command(&["play", LOG, "--rate", "0", name, value]));
    players.into_iter().for_each(|player| player.wait().assert(0, &["played"]));
    let done = run.interrupt();
    done.assert_done();
    assert_eq!(done.numbers("output", ["dropped"]), [0]);
    let (sent, mut output) = (read(&log), done.output());
    assert_eq!(counts(&sent), counts(&output));
    for topic in ["/robot1/tag_ranges", "/robot2/tag_ranges"] {
        let arrived = output.get_mut(topic).unwrap();
        arrived.sort();
        let mut sent = sent[topic].clone();
        sent.sort();
        assert!(sent == *arrived, "{topic}");
    }
    // Three of each robot, and again the last one before the second player began.
    assert_eq!(output["/robot1/map"].len() + output["/robot2/map"].len(), 8);
}

#[test]
fn a_log_that_is_played_in_a_loop_goes_on_in_time_until_interrupted() {
    let run = Run::start(RECEIVE, &[]);
    let (log, _) = run.simulate();
    let player = run.command(&["play", LOG, "--rate", "0", "--loop"]);
    wait_until("third turn", || run.number("robots", "messages_out") > 2 * 7857);
    signal(player.id(), "INT");
    player.wait().assert(0, &["played"]);
    let done = run.interrupt();
    done.assert_done();
    let (sent, output) = (read(&log), done.output());
    for (topic, messages) in &output {
        let back = |messages: &[(u64, Vec<u8>)]| {
            messages.windows(2).map(|pair| pair[0].0.saturating_sub(pair[1].0)).max().unwrap_or_default()
        };
        assert!(messages.len() > 2 * sent[topic].len() - 1, "{topic}: {}", messages.len());
        assert!(back(messages) <= back(&sent[topic]), "{topic} goes back by {} ns", back(messages));
    }
    // The stamps in the messages go on as well: seconds, after the encoding.
    let stamp = |(_, bytes): &(u64, Vec<u8>)| i32::from_le_bytes(bytes[4..8].try_into().unwrap());
    for topic in [POSES, "/robot1/tag_ranges", "/robot1/map"] {
        let last = |messages: &[(u64, Vec<u8>)]| stamp(&messages[messages.len() - 1]);
        assert!(last(&output[topic]) > last(&sent[topic]) + 60, "{topic}");
    }
}

#[test]
fn a_pipeline_that_takes_nothing_from_outside_cannot_be_played_into() {
    let run = Run::start(TROUBLED, &[]);
    run.simulate();
    run.command(&["play", LOG]).wait().assert(1, &["takes no messages from outside: it has no `live_source`"]);
    run.command(&["play", "nothing.mcap"]).wait().assert(1, &["nothing.mcap"]);
    run.command(&["play", LOG, "--rate=-1"]).wait().assert(2, &["--rate must be 0 or more"]);
    run.interrupt().assert_done();
}

#[test]
fn a_live_pipeline_runs_as_processes_only() {
    for engine in ["single", "threads", "threads-ipc"] {
        let done = Run::start(RECEIVE, &["--engine", engine]).wait();
        assert!(done.ended.status == 1 || done.ended.status == 2, "{:#?}", done.ended);
        done.ended.assert(done.ended.status, &["live", "processes"]);
    }
}

/// What `check` says of the live pipeline with something else in the place of a text.
fn check(from: &str, to: &str) -> Ended {
    let folder = TempDir::new().unwrap();
    let text = TROUBLED.replacen(from, to, 1);
    assert_ne!(text, TROUBLED);
    fs::write(folder.path().join("pipeline.toml"), text).unwrap();
    start(folder.path(), &["check", "pipeline.toml"], &[]).wait()
}

#[test]
fn settings_of_live_pipelines_are_checked() {
    check("mode = \"live\"\n", "")
        .assert(2, &["`overflow` is for live pipelines", "`restart` is for live pipelines", "write `mode = \"live\"`"]);
    let words = ["wrong value of `overflow`", "expected one of `wait`, `drop_oldest`", "did you mean `drop_oldest`?"];
    check("\"wait\"", "\"drop_oldst\"").assert(2, &words);
    let words = ["`troubled_source` has no output `ou`", "did you mean `out`?"];
    check("\"wait\"", "{ ou = \"wait\" }").assert(2, &words);
    check("\"wait\"", "{ out = \"drop_oldest\" }").assert(0, &["no errors"]);
    check("\"wait\"", "3").assert(2, &["`overflow`", "text in quotes, or a table by output port"]);
    let words = ["wrong value of `restart`", "expected one of `never`, `on_failure`"];
    check("\"on_failure\"", "\"always\"").assert(2, &words);
    let words = ["wrong value of `mode`", "expected one of `replay`, `live`", "did you mean `live`?"];
    check("\"live\"", "\"life\"").assert(2, &words);
}
