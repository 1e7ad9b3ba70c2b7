//! Live runs, and the commands that meet a run that is going on: what is sent arrives, what is dropped is counted, who
//! fails comes back or is named, and who looks on changes nothing.
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, clippy::panic)]

mod support;

use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread;
use std::time::Duration;
use support::{
    Ended, Running, example, left_over, outcome, processes, run_name, signal, simulate, start_program, wait_until,
};
use tempfile::TempDir;

/// Takes what robots send, and writes it to a log.
const RECEIVE: &str = r#"
[pipeline]
name = "receive"
mode = "live"

[robots]
map = "/{robot}/map"
pose = "/{robot}/pose"
tags = "/{robot}/tag_ranges"

[stages.robots]
kind = "live_source"
topics = { pose = "/{robot}/pose" }

[stages.output]
kind = "mcap_sink"
inputs = ["robots.map", "robots.pose", "robots.tags"]
"#;

/// A source, a stage that may be slow or fail, and a log of what the stage sends.
const TROUBLED: &str = r#"
[pipeline]
name = "troubled"
mode = "live"
depth = 16

[stages.source]
kind = "troubled_source"
count = 1_000_000_000
pause = 1000
overflow = "wait"

[stages.middle]
kind = "troubled_stage"
inputs = ["source"]
restart = "on_failure"

[stages.output]
kind = "mcap_sink"
inputs = ["middle"]
"#;

/// A replay that takes some seconds.
const DIAMOND: &str = r#"
[pipeline]
name = "diamond"
depth = 4

[stages.source]
kind = "troubled_source"
count = 15_000
pause = 150

[stages.middle]
kind = "troubled_stage"
inputs = ["source"]

[stages.other]
kind = "troubled_stage"
inputs = ["source"]

[stages.join]
kind = "troubled_stage"
inputs = { in = ["middle", "other", "source"] }

[stages.output]
kind = "mcap_sink"
inputs = ["join"]
"#;

const OUTPUT: &str = "out.mcap";
const SUMMARY: &str = "summary.json";
const LOG: &str = "in.mcap";
const POSES: &str = "/robot1/pose";

/// A run in a folder of its own.
struct Run {
    run: Running,
    folder: TempDir,
}

impl Run {
    /// A run of a pipeline that ships, or of the text of one.
    #[track_caller]
    fn start(pipeline: &str, more: &[&str]) -> Self {
        let folder = TempDir::new().unwrap();
        let is_text = pipeline.contains('\n');
        if is_text {
            fs::write(folder.path().join("pipeline.toml"), pipeline).unwrap();
        }
        let name = if is_text { "pipeline.toml" } else { pipeline };
        let args = [&["run", name, "-o", OUTPUT, "--summary", SUMMARY], more].concat();
        let run = start_program(&example("troubled_stages"), folder.path(), &args, &[]);
        Self { run, folder }
    }

    fn id(&self) -> u32 {
        self.run.id()
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Starts a command that is meant for this run.
    #[track_caller]
    fn command(&self, args: &[&str]) -> Running {
        let name = run_name(self.id());
        let args = [args, &["--run", &name, "--wait", "60"]].concat();
        start_program(&example("troubled_stages"), self.folder.path(), &args, &[])
    }

    /// A log of two robots, and its truth.
    #[track_caller]
    fn simulate(&self) -> (PathBuf, PathBuf) {
        simulate(self.folder.path(), LOG, &["--robots", "2"])
    }

    /// What `top` shows of the stages.
    #[track_caller]
    fn top(&self) -> Value {
        let ended = self.command(&["top", "--once", "--json", "--interval", "0.05"]).wait();
        assert_eq!(ended.status, 0, "{ended:#?}");
        serde_json::from_str(&ended.stdout).unwrap()
    }

    /// A number that `top` shows of a stage.
    #[track_caller]
    fn number(&self, stage: &str, name: &str) -> u64 {
        let top = self.top();
        let stages = top["stages"].as_array().unwrap();
        stages.iter().find(|entry| entry["name"] == stage).unwrap()[name].as_u64().unwrap()
    }

    /// Kills the process of a stage.
    #[track_caller]
    fn kill(&self, stage: &str) {
        let (process, _) = processes(self.id()).into_iter().find(|(_, name)| name == stage).unwrap();
        signal(process, "KILL");
    }

    /// Ends the run as a user does.
    #[track_caller]
    fn interrupt(self) -> Done {
        signal(self.id(), "INT");
        self.wait()
    }

    /// Waits for the end of the run, which leaves nothing behind.
    #[track_caller]
    fn wait(self) -> Done {
        let id = self.id();
        let ended = self.run.wait();
        assert_eq!((processes(id), left_over(id)), (vec![], vec![]), "{ended:#?}");
        Done { ended, folder: self.folder }
    }
}

/// A run that has ended.
struct Done {
    ended: Ended,
    folder: TempDir,
}

impl Done {
    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn summary(&self) -> Value {
        serde_json::from_slice(&fs::read(self.path(SUMMARY)).unwrap()).unwrap()
    }

