//! Stages as processes: the same result as in one thread, and a failure that is reported, closed and cleaned up,
//! whatever dies and however.

use crate::support::{
    DIAMOND, Ended, Running, gridweave_program, left_over, outcome, part, processes, read, signal, start,
    start_program, wait_until,
};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tempfile::TempDir;

const OUTPUT: &str = "out.mcap";

/// A folder with the pipeline in it.
fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("diamond.toml"), DIAMOND).unwrap();
    folder
}

fn run_diamond(folder: &Path, engine: &str, settings: &[&str]) -> Running {
    let mut args = vec!["run", "diamond.toml", "-o", OUTPUT, "--engine", engine];
    settings.iter().for_each(|setting| args.extend(["--set", setting]));
    start(folder, &args, &[])
}

/// Waits until some messages have come to the output.
fn wait_for_output(folder: &Path) {
    wait_until("some output", || fs::metadata(part(&folder.join(OUTPUT))).is_ok_and(|file| file.len() > 20_000));
}

/// A run has failed, and everything that must be so then is so.
#[track_caller]
fn assert_failed(folder: &Path, run: u32, ended: &Ended, words: &[&str]) {
    // What a stage prints when it panics is allowed here.
    assert_eq!(ended.status, 1, "{ended:#?}");
    assert_eq!(processes(run), [], "processes are left");
    assert_eq!(left_over(run), Vec::<PathBuf>::new());
    let (reason, messages) = outcome(&folder.join(OUTPUT));
    assert!(messages > 0);
    for word in words {
        assert!(ended.stderr.contains(word), "no `{word}` in {ended:#?}");
        assert!(reason.contains(word), "no `{word}` in the log: {reason}");
    }
}

/// A stage that fails by itself.
#[track_caller]
fn fails_by_itself(settings: &[&str], words: &[&str]) {
    let folder = folder();
    let run = run_diamond(folder.path(), "processes", settings);
    let id = run.id();
    let ended = run.wait();
    assert_failed(folder.path(), id, &ended, words);
}

#[test]
fn a_stage_that_returns_an_error_ends_the_run_with_its_name() {
    fails_by_itself(&["middle.what=fail", "middle.at=3000"], &["`middle` failed: cannot go on: as configured"]);
}

#[test]
fn a_stage_that_panics_ends_the_run_with_its_name() {
    fails_by_itself(&["join.what=panic", "join.at=9000"], &["`join` panicked: as configured"]);
}

#[test]
fn a_stage_whose_process_gives_up_ends_the_run_with_its_name() {
    fails_by_itself(&["source.what=abort", "source.at=3000"], &["`source`", "signal 6 (SIGABRT)"]);
}

#[test]
fn a_stage_that_hangs_ends_the_run_with_its_name() {
    fails_by_itself(&["other.what=hang", "other.at=3000"], &["`other` hangs", "no progress for 2 s"]);
}

#[test]
fn a_stage_that_fills_the_memory_ends_the_run_with_its_name() {
    fails_by_itself(&["middle.what=eat", "middle.at=3000"], &["`middle`", "memory_limit", "allows 300 MB"]);
}

#[test]
fn a_stage_that_cannot_start_ends_the_run_with_its_name() {
    let folder = folder();
    let run = run_diamond(folder.path(), "processes", &["middle.at_start=true"]);
    let id = run.id();
    run.wait().assert(1, &["stage `middle` failed: cannot start: as configured"]);
    assert_eq!((processes(id), left_over(id)), (vec![], vec![]));
}

/// A process of the run gets a signal from outside.
#[track_caller]
fn fails_by_signal(victim: &str, name: &str, words: &[&str]) {
    let folder = folder();
    let run = run_diamond(folder.path(), "processes", &[]);
    wait_for_output(folder.path());
    let id = run.id();
    let (process, _) = processes(id).into_iter().find(|(_, name)| name == victim).unwrap();
    signal(process, name);
    let ended = run.wait();
    assert_failed(folder.path(), id, &ended, words);
}

#[test]
fn a_killed_source_ends_the_run_with_its_name() {
    fails_by_signal("source", "KILL", &["`source`", "signal 9 (SIGKILL)"]);
}

#[test]
fn a_killed_stage_ends_the_run_with_its_name() {
    fails_by_signal("join", "KILL", &["`join`", "signal 9 (SIGKILL)"]);
}

#[test]
fn a_killed_sink_ends_the_run_with_its_name_and_its_log_is_closed() {
    fails_by_signal("output", "KILL", &["`output`", "signal 9 (SIGKILL)"]);
}

#[test]
fn a_stage_whose_process_is_halted_ends_the_run_with_its_name() {
    fails_by_signal("middle", "STOP", &["`middle` hangs"]);
}

#[test]
fn processes_that_are_halted_for_a_moment_go_on_and_nothing_is_lost() {
    let folder = folder();
    let expected = run_diamond(folder.path(), "single", &["source.count=20000", "source.pause=0"]).wait();
    assert_eq!(expected.status, 0, "{expected:#?}");
    // The logs record different parameters.
    let expected = read(&folder.path().join(OUTPUT));
    fs::remove_file(folder.path().join(OUTPUT)).unwrap();
    let run = run_diamond(folder.path(), "processes", &["source.count=20000"]);
    wait_for_output(folder.path());
    for _ in 0..3 {
        for (process, _) in processes(run.id()) {
            signal(process, "STOP");
            signal(process, "CONT");
        }
    }
    let ended = run.wait();
    assert_eq!(ended.status, 0, "{ended:#?}");
    assert!(read(&folder.path().join(OUTPUT)) == expected);
}

