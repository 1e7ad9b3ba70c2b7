//! Live runs whose stages fail: those that may come back and go on, and the others end the run with their name.
use crate::support::{
    LOG, LogBuilder, OUTPUT, RECEIVE, Run, TROUBLED, counts, left_over, outcome, processes, read, signal, start,
    wait_until,
};
use std::path::PathBuf;

/// A stage dies while robots send, and once more when they have sent all.
#[track_caller]
fn comes_back(stage: &str) {
    let run = Run::start("live", &[]);
    let (log, truth) = run.simulate();
    let player = run.command(&["play", LOG, "--rate", "40"]);
    wait_until("map of each robot", || run.number("lines", "messages_in") >= 2);
    wait_until("message for the stage", || run.number(stage, "messages_in") >= 2);
    run.kill(stage);
    player.wait().assert(0, &["played"]);
    wait_until("restart", || run.number(stage, "restarts") == 1);
    wait_until("process", || processes(run.id()).iter().any(|(_, name)| name == stage));
    let before = run.number(stage, "messages_in");
    run.kill(stage);
    wait_until("restart", || run.number(stage, "restarts") == 2);
    wait_until("last map of each robot", || run.number(stage, "messages_in") >= before + 2);

    let done = run.interrupt();
    done.assert_done();
    done.ended.assert(
        0,
        &[&format!("stage `{stage}` lost its process, which was ended by signal 9 (SIGKILL)"), "restarting in 1.0 s"],
    );
    done.assert_right(&truth);
    assert_eq!(done.numbers(stage, ["restarts"]), [2]);
    for other in ["tags", "common_tags", "lines", "quadrants", "icp", "frames", "output"] {
        if other != stage {
            assert_eq!(done.numbers(other, ["dropped", "restarts"]), [0, 0], "{other}");
        }
    }
    assert_eq!(counts(&read(&log)), counts(&done.output()));
}

#[test]
fn a_killed_stage_with_one_input_comes_back_and_gets_the_maps_again() {
    comes_back("lines");
}

#[test]
fn a_killed_stage_with_two_inputs_comes_back_and_gets_the_maps_again() {
    comes_back("icp");
}

#[test]
fn a_stage_that_is_killed_again_and_again_under_load_comes_back_and_what_it_missed_is_counted() {
    let run = Run::start(&TROUBLED.replace("pause = 1000", "pause = 50"), &[]);
    for restarts in 1..=3 {
        let before = run.number("middle", "messages_in");
        wait_until("messages", || run.number("middle", "messages_in") > before + 100);
        run.kill("middle");
        wait_until("restart", || run.number("middle", "restarts") == restarts);
    }
    let before = run.number("middle", "messages_in");
    wait_until("messages", || run.number("middle", "messages_in") > before + 100);
    let done = run.interrupt();
    done.assert_done();
    let [sent] = done.numbers("source", ["messages_out"]);
    let [given, dropped, restarts] = done.numbers("middle", ["messages_in", "dropped", "restarts"]);
    assert!(restarts == 3 && dropped > 0, "{:#?}", done.ended);
    // The last one is repeated after each restart, and what a process had taken off the link dies with it.
    assert!((sent - 3..=sent + 3).contains(&(given + dropped)), "{sent} were sent, {given} given, {dropped} dropped");
    let written: usize = done.output().values().map(Vec::len).sum();
    let [out] = done.numbers("middle", ["messages_out"]);
    assert!(
        out.abs_diff(written as u64) <= 3 && out.abs_diff(given) <= 3,
        "{given} given, {out} sent, {written} written"
    );
}

#[test]
fn a_stage_that_hangs_is_started_again() {
    let text = TROUBLED.replace("depth = 16", "depth = 16\nstall_timeout = 1.0");
    let run = Run::start(&text, &["--set", "middle.what=hang", "--set", "middle.at=50"]);
    wait_until("restart", || run.number("middle", "restarts") >= 1);
    wait_until("more output", || run.number("output", "messages_in") > 49);
    let ended = run.interrupt().ended;
    assert!(
        ended.stderr.contains("stage `middle` hangs") && ended.stderr.contains("restarting in 0.5 s"),
        "{ended:#?}"
    );
}

#[test]
fn when_the_stage_dies_that_robots_send_as_nothing_is_lost() {
    let run = Run::start("live", &[]);
    let (log, truth) = run.simulate();
    let player = run.command(&["play", LOG, "--rate", "40"]);
    wait_until("map of each robot", || run.number("lines", "messages_in") >= 2);
    run.kill("robots");
    player.wait().assert(0, &["played 7857 messages"]);
    wait_until("restart", || run.number("robots", "restarts") == 1);
    let done = run.interrupt();
    done.assert_done();
    done.assert_right(&truth);
    assert_eq!(done.numbers("output", ["dropped"]), [0]);
    assert_eq!(counts(&read(&log)), counts(&done.output()));
}

#[test]
fn all_stages_that_may_be_started_again_can_die_at_once() {
    let run = Run::start("live", &[]);
    let (log, truth) = run.simulate();
    let player = run.command(&["play", LOG, "--rate", "40"]);
    wait_until("map of each robot", || run.number("lines", "messages_in") >= 2);
    let stages = ["common_tags", "lines", "quadrants", "icp", "frames", "fuser"];
    stages.into_iter().for_each(|stage| run.kill(stage));
    player.wait().assert(0, &["played 7857 messages"]);
    for stage in stages {
        wait_until("restart", || run.number(stage, "restarts") == 1);
    }
    wait_until("last map of each robot", || run.number("lines", "messages_in") >= 4);
    let done = run.interrupt();
    done.assert_done();
    done.assert_right(&truth);
    assert_eq!(counts(&read(&log)), counts(&done.output()));
}

