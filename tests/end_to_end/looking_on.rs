//! Who looks on at a run, live or a replay, sees what passes and changes nothing.
use crate::support::{
    DIAMOND, LOG, OUTPUT, POSES, RECEIVE, Run, Running, TROUBLED, gridweave_program, outcome, part, processes, read,
    run_name, signal, simulate, start, wait_until,
};
use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use tempfile::TempDir;

#[test]
fn programs_that_are_killed_while_they_look_on_leave_room_for_others() {
    let run = Run::start(TROUBLED, &[]);
    for turn in 0..7 {
        let tap = run.command(&["tap", "middle", "--json"]);
        let (file, path) = (format!("{turn}.mcap"), run.path(&format!("{turn}.mcap")));
        let recorder = run.command(&["record", "-o", &file, "middle"]);
        wait_until("recording", || part(&path).exists());
        tap.wait_for_lines(1);
        [&tap, &recorder].into_iter().for_each(|program| signal(program.id(), "KILL"));
        tap.wait();
        recorder.wait();
    }
    run.command(&["tap", "middle", "--count", "3"]).wait().assert(0, &["/robot1/middle/out"]);
    run.interrupt().assert_done();
}

#[test]
fn a_halted_tap_does_not_hold_up_a_live_run_with_large_messages() {
    let settings = ["source.count=1500", "source.gates=[200]", "source.size=50000", "middle.size=50000"];
    let run = Run::start(TROUBLED, &settings.map(|setting| ["--set", setting]).concat());
    let taps = ["source", "middle"].map(|link| run.command(&["tap", link, "--json"]));
    taps.iter().for_each(|tap| tap.wait_for_lines(1));
    taps.iter().for_each(|tap| signal(tap.id(), "STOP"));
    run.open_gate(200);
    let done = run.wait();
    done.assert_done();
    for stage in ["middle", "output"] {
        assert_eq!(done.numbers(stage, ["messages_in", "dropped"]), [1500, 0], "{stage}");
    }
    taps.iter().for_each(|tap| signal(tap.id(), "CONT"));
    taps.into_iter().for_each(|tap| tap.wait().assert(0, &[]));
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
    let tap = start(runs[0].folder.path(), &args, &[]).wait();
    let names = runs.each_ref().map(|run| format!("twins ({}", run_name(run.id())));
    tap.assert(2, &["several runs are in progress", &names[0], &names[1], "choose one with --run"]);
    runs.into_iter().for_each(|run| run.interrupt().assert_done());
}

#[test]
fn a_recording_holds_what_the_log_of_the_run_holds() {
    let run = Run::start("live", &[]);
    run.simulate();
    // Each of them has fewer messages than are kept for one who looks on, so none can be missed.
    let links = ["robots.map", "lines", "quadrants", "icp", "frames"];
    let recorder = run.command(&[&["record", "-o", "recorded.mcap"], &links[..]].concat());
    wait_until("recording", || run.path("recorded.mcap.part").exists());
    run.command(&["play", LOG, "--rate", "0"]).wait().assert(0, &["played"]);
    let done = run.interrupt();
    assert_eq!(outcome(&done.path(OUTPUT)).0, "");
    recorder.wait().assert(0, &["recorded", "links to recorded.mcap"]);
    assert_eq!(outcome(&done.path("recorded.mcap")).0, "");
    let (recorded, output) = (read(&done.path("recorded.mcap")), done.output());
    assert!(recorded.len() > 6, "{:?}", recorded.keys());
    for (topic, messages) in &recorded {
        let sizes = (messages.len(), output[topic].len());
        assert!(messages.len() <= 64 && *messages == output[topic], "{topic}: {sizes:?}");
    }
}

/// So many messages of others the owner of a link has room for, until it looks at them.
const OWNERS_BUFFER: usize = 128;

#[test]
fn what_a_sender_says_that_comes_and_goes_while_a_recorder_stalls_is_counted_as_missed() {
    let run = Run::start(RECEIVE, &[]);
    run.simulate();
    let recorder = run.command(&["record", "-o", "recorded.mcap", "robots.pose"]);
    wait_until("recording", || run.path("recorded.mcap.part").exists());
    signal(recorder.id(), "STOP");
    run.command(&["play", LOG, "--rate", "0"]).wait().assert(0, &["played"]);
    signal(recorder.id(), "CONT");
    let done = run.interrupt();
    let ended = recorder.wait();
    ended.assert(1, &["messages were missed"]);
    let number_before = |words: &str| {
        let text = ended.text();
        let before = text.split(words).next().unwrap().split_whitespace().next_back().unwrap();
        before.parse::<usize>().unwrap()
    };
    let output = done.output();
    let sent = output[POSES].len() + output["/robot2/pose"].len();
    let counted = number_before(" messages of 1 links") + number_before(" messages were missed");
    // Messages that the owner of the link has not read when the sender leaves are lost with the sender, and cannot be
    // counted.
    assert!((sent - OWNERS_BUFFER..=sent).contains(&counted), "{counted} of {sent}");
}

