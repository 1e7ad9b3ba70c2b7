//! Outputs: a run owns the files that it writes, touches no others, and what was there stays until there is something
//! better.

use crate::support::{
    DIAMOND, Run, Running, TROUBLED, gridweave, outcome, part, processes, signal, simulate, start, wait_until,
};
use std::fs;
use std::os::unix::fs::{FileTypeExt, symlink};
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;

const OUTPUT: &str = "out.mcap";

fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("diamond.toml"), DIAMOND).unwrap();
    folder
}

/// A run that sends 3,000 messages and waits at the 2,000th until it may go on.
fn run(folder: &Path, engine: &str) -> Running {
    let settings = ["--set", "source.count=3000", "--set", "source.pause=0", "--set", "source.gates=[2000]"];
    start(folder, &[&["run", "diamond.toml", "-o", OUTPUT, "--engine", engine], &settings[..]].concat(), &[])
}

#[test]
fn of_two_runs_with_one_output_the_second_is_refused_and_the_first_keeps_its_log() {
    for engine in ["threads", "processes"] {
        let folder = folder();
        let output = folder.path().join(OUTPUT);
        let first = run(folder.path(), engine);
        wait_until("output", || part(&output).exists());
        // Whoever writes it is one of the first run's processes.
        for second in ["single", "threads", "processes"] {
            run(folder.path(), second).wait().assert(1, &["out.mcap is being written by process"]);
        }
        fs::write(folder.path().join("gate_2000"), b"").unwrap();
        first.wait().assert(0, &[]);
        let (reason, messages) = outcome(&output);
        assert_eq!((reason.as_str(), messages > 3000), ("", true), "{messages}");
        assert!(!part(&output).exists());
    }
}

#[test]
fn of_two_live_runs_with_one_output_the_second_is_refused_and_the_first_keeps_its_log() {
    let first = Run::start(TROUBLED, &[]);
    wait_until("messages", || first.number("output", "messages_in") > 50);
    let args = ["run", "pipeline.toml", "-o", OUTPUT, "--summary", "second.json"];
    for _ in 0..3 {
        gridweave(first.folder.path(), &args).assert(1, &["out.mcap is being written by process"]);
    }
    let before = first.number("output", "messages_in");
    wait_until("more messages", || first.number("output", "messages_in") > before + 50);
    let done = first.interrupt();
    done.assert_done();
    let written: usize = done.output().values().map(Vec::len).sum();
    assert_eq!(done.numbers("output", ["messages_in", "dropped"]), [written as u64, 0]);
    assert!(!part(&done.path(OUTPUT)).exists() && !done.path("second.json").exists());
}

#[test]
fn a_run_that_fails_leaves_the_earlier_output_in_its_place() {
    let folder = folder();
    let output = folder.path().join(OUTPUT);
    fs::write(folder.path().join("gate_2000"), b"").unwrap();
    run(folder.path(), "single").wait().assert(0, &[]);
    let earlier = fs::read(&output).unwrap();
    for engine in ["threads", "processes"] {
        let failing = start(folder.path(), &["run", "diamond.toml", "-o", OUTPUT, "--engine", engine], &[]);
        // What the run before has left is gone by then.
        wait_until("processes", || engine == "threads" || processes(failing.id()).len() == 5);
        wait_until("messages", || fs::metadata(part(&output)).is_ok_and(|file| file.len() > 20_000));
        signal(failing.id(), "INT");
        failing.wait().assert(1, &["was interrupted"]);
        assert!(fs::read(&output).unwrap() == earlier, "{engine}");
        assert!(outcome(&part(&output)).0.contains("interrupted"));
    }
    run(folder.path(), "threads").wait().assert(0, &[]);
    assert!(fs::read(&output).unwrap() == earlier && !part(&output).exists());
}

#[test]
fn a_run_without_any_map_leaves_the_earlier_outputs_in_their_place() {
    let folder = TempDir::new().unwrap();
    simulate(folder.path(), "in.mcap", &["--robots", "1", "--set", "duration=10"]);
    let no_map = ["filter", "in.mcap", "-o", "no_map.mcap", "--topics", "/tf"];
    gridweave(folder.path(), &no_map).assert(0, &[]);
    for output in [OUTPUT, "summary.json"] {
        fs::write(folder.path().join(output), "earlier").unwrap();
    }
    let merge = ["merge", "no_map.mcap", "-o", OUTPUT, "--summary", "summary.json"];
    gridweave(folder.path(), &merge).assert(1, &["the input has no usable map"]);
    for output in [OUTPUT, "summary.json"] {
        assert_eq!(fs::read(folder.path().join(output)).unwrap(), b"earlier", "{output}");
    }
}

#[test]
fn a_run_whose_folder_is_removed_ends_and_says_so() {
    let folder = folder();
    let runs = TempDir::new().unwrap();
    let variables = [("XDG_RUNTIME_DIR", runs.path().to_str().unwrap())];
    let args = ["run", "diamond.toml", "-o", OUTPUT, "--engine", "processes"];
    let running = start(folder.path(), &args, &variables);
    let output = folder.path().join(OUTPUT);
    wait_until("messages", || fs::metadata(part(&output)).is_ok_and(|file| file.len() > 20_000));
    fs::remove_dir_all(runs.path().join("gridweave")).unwrap();
    running.wait().assert(1, &["has lost its folder", "XDG_RUNTIME_DIR"]);
}