#[test]
fn a_run_that_is_halted_as_a_whole_for_longer_than_a_stage_may_hang_goes_on() {
    let folder = folder();
    let run = run_diamond(folder.path(), "processes", &["source.count=20000"]);
    wait_for_output(folder.path());
    let all: Vec<u32> = processes(run.id()).into_iter().map(|(process, _)| process).chain([run.id()]).collect();
    all.iter().for_each(|process| signal(*process, "STOP"));
    let halted = Instant::now();
    // The pipeline lets a stage hang for two seconds.
    wait_until("end of the halt", || halted.elapsed() > Duration::from_secs(3));
    all.iter().for_each(|process| signal(*process, "CONT"));
    run.wait().assert(0, &[]);
    assert_eq!(outcome(&folder.path().join(OUTPUT)).0, "");
}

#[test]
fn an_interrupt_closes_the_log() {
    for name in ["INT", "TERM"] {
        let folder = folder();
        let run = run_diamond(folder.path(), "processes", &[]);
        wait_for_output(folder.path());
        let id = run.id();
        signal(id, name);
        let ended = run.wait();
        assert_failed(folder.path(), id, &ended, &["the run was interrupted"]);
    }
}

#[test]
fn when_the_supervisor_is_killed_the_stages_close_the_log_and_clean_removes_the_rest() {
    let folder = folder();
    let run = run_diamond(folder.path(), "processes", &[]);
    wait_for_output(folder.path());
    let id = run.id();
    signal(id, "KILL");
    run.wait();
    wait_until("end of the processes", || processes(id).is_empty());
    let (reason, messages) = outcome(&folder.path().join(OUTPUT));
    assert!(reason.contains("lost its supervisor") && messages > 0, "{reason}");

    let clean = start(folder.path(), &["clean"], &[]).wait();
    // Another test may have cleaned in between.
    assert_eq!(clean.status, 0, "{clean:#?}");
    assert_eq!(left_over(id), Vec::<PathBuf>::new());
}

#[test]
fn clean_removes_what_is_left_of_dead_runs_and_touches_no_living_one() {
    let (dead_folder, living_folder) = (folder(), folder());
    let dead = run_diamond(dead_folder.path(), "processes", &[]);
    let living = run_diamond(living_folder.path(), "processes", &[]);
    wait_for_output(dead_folder.path());
    wait_for_output(living_folder.path());
    let (dead_id, living_id) = (dead.id(), living.id());
    signal(dead_id, "STOP");
    processes(dead_id).into_iter().for_each(|(process, _)| signal(process, "KILL"));
    signal(dead_id, "KILL");
    dead.wait();
    wait_until("end of the processes", || processes(dead_id).is_empty());

    let clean = start(dead_folder.path(), &["clean"], &[]).wait();
    assert_eq!(clean.status, 0, "{clean:#?}");
    assert_eq!(left_over(dead_id), Vec::<PathBuf>::new());
    // It goes on until it is signalled to end.
    signal(living_id, "INT");
    let ended = living.wait();
    assert_failed(living_folder.path(), living_id, &ended, &["the run was interrupted"]);
}

#[test]
fn the_result_is_that_of_one_thread_however_stages_stall_and_are_placed() {
    let folder = folder();
    let output = |engine: &str, settings: &[&str]| {
        let ended = run_diamond(folder.path(), engine, settings).wait();
        assert_eq!(ended.status, 0, "{ended:#?}");
        // All messages: beside them the logs record different parameters.
        read(&folder.path().join(OUTPUT))
    };
    let base = ["source.count=3000", "source.pause=0", "middle.what=nothing_passes"];
    let expected = output("single", &base);
    for extra in [
        &["source.stall=300", "other.stall=500"][..],
        &["middle.stall=400", "join.stall=200", "source.stall=100"],
        &["other.what=print", "other.at=100"],
    ] {
        let settings: Vec<&str> = base.iter().chain(extra).copied().collect();
        assert!(output("processes", &settings) == expected, "{extra:?}");
    }
    // A source that sends nothing must not hold up what it could come before, and changes nothing.
    let silent = "[stages.silent]\nkind = \"troubled_source\"\n\n[stages.join]";
    let text = DIAMOND
        .replace("[stages.join]", silent)
        .replace("\"other\", \"source\"]", "\"other\", \"source\", \"silent\"]");
    assert_ne!(text, DIAMOND);
    fs::write(folder.path().join("diamond.toml"), text).unwrap();
    assert!(output("processes", &base) == expected, "a silent source");
    for (depth, placement) in [("depth = 1", "process = \"one\""), ("depth = 2", "process = \"b\"")] {
        let text = DIAMOND
            .replace("depth = 4", depth)
            .replace("kind = \"troubled_stage\"", &format!("kind = \"troubled_stage\"\n{placement}"));
        fs::write(folder.path().join("diamond.toml"), text).unwrap();
        assert!(output("processes", &base) == expected, "{depth} {placement}");
    }
}

#[test]
fn a_log_that_can_grow_no_more_says_so() {
    // A small file system is more than a test may ask for; a limit of the size of files is not, where there is no other
    // file.
    let folder = folder();
    let limited = "trap '' XFSZ; ulimit -f 40; exec \"$0\" \"$@\"";
    let program = gridweave_program().to_str().unwrap();
    let args = ["-c", limited, program, "run", "diamond.toml", "-o", OUTPUT, "--engine", "threads"];
    let run = start_program("sh".as_ref(), folder.path(), &args, &[]);
    run.wait().assert(1, &["stage `output` failed", "`ulimit -f`"]);
    // There is no room for an index, but for the reason.
    let info = start(folder.path(), &["info", OUTPUT], &[]).wait();
    info.assert(0, &["ended early", "stage `output` failed", "`ulimit -f`"]);
    assert!(!part(&folder.path().join(OUTPUT)).exists());
}
