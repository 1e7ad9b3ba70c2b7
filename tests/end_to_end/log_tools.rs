//! The commands for logs beside `merge`: they recover, filter and print logs, and put several into one.

use crate::support::{LogBuilder, SMALL_BUILDING, gridweave, simulate};
use gridweave_runtime::ros::{OccupancyGrid, PoseStamped, TagRange};
use gridweave_tests::header;
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use tempfile::TempDir;

fn reading(seconds: f64, tag: &str) -> TagRange {
    TagRange { header: header(seconds, "base_link"), tag_id: tag.into(), range: 2.0, range_stddev: 0.1, rssi: -50.0 }
}

/// A log with a map, and a reading in every second.
fn write(path: &Path, readings: u32, begin: f64) {
    let mut log = LogBuilder::new(path);
    let info = gridweave_runtime::ros::MapMetaData { resolution: 0.1, width: 10, height: 10, ..Default::default() };
    let map = OccupancyGrid { header: header(begin, "map"), info, data: &[0; 100] };
    log.message(begin, "/map", &map);
    for number in 0..readings {
        let seconds = begin + f64::from(number);
        log.message(seconds, "/tag_ranges", &reading(seconds, "t"));
    }
    log.finish();
}

#[test]
fn a_cut_log_is_recovered_and_the_loss_is_reported() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    write(&path("in.mcap"), 200, 0.0);
    let run = |args: &[&str]| gridweave(folder.path(), &[&["recover"], args].concat());
    run(&["in.mcap", "-o", "whole.mcap"])
        .assert(0, &["wrote 201 messages on 2 topics over 199.0 s", "nothing was lost"]);
    let bytes = fs::read(path("in.mcap")).unwrap();
    fs::write(path("cut.mcap"), &bytes[..bytes.len() / 2]).unwrap();
    run(&["cut.mcap", "-o", "bag/"]).assert(0, &["wrote ", "to bag/", "cut.mcap: the file has no end"]);
    let info = gridweave(folder.path(), &["info", "bag"]);
    info.assert(0, &["bag_0.mcap"]);
    assert!(!info.stdout.contains("has no end"), "{info:#?}");

    // What a killed run leaves has the name that its log would be written as.
    fs::write(path("run.mcap.part"), &bytes[..bytes.len() / 2]).unwrap();
    fs::write(path("run_2.mcap"), "another").unwrap();
    run(&["run.mcap.part", "-o", "run.mcap"])
        .assert(2, &["until it is whole", "choose another output, such as run_3.mcap"]);
    run(&["run.mcap.part", "-o", "run_3.mcap"]).assert(0, &["to run_3.mcap"]);

    run(&["in.mcap", "-o", "in.mcap"]).assert(2, &["is an input"]);
    run(&["none.mcap", "-o", "x.mcap"]).assert(1, &["none.mcap"]);
    fs::write(path("text.mcap"), "no log").unwrap();
    run(&["text.mcap", "-o", "x.mcap"]).assert(1, &["text.mcap"]);
    assert!(!path("x.mcap").exists());
}

#[test]
fn a_log_is_filtered_by_the_options_of_reading() {
    let folder = TempDir::new().unwrap();
    write(&folder.path().join("in.mcap"), 100, 0.0);
    let args = [
        "filter",
        "robot1=in.mcap",
        "-o",
        "out.mcap",
        "--topic",
        "/{robot}/tag_ranges",
        "--start",
        "20",
        "--end",
        "29.5",
    ];
    gridweave(folder.path(), &args).assert(0, &["wrote 10 messages"]);
    gridweave(folder.path(), &["info", "out.mcap"])
        .assert(0, &["/robot1/tag_ranges", "1.0    1.0", "robot1/base_link"]);
}

#[test]
fn messages_are_printed_as_lines_of_json() {
    let folder = TempDir::new().unwrap();
    write(&folder.path().join("in.mcap"), 3000, 0.0);
    let lines = |args: &[&str]| -> Vec<Value> {
        let ended = gridweave(folder.path(), &[&["cat"], args].concat());
        ended.assert(0, &[]);
        ended.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    };
    let maps = lines(&["in.mcap", "--topic", "/map", "--max-array", "4"]);
    let [map] = maps.as_slice() else { panic!("{maps:?}") };
    assert_eq!(
        (map["type"].as_str(), map["message"]["info"]["width"].as_u64()),
        (Some("nav_msgs/msg/OccupancyGrid"), Some(10))
    );
    assert_eq!(map["message"]["data"].as_array().unwrap().len(), 5, "four, and how many more");
    let readings = lines(&["robot1=in.mcap", "--topics", "/robot1/tag_ranges", "--start", "10", "--count", "2"]);
    assert_eq!(readings.len(), 2);
    assert_eq!(readings[0]["message"]["header"]["stamp"]["sec"], 1_700_000_010);
    assert_eq!(readings[0]["message"]["header"]["frame_id"], "robot1/base_link");
    assert_eq!(lines(&["in.mcap"]).len(), 3001);
    gridweave(folder.path(), &["cat", "in.mcap", "--topic", "/mp"])
        .assert(1, &["there is no topic `/mp` in the logs: did you mean `/map`?"]);
    gridweave(folder.path(), &["convert", "in.mcap", "-o", "out.mcap", "--topic", "/far/from/all"])
        .assert(1, &["there is no topic `/far/from/all` in the logs: the topics in them are: `/map`"]);
    let renamed =
        ["convert", "robot1=in.mcap", "-o", "out.mcap", "--topic", "/robot1/map", "--rename", "/robot1/map=/grid"];
    gridweave(folder.path(), &renamed)
        .assert(1, &["no topic `/robot1/map` in the logs once topics are renamed: it is `/grid`"]);

    // Whoever has read enough is no failure.
    let program = env!("CARGO_BIN_EXE_troubled_stages");
    let mut child = Command::new(program)
        .args(["cat", "in.mcap"])
        .current_dir(folder.path())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    assert!(child.wait().unwrap().success());
}