#[test]
fn a_run_that_fails_leaves_the_earlier_summary_of_a_sink_in_its_place() {
    let folder = TempDir::new().unwrap();
    let (summary, log) = (folder.path().join("summary.json"), folder.path().join(OUTPUT));
    let map = format!("{}/golden/map_file_source/three_modes/raw.yaml", env!("CARGO_MANIFEST_DIR"));
    let pipeline = format!(
        r#"
        [stages.files]
        kind = "map_file_source"
        files = ["{map}"]

        [stages.aligner]
        kind = "map_aligner"
        inputs = ["files"]

        [stages.frames]
        kind = "frame_solver"
        inputs = ["files", "aligner"]

        [stages.source]
        kind = "troubled_source"
        count = 3
        gates = [3]

        [stages.summary]
        kind = "summary_sink"
        inputs = ["frames.frames"]
        file = "summary.json"

        [stages.output]
        kind = "mcap_sink"
        inputs = ["files", "frames.*", "source"]
        file = "{OUTPUT}"
        "#
    );
    fs::write(folder.path().join("pipeline.toml"), pipeline).unwrap();
    fs::write(&summary, "earlier").unwrap();
    let gate = folder.path().join("gate_3");
    let args = |engine| ["run", "pipeline.toml", "--engine", engine];
    for engine in ["threads", "processes"] {
        let fails = ["--set", "source.at=3", "--set", "source.what=fail"];
        let failing = start(folder.path(), &[&args(engine)[..], &fails[..]].concat(), &[]);
        // The source fails when the summary is whole.
        wait_until("summary", || part(&summary).exists() || fs::read_to_string(&summary).unwrap() != "earlier");
        fs::write(&gate, b"").unwrap();
        failing.wait().assert(1, &["as configured"]);
        assert_eq!(fs::read_to_string(&summary).unwrap(), "earlier", "{engine}");
        assert!(!part(&summary).exists(), "{engine}");
        fs::remove_file(&gate).unwrap();
    }
    fs::write(&gate, b"").unwrap();
    gridweave(folder.path(), &args("processes")).assert(0, &[]);
    assert!(fs::read_to_string(&summary).unwrap().contains("\"frames\"") && log.exists() && !part(&summary).exists());
}

#[test]
fn a_run_that_removes_the_part_of_one_that_was_killed_says_so() {
    for engine in ["single", "processes"] {
        let folder = folder();
        let part = part(&folder.path().join(OUTPUT));
        fs::write(folder.path().join("gate_2000"), b"").unwrap();
        // Nobody has it locked.
        fs::write(&part, "what was written").unwrap();
        let ended = run(folder.path(), engine).wait();
        ended.assert(0, &["removed ", "out.mcap.part (16 bytes)", "`gridweave recover`"]);
        assert_eq!(ended.text().matches("an earlier run has left").count(), 1, "{ended:#?}");
        let ended = run(folder.path(), engine).wait();
        assert!(!ended.text().contains("has left") && !part.exists(), "{ended:#?}");
    }
}

#[test]
fn outputs_that_are_one_file_by_another_name_are_refused() {
    let folder = folder();
    fs::create_dir(folder.path().join("sub")).unwrap();
    symlink(folder.path().join("real"), folder.path().join("link")).unwrap();
    fs::write(folder.path().join("real"), "earlier").unwrap();
    for (log, other) in [("o", "sub/../o"), ("real", "link"), ("link", "sub/../real")] {
        let twice = &["would be written twice"];
        gridweave(folder.path(), &["run", "diamond.toml", "-o", log, "--summary", other]).assert(2, twice);
        gridweave(folder.path(), &["simulate", "-o", log, "--truth", other]).assert(2, twice);
    }
    assert_eq!(fs::read(folder.path().join("real")).unwrap(), b"earlier");
    assert!(!folder.path().join("o").exists());
}

#[test]
fn what_is_no_regular_file_is_refused_as_an_output_and_stays() {
    let folder = folder();
    let pipe = folder.path().join("pipe.yaml");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    for option in ["--map", "--picture", "--summary"] {
        let args = ["run", "diamond.toml", "-o", OUTPUT, option, "pipe.yaml"];
        gridweave(folder.path(), &args).assert(1, &["is not a regular file"]);
    }
    fs::rename(&pipe, folder.path().join(OUTPUT)).unwrap();
    gridweave(folder.path(), &["run", "diamond.toml", "-o", OUTPUT]).assert(1, &["is not a regular file"]);
    assert!(fs::metadata(folder.path().join(OUTPUT)).unwrap().file_type().is_fifo());
}

#[test]
fn the_pipeline_file_is_not_replaced_by_an_output() {
    let folder = folder();
    let file = folder.path().join("diamond.toml");
    for outputs in [&["-o", "diamond.toml"][..], &["-o", OUTPUT, "--summary", "./diamond.toml"]] {
        gridweave(folder.path(), &[&["run", "diamond.toml"], outputs].concat()).assert(2, &["is an input"]);
        assert_eq!(fs::read_to_string(&file).unwrap(), DIAMOND);
    }
}
