//! When there is no space left in shared memory, a run of processes ends with the stage's name and the cause.
use crate::support::{Ended, Running, gridweave_program, outcome, processes, run_folder, start_program};
use std::fs;
use tempfile::TempDir;

/// Poses with long names of frames, a megabyte each. The sink takes all in order, and so keeps them in shared
/// memory when the stage hangs.
const LARGE: &str = r#"
[pipeline]
name = "large"
batch = false

[stages.source]
kind = "troubled_source"
count = 200
size = 1_000_000
pause = 500_000

[stages.hangs]
kind = "troubled_stage"
inputs = ["source"]
what = "hang"
at = 2

[stages.output]
kind = "mcap_sink"
inputs = ["source", "hangs"]
"#;

/// Mounts a small file system at /dev/shm, only for this program and those it starts, and then runs its arguments.
const SMALL: &str = "mount -t tmpfs -o size=4m tmpfs /dev/shm && exec \"$0\" \"$@\"";
/// The same, and nothing fits into it.
const FULL: &str =
    "mount -t tmpfs -o size=64k tmpfs /dev/shm && { cat /dev/zero >/dev/shm/zeros 2>&-; exec \"$0\" \"$@\"; }";

/// One with room, which another program fills once there is a file `fill`. Then the source may send its second message.
const FILLED: &str = "mount -t tmpfs -o size=64m tmpfs /dev/shm && {
    (while [ ! -e fill ]; do [ -e /proc/$$ ] || exit; sleep 0.01; done; cat /dev/zero >/dev/shm/zeros 2>&-; touch gate_2) &
    exec \"$0\" \"$@\"
}";

/// Starts a run with such a /dev/shm, in a separate folder.
fn start_with(shared_memory: &str, engine: &str, settings: &[&str]) -> (TempDir, Running) {
    let own = ["--user", "--map-root-user", "--mount"];
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("large.toml"), LARGE).unwrap();
    let program = gridweave_program();
    let run = ["run", "large.toml", "-o", "out.mcap", "--engine", engine];
    let args = [&own, &["sh", "-c", shared_memory, program.to_str().unwrap()][..], &run].concat();
    let settings: Vec<&str> = settings.iter().flat_map(|setting| ["--set", setting]).collect();
    let run = start_program("unshare".as_ref(), folder.path(), &[args, settings].concat(), &[]);
    (folder, run)
}

/// A run with such a /dev/shm: how it ended, and its number.
fn run_with(shared_memory: &str, engine: &str) -> (TempDir, Ended, u32) {
    let (folder, run) = start_with(shared_memory, engine, &[]);
    let id = run.id();
    let ended = run.wait();
    assert_eq!(processes(id), []);
    assert_eq!(run_folder(id), None);
    (folder, ended, id)
}

#[test]
#[ignore = "needs a machine that lets a program mount a separate /dev/shm: unshare --user --map-root-user --mount"]
fn a_run_that_fills_shared_memory_says_so_and_closes_its_log() {
    let (folder, ended, _) = run_with(SMALL, "processes");
    ended.assert(1, &["stage `source`", "/dev/shm"]);
    let (reason, _) = outcome(&folder.path().join("out.mcap"));
    assert!(reason.contains("/dev/shm"), "{reason}");
}

#[test]
#[ignore = "needs a machine that lets a program mount a separate /dev/shm: unshare --user --map-root-user --mount"]
fn a_run_without_any_room_in_shared_memory_says_so_at_once() {
    let (_, ended, id) = run_with(FULL, "processes");
    ended.assert(1, &["cannot create the shared counters of the run", &format!("/dev/shm/gw{id}_"), "No space left"]);
    let (_, ended, _) = run_with(FULL, "threads-ipc");
    ended.assert(1, &["there is no space left in /dev/shm"]);
}

#[test]
#[ignore = "needs a machine that lets a program mount a separate /dev/shm: unshare --user --map-root-user --mount"]
fn a_run_whose_room_in_shared_memory_another_program_takes_says_so() {
    let settings = ["source.gates=[2]", "source.pause=0", "hangs.what=print", "hangs.at=1"];
    let (folder, run) = start_with(FILLED, "threads-ipc", &settings);
    // The first message has come, so there is room for more by what is known then.
    run.wait_for_lines(1);
    fs::write(folder.path().join("fill"), b"").unwrap();
    run.wait().assert(1, &["stage `source`", "no space left in /dev/shm"]);
    let (reason, messages) = outcome(&folder.path().join("out.mcap"));
    assert!(reason.contains("/dev/shm") && messages > 0, "{messages} {reason}");
}
