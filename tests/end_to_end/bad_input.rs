//! Bad input gets a clear error or a counted warning, never a panic, and is never harmed.

use crate::support::{Ended, LogBuilder, TestMap, gridweave, simulate};
use gridweave_runtime::ros::{Point, Quaternion};
use std::fs;
use tempfile::TempDir;

/// Merges `in.mcap` of a folder.
fn merge(folder: &TempDir) -> Ended {
    gridweave(folder.path(), &["merge", "in.mcap", "-o", "out.mcap"])
}

/// A log that `build` fills, merged.
fn merged(build: impl FnOnce(&mut LogBuilder) -> &mut LogBuilder) -> Ended {
    let folder = TempDir::new().unwrap();
    let mut log = LogBuilder::new(&folder.path().join("in.mcap"));
    build(&mut log);
    log.finish();
    merge(&folder)
}

#[test]
fn a_missing_file() {
    merge(&TempDir::new().unwrap()).assert(1, &["in.mcap", "log"]);
}

#[test]
fn an_empty_file() {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("in.mcap"), b"").unwrap();
    merge(&folder).assert(1, &["in.mcap", "empty"]);
}

#[test]
fn a_file_that_is_no_log() {
    for (bytes, word) in [
        (&b"what is this? not a log, for sure"[..], "MCAP"),
        (b"#ROSBAG V1.2\n and so on and so on", "ROS 1"),
        (b"#ROSBAG V2.0\n and so on and so on", "damaged before the first whole message"),
        (b"SQLite format 3\0 and so on and so on", "cannot read the database"),
    ] {
        let folder = TempDir::new().unwrap();
        fs::write(folder.path().join("in.mcap"), bytes).unwrap();
        merge(&folder).assert(1, &["in.mcap", word]);
    }
}

#[test]
fn a_truncated_log_is_read_as_far_as_it_goes() {
    let folder = TempDir::new().unwrap();
    let (log, _) = simulate(folder.path(), "whole.mcap", &["--robots", "2"]);
    let whole = fs::read(log).unwrap();
    fs::write(folder.path().join("in.mcap"), &whole[..whole.len() * 2 / 3]).unwrap();
    let ended = merge(&folder);
    assert!([0, 3].contains(&ended.status), "{ended:#?}");
    ended.assert(ended.status, &["warning"]);
    fs::write(folder.path().join("in.mcap"), &whole[..40]).unwrap();
    merge(&folder).assert(1, &["in.mcap"]);
}

#[test]
fn a_log_without_maps() {
    merged(|log| log.pose(0.0, "robot1", 1.0, 1.0).reading(0.1, "robot1", "a", 1.0))
        .assert(1, &["no map", "nav_msgs/msg/OccupancyGrid"]);
}

#[test]
fn a_log_without_messages() {
    merged(|log| log).assert(1, &["no map"]);
}

#[test]
fn a_log_without_tags() {
    merged(|log| log.map(0.0, "robot1", &TestMap::flat()).map(0.0, "robot2", &TestMap::flat()))
        .assert(0, &["merged 2 of 2", "maps+icp", "no reading of a tag was found"]);
}

#[test]
fn a_log_with_one_robot() {
    merged(|log| log.map(0.0, "robot1", &TestMap::room())).assert(0, &["only robot1", "nothing to merge"]);
}

#[test]
fn maps_that_cannot_be() {
    let good = TestMap::room();
    let spoilt = |spoil: &dyn Fn(&mut TestMap)| {
        let mut map = good.clone();
        spoil(&mut map);
        map
    };
    let cases = [
        ("cells", spoilt(&|map| map.cells.truncate(100))),
        ("cells", spoilt(&|map| map.info.width = u32::MAX)),
        ("resolution", spoilt(&|map| map.info.resolution = 0.0)),
        ("resolution", spoilt(&|map| map.info.resolution = f32::NAN)),
        ("resolution", spoilt(&|map| map.info.resolution = -0.05)),
        ("origin", spoilt(&|map| map.info.origin.position.x = f64::NAN)),
    ];
    for (word, map) in cases {
        merged(|log| log.map(0.0, "robot1", &good).map(0.0, "robot2", &map)).assert(3, &["warning", word]);
        let ended = merged(|log| log.map(0.0, "robot1", &map));
        assert!([0, 1].contains(&ended.status), "{ended:#?}");
        ended.assert(ended.status, &[word]);
    }
}

#[test]
fn empty_maps() {
    let mut nothing = TestMap::room();
    nothing.cells.fill(-1);
    let mut no_cells = TestMap::room();
    (no_cells.info.width, no_cells.info.height) = (0, 0);
    no_cells.cells.clear();
    for map in [nothing, no_cells] {
        let ended = merged(|log| log.map(0.0, "robot1", &map).map(0.0, "robot2", &map));
        ended.assert(3, &["not merged: robot2"]);
    }
}