#[test]
fn unrelated_clocks_are_reported_and_aligned() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    write(&path("a.mcap"), 20, 0.0);
    write(&path("b.mcap"), 30, 3.0e8);
    gridweave(folder.path(), &["info", "robot1=a.mcap", "robot2=b.mcap"])
        .assert(0, &["9.5 years after the end of robot1", "--align-start"]);
    let together = gridweave(folder.path(), &["info", "robot1=a.mcap", "robot2=b.mcap", "--align-start"]);
    together.assert(0, &["over 29.0 s"]);
    assert!(!together.text().contains("years"), "{together:#?}");
    let args = ["convert", "robot1=a.mcap", "robot2=b.mcap", "-o", "out.mcap", "--align-start"];
    gridweave(folder.path(), &args).assert(0, &["wrote 52 messages"]);
    let last = gridweave(folder.path(), &["cat", "out.mcap", "--topic", "/robot2/tag_ranges", "--start", "29"]);
    let last: Value = serde_json::from_str(&last.stdout).unwrap();
    assert_eq!(last["log_time"], 1_700_000_029_000_000_000_u64);
    assert_eq!(last["message"]["header"]["stamp"]["sec"], 1_700_000_029);

    // A robot whose clock is an hour behind that of the recorder.
    let mut log = LogBuilder::new(&path("late.mcap"));
    for number in 0..10 {
        let seconds = 5000.0 + f64::from(number);
        let header = header(seconds - 3600.0, "robot1/map");
        log.message(seconds, "/robot1/pose", &PoseStamped { header, ..Default::default() });
    }
    log.finish();
    gridweave(folder.path(), &["info", "late.mcap"]).assert(0, &["the stamps of robot1 are 1.0 hours behind"]);
}

#[test]
fn the_map_of_one_robot_may_be_a_file_beside_the_log_of_another() {
    let folder = TempDir::new().unwrap();
    simulate(folder.path(), "in.mcap", &SMALL_BUILDING);
    let run = |args: &[&str]| gridweave(folder.path(), args);
    run(&["filter", "in.mcap", "-o", "one.mcap", "--topics", "/robot1/map,/robot1/pose,/robot1/tag_ranges"])
        .assert(0, &[]);
    run(&["filter", "in.mcap", "-o", "two.mcap", "--topics", "/robot2/map"]).assert(0, &[]);
    run(&["merge", "two.mcap", "-o", "map.yaml"]);
    run(&["info", "one.mcap", "robot2=map.yaml"]).assert(0, &["map.yaml", "map file", "/robot2/map (logged as /map)"]);
    let args = ["merge", "one.mcap", "robot2=map.yaml", "-o", "out.mcap", "--json"];
    let merged = run(&args);
    let summary: Value = serde_json::from_str(&merged.stdout).unwrap();
    let is_placed = summary["frames"]["robot2"].is_object() || summary["unmerged"]["robot2"].is_string();
    assert!(is_placed && summary["reference"] == "robot1", "{merged:#?}");
    run(&["cat", "out.mcap", "--topic", "/robot2/map", "--max-array", "1"]).assert(0, &["robot2/map"]);
    run(&["merge", "one.mcap", "none.yaml", "-o", "x.mcap"]).assert(1, &["none.yaml"]);
    fs::write(folder.path().join("bad.yaml"), "a: b").unwrap();
    run(&["merge", "one.mcap", "bad.yaml", "-o", "x.mcap"]).assert(1, &["bad.yaml", "does not describe a map"]);
}

#[test]
fn a_log_that_names_its_robots_already_says_so_where_it_is_given_another_name() {
    let folder = TempDir::new().unwrap();
    simulate(folder.path(), "in.mcap", &SMALL_BUILDING);
    let args = ["merge", "fleet=in.mcap", "-o", "out.mcap"];
    let words = ["in.mcap already contain robot names (robot1 and robot2)", "omit `fleet=`"];
    gridweave(folder.path(), &args).assert(1, &words);
    let args = ["info", "fleet=in.mcap", "--rename", "/robot1/map=/map"];
    gridweave(folder.path(), &args).assert(0, &["/fleet/map"]);
}