    /// Numbers that the summary has of a stage; what it leaves out is 0.
    fn numbers<const N: usize>(&self, stage: &str, names: [&str; N]) -> [u64; N] {
        let summary = self.summary();
        names.map(|name| summary["stages"][stage][name].as_u64().unwrap_or_default())
    }

    fn output(&self) -> Topics {
        read(&self.path(OUTPUT))
    }

    /// It has ended well, and its log is complete.
    #[track_caller]
    fn assert_done(&self) {
        assert_eq!(self.ended.status, 0, "{:#?}", self.ended);
        assert_eq!(outcome(&self.path(OUTPUT)).0, "");
    }

    /// It has found the true frames.
    #[track_caller]
    fn assert_right(&self, truth: &Path) {
        let args = ["evaluate", SUMMARY, "--truth", truth.to_str().unwrap()];
        let evaluated = start_program(&example("troubled_stages"), self.folder.path(), &args, &[]).wait();
        evaluated.assert(0, &["right 1, wrong 0, refused 0"]);
    }
}

/// The messages of a log by topic: log time and bytes.
type Topics = BTreeMap<String, Vec<(u64, Vec<u8>)>>;

#[track_caller]
fn read(log: &Path) -> Topics {
    let bytes = fs::read(log).unwrap();
    let mut topics = Topics::new();
    for message in mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap) {
        topics.entry(message.channel.topic.clone()).or_default().push((message.log_time, message.data.to_vec()));
    }
    topics
}

/// How many messages the links of a live source have of a log: maps, poses and tags of two robots.
fn counts(topics: &Topics) -> Vec<(String, usize)> {
    let is_of_robot = |topic: &String| topic.starts_with("/robot") && !topic.ends_with("/map");
    topics
        .iter()
        .filter(|(topic, _)| is_of_robot(topic) && (topic.ends_with("/pose") || topic.ends_with("/tag_ranges")))
        .map(|(topic, messages)| (topic.clone(), messages.len()))
        .collect()
}

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
        &[
            &format!("stage `{stage}` lost its process, which was ended by signal 9 (SIGKILL)"),
            "started again in 1.0 s",
        ],
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
        ended.stderr.contains("stage `middle` hangs") && ended.stderr.contains("started again in 0.5 s"),
        "{ended:#?}"
    );
}

#[test]
fn programs_that_are_killed_while_they_look_on_leave_room_for_others() {
    let run = Run::start(TROUBLED, &[]);
    for turn in 0..7 {
        let tap = run.command(&["tap", "middle", "--json"]);
        let (file, path) = (format!("{turn}.mcap"), run.path(&format!("{turn}.mcap")));
        let recorder = run.command(&["record", "-o", &file, "middle"]);
        wait_until("recording", || path.exists());
        [&tap, &recorder].into_iter().for_each(|program| signal(program.id(), "KILL"));
        tap.wait();
        recorder.wait();
    }
    run.command(&["tap", "middle", "--count", "3"]).wait().assert(0, &["/robot1/middle/out"]);
    run.interrupt().assert_done();
}

#[test]
fn players_that_are_killed_leave_room_for_others_and_the_run_goes_on() {
    let run = Run::start(RECEIVE, &[]);
    run.simulate();
    for _ in 0..11 {
        let before = run.number("output", "messages_in");
        let player = run.command(&["play", LOG, "--rate", "20"]);
        wait_until("messages", || run.number("output", "messages_in") > before);
        signal(player.id(), "KILL");
        player.wait();
    }
    let before = run.number("output", "messages_in");
    run.command(&["play", LOG, "--rate", "0"]).wait().assert(0, &["played 7857 messages"]);
    assert_eq!(run.number("output", "messages_in"), before + 7857);
    let done = run.interrupt();
    done.assert_done();
    assert_eq!(done.numbers("output", ["dropped"]), [0]);
}