#[test]
fn a_recorder_does_not_overwrite_the_log_that_the_run_writes() {
    let run = Run::start(RECEIVE, &[]);
    run.simulate();
    run.command(&["play", LOG, "--rate", "0"]).wait().assert(0, &["played 7857 messages"]);
    run.command(&["record", "-o", OUTPUT]).wait().assert(1, &["out.mcap is being written by process"]);
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
    let (log, _) = run.simulate();
    let recorder = run.command(&["record", "-o", "recorded.mcap", "robots.map"]);
    wait_until("recording", || run.path("recorded.mcap.part").exists());
    run.command(&["play", LOG, "--rate", "0"]).wait().assert(0, &["played"]);
    let sent = read(&log);
    let sent = ["/robot1/map", "/robot2/map"].map(|topic| sent[topic].len()).iter().sum::<usize>();
    let words = format!("{sent} messages");
    let info = || start(run.folder.path(), &["info", "recorded.mcap.part"], &[]).wait();
    // A moment later it is on disk, though nothing more comes.
    wait_until("recorded maps", || info().stdout.contains(&words));
    signal(recorder.id(), "KILL");
    recorder.wait();
    info().assert(0, &[&words]);
    run.interrupt().assert_done();
}

#[test]
fn a_tap_prints_the_given_number_of_messages() {
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
    let mut tap = Command::new(gridweave_program())
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
fn the_error_for_an_unknown_link_suggests_a_similar_name() {
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
        let ended = start(folder.path(), &args, &[]).wait();
        ended.assert(1, &["in progress"]);
        assert!(
            ended.stderr.contains("start one with `gridweave run")
                || ended.stderr.contains("no run nowhere is in progress; there are"),
            "{ended:#?}"
        );
    }
    assert!(!folder.path().join("x.mcap").exists());
}

#[test]
fn observers_of_a_replay_do_not_change_its_result() {
    let text = DIAMOND.replace("stall_timeout = 2.0\n", "");
    let gates: Vec<u64> = (1000..9000).step_by(10).collect();
    let settings = ["source.count=9000".to_owned(), format!("source.gates={gates:?}")];
    let settings = settings.each_ref().map(|setting| ["--set", setting]).concat();
    let settings = [&["--engine", "processes"], &settings[..]].concat();
    let [alone, watched] = [(); 2].map(|()| Run::start(&text, &settings));
    gates.iter().for_each(|gate| alone.open_gate(*gate));
    wait_until("start", || processes(watched.id()).len() == 5);
    let killed = watched.command(&["tap", "source", "--json"]);
    let halted = watched.command(&["tap", "middle.out", "--json"]);
    let tap = watched.command(&["tap", "join", "--json", "--count", "20"]);
    let recorder = watched.command(&["record", "-o", "recorded.mcap", "source", "join"]);
    let top = watched.command(&["top", "--json", "--interval", "0.1"]);
    // A few messages pass, and another one has a look, until all have seen some.
    let recorded = watched.path("recorded.mcap.part");
    let mut closed = gates.into_iter();
    while killed.lines() < 10 || halted.lines() < 10 || tap.lines() < 20 || !recorded.exists() {
        watched.open_gate(closed.next().unwrap());
        watched.top();
    }
    tap.wait().assert(0, &[]);
    signal(killed.id(), "KILL");
    signal(halted.id(), "STOP");
    top.wait_for_lines(3);
    watched.open_gate(closed.next().unwrap());
    wait_until("record", || fs::metadata(&recorded).is_ok_and(|file| file.len() > 1000));
    closed.for_each(|gate| watched.open_gate(gate));
    let watched = watched.wait();
    watched.assert_done();
    signal(halted.id(), "KILL");
    killed.wait();
    halted.wait();
    top.wait();
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
    let text = include_str!("../../pipelines/live.toml");
    let pipeline: toml::Table = text.parse().unwrap();
    let stages = pipeline["stages"].as_table().unwrap();
    let running = || {
        let top = run.top();
        let running = top["stages"].as_array().unwrap().iter().filter(|stage| stage["state"] == "running");
        let mut names: Vec<String> = running.map(|stage| stage["name"].as_str().unwrap().to_owned()).collect();
        names.sort();
        names
    };
    // The command has added the sink of its summary.
    let mut names: Vec<&str> = stages.keys().map(String::as_str).chain(["summary_sink"]).collect();
    names.sort();
    wait_until("stages", || running().len() == names.len());
    assert_eq!(running(), names);
    assert!(run.top()["run"].as_str().unwrap().starts_with(&run_name(run.id())));
    run.interrupt();
}