#[test]
fn readings_before_any_pose_and_readings_that_cannot_be() {
    let ended = merged(|log| {
        log.map(0.0, "robot1", &TestMap::room());
        log.reading(0.1, "robot1", "a", 1.0);
        log.pose(0.2, "robot1", 1.0, 1.0);
        for range in [f64::NAN, -1.0, f64::INFINITY, 1e9, 0.0] {
            log.reading(0.3, "robot1", "a", range);
        }
        log.reading(0.3, "robot1", "", 1.0);
        log.pose(0.4, "robot1", f64::NAN, 1.0);
        log.reading(0.4, "robot1", "a", 1.0)
    });
    ended.assert(0, &["warning: tags:", "before"]);
}

#[test]
fn messages_that_are_cut_or_of_another_type() {
    merged(|log| {
        log.map(0.0, "robot1", &TestMap::room());
        log.raw(0.1, "/robot1/map", "nav_msgs/msg/OccupancyGrid", &[0, 1, 0, 0, 7]);
        log.raw(0.1, "/robot1/pose", "geometry_msgs/msg/PoseStamped", &[]);
        log.raw(
            0.1,
            "/robot1/tag_ranges",
            "gridweave_msgs/msg/TagRange",
            b"\0\x01\0\0\xff\xff\xff\xff\xff\xff\xff\xff\xff",
        );
        log.raw(0.2, "/robot1/tag_ranges", "std_msgs/msg/String", &[0, 1, 0, 0, 1, 0, 0, 0, 0])
    })
    .assert(0, &["warning"]);
}

#[test]
fn messages_of_unknown_types_are_passed_through() {
    let folder = TempDir::new().unwrap();
    let mut log = LogBuilder::new(&folder.path().join("in.mcap"));
    log.map(0.0, "robot1", &TestMap::room());
    log.raw(0.1, "/robot1/camera", "my_msgs/msg/Strange", &[1, 2, 3, 4, 5]);
    log.finish();
    merge(&folder).assert(0, &[]);
    let output = fs::read(folder.path().join("out.mcap")).unwrap();
    let messages: Vec<mcap::Message<'_>> = mcap::MessageStream::new(&output).unwrap().map(Result::unwrap).collect();
    let strange = messages.iter().find(|message| message.channel.topic == "/robot1/camera").unwrap();
    assert_eq!(strange.data.as_ref(), [1, 2, 3, 4, 5]);
    assert_eq!(strange.channel.schema.as_ref().unwrap().name, "my_msgs/msg/Strange");
}

#[test]
fn an_output_that_cannot_be_written() {
    let folder = TempDir::new().unwrap();
    LogBuilder::new(&folder.path().join("in.mcap")).finish();
    fs::create_dir(folder.path().join("taken")).unwrap();
    fs::write(folder.path().join("taken/of_another_0.mcap"), "").unwrap();
    for output in ["no/such/folder/out.mcap", "taken"] {
        gridweave(folder.path(), &["merge", "in.mcap", "-o", output]).assert(1, &[output.split('/').next().unwrap()]);
    }
}

#[test]
fn an_input_is_never_overwritten() {
    let folder = TempDir::new().unwrap();
    let (log, _) = simulate(folder.path(), "in.mcap", &["--robots", "1"]);
    let before = fs::read(&log).unwrap();
    fs::hard_link(&log, folder.path().join("hard.mcap")).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink(&log, folder.path().join("soft.mcap")).unwrap();
    for output in ["in.mcap", "./in.mcap", "hard.mcap", "soft.mcap"] {
        gridweave(folder.path(), &["merge", "in.mcap", "-o", output]).assert(2, &["input"]);
        assert!(fs::read(&log).unwrap() == before);
    }
}

#[test]
fn maps_with_a_turned_origin_and_of_another_resolution_are_used() {
    let mut turned = TestMap::room();
    turned.info.origin.position = Point { x: 3.0, y: -2.0, z: 0.0 };
    turned.info.origin.orientation = Quaternion::from_yaw(0.7);
    turned.info.resolution = 0.1;
    let ended = merged(|log| log.map(0.0, "robot1", &turned));
    ended.assert(0, &["only robot1"]);
}

#[test]
fn use_that_makes_no_sense() {
    let folder = TempDir::new().unwrap();
    for (args, word) in [
        (&["run", "no_such_pipeline.toml"][..], "no_such_pipeline"),
        (&["merge", "in.mcap", "-o", "out.mcap", "--set", "icp"], "STAGE.PARAMETER=VALUE"),
        (&["merge", "in.mcap", "-o", "out.mcap", "--set", "icpp.radius=1"], "icp"),
        (&["merge", "in.mcap", "-o", "out.mcap", "--engine", "fast"], "single"),
        (&["kinds", "no_such_kind"], "icp_refiner"),
        (&["dance"], "dance"),
    ] {
        gridweave(folder.path(), args).assert(2, &[word]);
    }
}
