//! Three robots and a base, each in a network namespace of its own, with a bad link between them. The log of the base
//! gives the same merged map as the logs of the robots.

use crate::command::{GRIDWEAVE, run};
use std::fs;
use std::path::Path;

const BASE: &str = r#"
[pipeline]
name = "base"
mode = "live"

[stages.robots]
kind = "bridge_source"
listen = ["tcp/10.77.0.1:7448"]
insecure = true
end_after = 3

[stages.output]
kind = "mcap_sink"
inputs = ["robots.*"]
"#;

const ROBOT: &str = r#"
[pipeline]
name = "robot"

[stages.log]
kind = "mcap_source"

[stages.base]
kind = "bridge_sink"
inputs = ["log.map", "log.pose", "log.tags"]
connect = ["tcp/10.77.0.1:7448"]
insecure = true
linger = 300.0
keep_last = 1000000
keep_maps = 1000000
"#;

/// Three robots send their logs to a base over a link.
#[track_caller]
fn carry(folder: &Path, link: &[&str]) {
    fs::write(folder.join("base.toml"), BASE).unwrap();
    fs::write(folder.join("robot.toml"), ROBOT).unwrap();
    run(
        GRIDWEAVE,
        &["simulate", "-o", "robots.mcap", "--robots", "3", "--set", "duration=60.0", "--set", "snapshots=12"],
        folder,
    );
    let mut commands =
        vec![format!("exec {GRIDWEAVE} run base.toml --output base.mcap --summary base.json > base.txt 2>&1")];
    for robot in ["robot1", "robot2", "robot3"] {
        let log = format!("{robot}.mcap");
        run(GRIDWEAVE, &["filter", "robots.mcap", "-o", &log, "--robots", robot], folder);
        let summary = format!("{robot}.json");
        commands.push(format!(
            "exec {GRIDWEAVE} run robot.toml --input {log} --set base.sender={robot} --summary {summary} > {robot}.txt 2>&1"
        ));
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/network/bad_link.py");
    let mut args = vec!["--user", "--map-root-user", "--net", "python3", script.to_str().unwrap()];
    args.extend(link);
    args.extend(commands.iter().map(String::as_str));
    run("unshare", &args, folder);
}

/// The maps that come of the log that the base has written, and of those of the robots.
#[track_caller]
fn assert_same_merged_map(folder: &Path) {
    let merge = |log: &str| {
        let map = format!("{log}.yaml");
        run(GRIDWEAVE, &["merge", &format!("{log}.mcap"), "--map", &map, "-o", &format!("{log}.merged.mcap")], folder);
        fs::read(folder.join(format!("{log}.pgm"))).unwrap()
    };
    let (by_bridge, by_wire) = (merge("base"), merge("robots"));
    let output = fs::read_to_string(folder.join("base.txt")).unwrap();
    assert!(
        by_wire.len() > 10_000 && by_bridge == by_wire,
        "{} and {} bytes: {output}",
        by_bridge.len(),
        by_wire.len()
    );
}

#[test]
#[ignore = "needs the right to make network namespaces and TUN devices"]
fn network_namespaces_with_a_bad_link_between_them_end_in_the_same_map_as_a_wire() {
    let folder = tempfile::tempdir().unwrap();
    carry(folder.path(), &["--rate", "1e6", "--delay", "0.3", "--loss", "0.05"]);
    assert_same_merged_map(folder.path());
}

#[test]
#[ignore = "needs the right to make network namespaces and TUN devices"]
fn network_namespaces_that_are_cut_off_for_a_while_end_in_the_same_map_as_a_wire() {
    let folder = tempfile::tempdir().unwrap();
    // Longer than Zenoh takes to hold the other end for gone.
    carry(folder.path(), &["--rate", "1e6", "--delay", "0.05", "--loss", "0.0", "--cut", "60:15"]);
    let text = fs::read_to_string(folder.path().join("base.txt")).unwrap();
    assert!(text.contains("is gone"), "{text}");
    assert_same_merged_map(folder.path());
}