#[test]
fn a_halted_tap_does_not_hold_up_a_live_run_with_large_messages() {
    let settings = ["source.count=1500", "source.size=50000", "middle.size=50000"];
    let run = Run::start(TROUBLED, &settings.map(|setting| ["--set", setting]).concat());
    let taps = ["source", "middle"].map(|link| run.command(&["tap", link, "--json"]));
    wait_until("messages", || run.number("output", "messages_in") > 100);
    taps.iter().for_each(|tap| signal(tap.id(), "STOP"));
    let done = run.wait();
    done.assert_done();
    for stage in ["middle", "output"] {
        assert_eq!(done.numbers(stage, ["messages_in", "dropped"]), [1500, 0], "{stage}");
    }
    taps.iter().for_each(|tap| signal(tap.id(), "CONT"));
    taps.into_iter().for_each(|tap| tap.wait().assert(0, &[]));
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
    assert!(ended.stderr.contains("memory_limit") && ended.stderr.contains("started again in 0.5 s"), "{ended:#?}");
}

#[test]
fn a_tap_that_comes_late_gets_the_last_message_of_each_topic() {
    let run = Run::start(RECEIVE, &[]);
    run.simulate();
    run.command(&["play", LOG, "--rate", "0"]).wait().assert(0, &["played 7857 messages"]);
    let tap = run.command(&["tap", "robots.map", "--json", "--count", "2"]).wait();
    tap.assert(0, &[]);
    let mut maps: Vec<(String, u64)> = tap
        .stdout
        .lines()
        .map(|line| serde_json::from_str::<Value>(line).unwrap())
        .map(|line| (line["topic"].as_str().unwrap().to_owned(), line["log_time"].as_u64().unwrap()))
        .collect();
    maps.sort();
    let done = run.interrupt();
    done.assert_done();
    let output = done.output();
    let last = ["/robot1/map", "/robot2/map"].map(|topic| (topic.to_owned(), output[topic].last().unwrap().0));
    assert_eq!(maps, last);
}

#[test]
fn of_several_runs_of_one_name_one_must_be_chosen() {
    let text = TROUBLED.replace("name = \"troubled\"", "name = \"twins\"");
    let runs = [Run::start(&text, &[]), Run::start(&text, &[])];
    for run in &runs {
        wait_until("messages", || run.number("output", "messages_in") > 0);
    }
    let args = ["tap", "source", "--run", "twins"];
    let tap = start_program(&example("troubled_stages"), runs[0].folder.path(), &args, &[]).wait();
    let names = runs.each_ref().map(|run| format!("twins ({})", run_name(run.id())));
    tap.assert(2, &["several runs are going on", &names[0], &names[1], "choose one with --run"]);
    runs.into_iter().for_each(|run| run.interrupt().assert_done());
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
    let waits: Vec<&str> = done.ended.stderr.lines().filter_map(|line| line.split(" again in ").nth(1)).collect();
    assert!(waits.starts_with(&["0.5 s", "1.0 s", "2.0 s"]), "{:#?}", done.ended);
    done.ended.assert(1, &["stage `middle` failed: cannot start: it was told so"]);
}

/// Numbers of a stage that is slow, at its start as well: messages sent to it, given to it, and dropped.
fn slow_stage(overflow: &str, count: u64) -> [u64; 3] {
    let text = TROUBLED.replace("\"wait\"", overflow).replace("pause = 1000", "pause = 100");
    let settings = [&format!("source.count={count}"), "middle.pause=3000", "middle.start_pause=500000"];
    let run = Run::start(&text, &settings.map(|setting| ["--set", setting]).concat());
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
    let [sent, given, dropped] = slow_stage("\"drop_oldest\"", 3000);
    assert_eq!((sent, given + dropped), (3000, 3000), "{given} were given, {dropped} dropped");
    // A sender that waited would give its reader all of them.
    assert!(dropped > given, "{given} were given, {dropped} dropped");
}

#[test]
fn a_link_that_waits_drops_nothing() {
    assert_eq!(slow_stage("\"wait\"", 400), [400, 400, 0]);
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
    let poses = &output[POSES];
    assert!(stamp(&poses[poses.len() - 1]) > stamp(&poses[0]) + 170);
}

