//! The walkthrough for users of slam_toolbox and nav2 does what it says.

use crate::python_libraries::{output, python, script};
use crate::support::{gridweave, simulate};
use std::ffi::OsStr;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

#[test]
#[ignore = "needs python3 with venv, and the network"]
fn the_walkthrough_is_true_of_bags_that_python_libraries_have_written() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../pipelines/WALKTHROUGH.md");
    let page = fs::read_to_string(page).unwrap();
    let folder = TempDir::new().unwrap();
    simulate(folder.path(), "in.mcap", &["--robots", "2", "--seed", "3"]);
    let tools = TempDir::new().unwrap();
    let log = folder.path().join("in.mcap");
    let record_script = script("record.py");
    let record: [&OsStr; 5] =
        [record_script.as_ref(), log.as_ref(), folder.path().as_ref(), "robot1".as_ref(), "robot2".as_ref()];
    output(&python(tools.path()), &record);
    let commands: Vec<Vec<&str>> = page
        .lines()
        .filter_map(|line| Some(line.strip_prefix("    gridweave ")?.split_whitespace().collect()))
        .collect();
    assert!(commands.len() >= 5, "{commands:?}");
    let mut printed = String::new();
    for command in commands {
        let ended = gridweave(folder.path(), &command);
        ended.assert(0, &[]);
        printed.push_str(&ended.stdout);
    }
    // What it shows of the output.
    for line in page.lines().filter_map(|line| line.strip_prefix("    ")).filter(|line| line.contains("robot2  ")) {
        assert!(printed.lines().any(|found| found.trim() == line.trim()), "no `{line}` in\n{printed}");
    }
    for file in
        ["maps.png", "merged.yaml", "merged.pgm", "merged.png", "summary.json", "report.html", "merged/metadata.yaml"]
    {
        assert!(folder.path().join(file).exists(), "{file}");
    }
}