#[test]
fn a_run_can_be_ended_while_a_stage_waits_to_be_started_again() {
    let run = Run::start(TROUBLED, &[]);
    wait_until("messages", || run.number("output", "messages_in") > 50);
    run.kill("middle");
    wait_until("end of the process", || !processes(run.id()).iter().any(|(_, name)| name == "middle"));
    let done = run.interrupt();
    done.assert_done();
    let [sent] = done.numbers("source", ["messages_out"]);
    let [given, dropped, restarts] = done.numbers("middle", ["messages_in", "dropped", "restarts"]);
    assert_eq!(restarts, 1);
    assert!((sent - 1..=sent + 1).contains(&(given + dropped)), "{sent} were sent, {given} given, {dropped} dropped");
}

#[test]
fn the_stages_of_one_process_are_started_again_together() {
    let text = TROUBLED.replace("inputs = [\"source\"]", "inputs = [\"source\"]\nprocess = \"both\"").replace(
        "[stages.output]",
        "[stages.next]\nkind = \"troubled_stage\"\ninputs = [\"middle\"]\nprocess = \"both\"\nrestart = \"on_failure\"\n\n[stages.output]",
    );
    let run = Run::start(
        &text.replace("kind = \"mcap_sink\"\ninputs = [\"middle\"]", "kind = \"mcap_sink\"\ninputs = [\"next\"]"),
        &[],
    );
    wait_until("messages", || run.number("output", "messages_in") > 50);
    run.kill("both");
    wait_until("restart", || run.number("next", "restarts") == 1);
    let before = run.number("output", "messages_in");
    wait_until("more messages", || run.number("output", "messages_in") > before + 50);
    let done = run.interrupt();
    done.assert_done();
    assert_eq!(["middle", "next"].map(|stage| done.numbers(stage, ["restarts"])), [[1], [1]]);
}

#[test]
fn a_stage_that_fills_the_memory_is_started_again() {
    let text = TROUBLED.replace("depth = 16", "depth = 16\nmemory_limit = 300_000_000");
    let run = Run::start(&text, &["--set", "middle.what=eat", "--set", "middle.at=50"]);
    wait_until("restart", || run.number("middle", "restarts") >= 1);
    wait_until("more output", || run.number("output", "messages_in") > 49);
    let ended = run.interrupt().ended;
    assert!(ended.stderr.contains("memory_limit") && ended.stderr.contains("restarting in 0.5 s"), "{ended:#?}");
}

#[test]
fn a_killed_stage_that_is_not_to_be_started_again_ends_the_run_with_its_name() {
    let run = Run::start("live", &[]);
    run.simulate();
    let player = run.command(&["play", LOG, "--rate", "20"]);
    wait_until("tags", || run.number("tags", "messages_in") > 100);
    run.kill("tags");
    let done = run.wait();
    assert_eq!(done.ended.status, 1, "{:#?}", done.ended);
    let (reason, messages) = outcome(&done.path(OUTPUT));
    for text in [&done.ended.stderr, &reason] {
        assert!(text.contains("`tags`") && text.contains("signal 9 (SIGKILL)"), "{text}");
    }
    assert!(messages > 100);
    player.wait().assert(1, &["the run ended before the log did"]);
}

#[test]
fn a_stage_that_fails_at_start_is_tried_again_after_longer_and_longer_and_the_run_can_be_ended() {
    let run = Run::start(TROUBLED, &["--set", "middle.at_start=true"]);
    wait_until("third restart", || run.number("middle", "restarts") >= 3);
    let done = run.interrupt();
    let waits: Vec<&str> = done.ended.stderr.lines().filter_map(|line| line.split("; restarting in ").nth(1)).collect();
    assert!(waits.starts_with(&["0.5 s", "1.0 s", "2.0 s"]), "{:#?}", done.ended);
    done.ended.assert(1, &["stage `middle` failed: cannot start: as configured"]);
}

#[test]
fn a_link_with_more_topics_than_are_kept_for_late_joiners_is_reported() {
    let run = Run::start(RECEIVE, &[]);
    let mut log = LogBuilder::new(&run.path(LOG));
    for robot in 0..50 {
        log.pose(f64::from(robot), &format!("robot{robot}"), 1.0, 2.0);
    }
    log.finish();
    run.command(&["play", LOG, "--rate", "0"]).wait().assert(0, &["played 50 messages"]);
    wait_until("poses", || run.number("output", "messages_in") == 50);
    let done = run.interrupt();
    done.assert_done();
    done.ended.assert(0, &["robots.pose has more than 40 topics and channels"]);
}

#[test]
fn when_the_supervisor_of_a_live_run_is_killed_its_processes_end_and_clean_removes_the_rest() {
    let (dead, living) = (Run::start(TROUBLED, &[]), Run::start(TROUBLED, &[]));
    for run in [&dead, &living] {
        wait_until("messages", || run.number("output", "messages_in") > 0);
    }
    let id = dead.id();
    signal(id, "KILL");
    dead.run.wait();
    wait_until("end of the processes", || processes(id).is_empty());
    let (reason, messages) = outcome(&dead.folder.path().join(OUTPUT));
    assert!(reason.contains("lost its supervisor") && messages > 0, "{reason}");
    let clean = start(dead.folder.path(), &["clean"], &[]).wait();
    // Another test may have cleaned in between.
    assert_eq!(clean.status, 0, "{clean:#?}");
    assert_eq!(left_over(id), Vec::<PathBuf>::new());
    let before = living.number("output", "messages_in");
    wait_until("more messages", || living.number("output", "messages_in") > before);
    living.interrupt().assert_done();
}