#[test]
fn a_recording_holds_what_the_log_of_the_run_holds() {
    let run = Run::start("live", &[]);
    run.simulate();
    let links = ["robots.map", "robots.tags", "lines", "quadrants", "icp", "frames"];
    let recorder = run.command(&[&["record", "-o", "recorded.mcap"], &links[..]].concat());
    wait_until("recording", || run.path("recorded.mcap").exists());
    run.command(&["play", LOG, "--rate", "10", "--start", "50", "--end", "75"]).wait().assert(0, &["played"]);
    let done = run.interrupt();
    assert_eq!(outcome(&done.path(OUTPUT)).0, "");
    recorder.wait().assert(0, &["recorded", "links to recorded.mcap"]);
    assert_eq!(outcome(&done.path("recorded.mcap")).0, "");
    let (recorded, output) = (read(&done.path("recorded.mcap")), done.output());
    assert!(recorded.len() > 8, "{:?}", recorded.keys());
    for (topic, messages) in &recorded {
        let sizes = (messages.len(), output[topic].len());
        assert!(*messages == output[topic], "{topic}: {sizes:?}");
    }
}

#[test]
fn a_recorder_does_not_overwrite_the_log_that_the_run_writes() {
    let run = Run::start(RECEIVE, &[]);
    run.simulate();
    run.command(&["play", LOG, "--rate", "0"]).wait().assert(0, &["played 7857 messages"]);
    run.command(&["record", "-o", OUTPUT]).wait().assert(1, &["out.mcap is being written by another program"]);
    let done = run.interrupt();
    done.assert_done();
    assert_eq!(outcome(&done.path(OUTPUT)).1, 7857);
}

#[test]
fn eight_players_and_four_taps_of_each_link_can_be_there_at_once() {
    let run = Run::start(RECEIVE, &[]);
    run.simulate();
    let links = ["robots.map", "robots.pose", "robots.tags"];
    let taps: Vec<Running> = links.iter().flat_map(|link| [*link; 4]).map(|link| run.command(&["tap", link])).collect();
    let players: Vec<Running> =
        (0..8).map(|_| run.command(&["play", LOG, "--rate", "20", "--start", "60", "--end", "100"])).collect();
    let counts: Vec<String> = players
        .into_iter()
        .map(|player| player.wait())
        .map(|ended| {
            ended.assert(0, &["played"]);
            ended.stdout
        })
        .collect();
    assert!(counts.iter().all(|count| *count == counts[0]), "{counts:?}");
    let done = run.interrupt();
    done.assert_done();
    assert_eq!(done.numbers("output", ["dropped"]), [0]);
    let played = format!("played {} messages", outcome(&done.path(OUTPUT)).1 / 8);
    assert!(counts[0].starts_with(&played), "{played}: {counts:?}");
    taps.into_iter().for_each(|tap| tap.wait().assert(0, &[]));
}

#[test]
fn of_a_killed_recorder_all_but_the_last_moment_can_be_read() {
    let run = Run::start(RECEIVE, &[]);
    run.simulate();
    let recorder = run.command(&["record", "-o", "recorded.mcap", "robots.tags"]);
    wait_until("recording", || run.path("recorded.mcap").exists());
    run.command(&["play", LOG, "--rate", "20", "--start", "60", "--end", "80"]).wait().assert(0, &["played"]);
    thread::sleep(Duration::from_secs(2));
    signal(recorder.id(), "KILL");
    recorder.wait();
    let info = start_program(&example("troubled_stages"), run.folder.path(), &["info", "recorded.mcap"], &[]).wait();
    let done = run.interrupt();
    done.assert_done();
    let output = done.output();
    let sent = ["/robot1/tag_ranges", "/robot2/tag_ranges"].map(|topic| output[topic].len()).iter().sum::<usize>();
    info.assert(0, &[&format!("{sent} messages")]);
}

#[test]
fn a_tap_prints_as_many_messages_as_it_is_told() {
    let run = Run::start(TROUBLED, &[]);
    let tap = run.command(&["tap", "source.out", "--json", "--count", "5"]).wait();
    tap.assert(0, &[]);
    let lines: Vec<Value> = tap.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(lines.len(), 5, "{tap:#?}");
    for line in &lines {
        assert_eq!(line["type"], "geometry_msgs/msg/PoseStamped");
        assert!(line["message"]["pose"]["position"]["x"].is_number(), "{line}");
    }
    run.interrupt().assert_done();
}

#[test]
fn a_tap_ends_with_the_program_that_reads_it() {
    let run = Run::start(TROUBLED, &[]);
    let mut tap = Command::new(example("troubled_stages"))
        .args(["tap", "middle", "--wait", "60", "--run", &run_name(run.id())])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(tap.stdout.take().unwrap()).read_line(&mut line).unwrap();
    assert!(line.contains("geometry_msgs/msg/PoseStamped"), "{line}");
    wait_until("end of the tap", || tap.try_wait().unwrap().is_some());
    assert_eq!(tap.wait().unwrap().code(), Some(0));
    run.interrupt().assert_done();
}

#[test]
fn a_link_that_is_not_there_is_told_with_the_nearest_name() {
    let run = Run::start(TROUBLED, &[]);
    for command in ["tap", "record"] {
        let args: &[&str] = if command == "record" { &["-o", "recorded.mcap"] } else { &[] };
        let ended = run.command(&[&[command], args, &["sourze.out"]].concat()).wait();
        ended.assert(2, &["no link `sourze.out`", "did you mean `source.out`?"]);
    }
    assert!(!run.path("recorded.mcap").exists());
    run.interrupt().assert_done();
}

#[test]
fn without_a_run_the_commands_say_what_to_do() {
    let folder = TempDir::new().unwrap();
    simulate(folder.path(), LOG, &["--robots", "1", "--set", "duration=10"]);
    for args in [&["tap", "a.b"][..], &["top"], &["record", "-o", "x.mcap"], &["play", LOG]] {
        let args = [args, &["--wait", "0", "--run", "nowhere"]].concat();
        let ended = start_program(&example("troubled_stages"), folder.path(), &args, &[]).wait();
        ended.assert(1, &["going on"]);
        assert!(
            ended.stderr.contains("start one with `gridweave run")
                || ended.stderr.contains("no run called nowhere is going on; there are"),
            "{ended:#?}"
        );
    }
    assert!(!folder.path().join("x.mcap").exists());
}

#[test]
fn whoever_looks_on_at_a_replay_and_however_he_ends_its_result_is_the_same() {
    let alone = Run::start(DIAMOND, &["--engine", "processes"]);
    let watched = Run::start(DIAMOND, &["--engine", "processes"]);
    wait_until("start", || processes(watched.id()).len() == 5);
    let killed = watched.command(&["tap", "source", "--json"]);
    let halted = watched.command(&["tap", "middle.out", "--json"]);
    let tap = watched.command(&["tap", "join", "--json", "--count", "20"]);
    let recorder = watched.command(&["record", "-o", "recorded.mcap", "source", "join"]);
    let top = watched.command(&["top", "--json", "--interval", "0.1"]);
    wait_until("recording", || fs::metadata(watched.path("recorded.mcap")).is_ok_and(|file| file.len() > 1000));
    tap.wait().assert(0, &[]);
    signal(killed.id(), "KILL");
    signal(halted.id(), "STOP");
    let watched = watched.wait();
    watched.assert_done();
    signal(halted.id(), "KILL");
    let (killed, _) = (killed.wait(), halted.wait());
    assert!(killed.stdout.lines().count() > 10);
    assert!(top.wait().stdout.lines().count() > 2);
    // The recorder says so if it was too slow.
    assert!([0, 1].contains(&recorder.wait().status));
    assert!(!read(&watched.path("recorded.mcap")).is_empty());
    let alone = alone.wait();
    alone.assert_done();
    assert!(fs::read(alone.path(OUTPUT)).unwrap() == fs::read(watched.path(OUTPUT)).unwrap());
}

#[test]
fn top_shows_every_stage_of_a_run() {
    let run = Run::start("live", &[]);
    let text = include_str!("../pipelines/live.toml");
    let pipeline: toml::Table = text.parse().unwrap();
    let stages = pipeline["stages"].as_table().unwrap();
    let running = || {
        let top = run.top();
        let running = top["stages"].as_array().unwrap().iter().filter(|stage| stage["state"] == "running");
        let mut names: Vec<String> = running.map(|stage| stage["name"].as_str().unwrap().to_owned()).collect();
        names.sort();
        names
    };
    wait_until("stages", || running().len() == stages.len());
    let mut names: Vec<&String> = stages.keys().collect();
    names.sort();
    assert_eq!(running().iter().collect::<Vec<_>>(), names);
    assert_eq!(run.top()["run"], run_name(run.id()));
    run.interrupt();
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
    let clean = start_program(&example("troubled_stages"), dead.folder.path(), &["clean"], &[]).wait();
    // Another test may have cleaned in between.
    assert_eq!(clean.status, 0, "{clean:#?}");
    assert_eq!(left_over(id), Vec::<PathBuf>::new());
    let before = living.number("output", "messages_in");
    wait_until("more messages", || living.number("output", "messages_in") > before);
    living.interrupt().assert_done();
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
    start_program(&example("troubled_stages"), folder.path(), &["check", "pipeline.toml"], &[]).wait()
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
