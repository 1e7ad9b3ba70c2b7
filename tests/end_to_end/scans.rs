//! Robots that have scans of their lidars, and no maps.

use crate::support::{Ended, LogBuilder, evaluate, gridweave, simulate};
use gridweave_runtime::ros::{
    Header, LaserScan, Odometry, PoseStamped, PoseWithCovarianceStamped, RosMessage, TFMessage, TransformStamped,
    decode,
};
use nalgebra::{Isometry2, Vector2};
use serde_json::Value;
use std::path::Path;
use tempfile::TempDir;

/// Simulates two robots, and keeps of what they log these topics: in `scans.mcap`.
fn logs_with(folder: &Path, topics: &str) {
    let world = ["--robots", "2", "--seed", "2", "--set", "overlap=0.9", "--set", "drift=0", "--set", "scans=true"];
    let small = ["--set", "width=12", "--set", "height=10", "--set", "tags=24", "--set", "beams=240"];
    simulate(folder, "in.mcap", &[&world[..], &small].concat());
    gridweave(folder, &["filter", "in.mcap", "-o", "scans.mcap", "--topics", topics]).assert(0, &["wrote"]);
}

fn merge(folder: &Path) -> Ended {
    gridweave(folder, &["merge", "scans.mcap", "-o", "out.mcap", "--summary", "summary.json"])
}

/// How many pairs of robots were merged rightly, and how many wrongly.
fn judged(folder: &Path) -> [Value; 2] {
    let evaluation = evaluate(folder, "in.truth.json".as_ref());
    ["right", "wrong"].map(|key| evaluation[key].clone())
}

#[test]
fn robots_with_scans_and_poses_and_without_maps_are_merged() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    logs_with(folder, "/{robot}/scan,/{robot}/pose,/{robot}/tag_ranges");
    gridweave(folder, &["info", "scans.mcap"])
        .assert(0, &["there is no map of robot1: `merge` builds one from its", "at the poses of /robot1/pose"]);
    merge(folder).assert(0, &["no map of robot1 and robot2: maps are built from scans", "merged 2 of 2"]);
    assert_eq!(judged(folder), [1, 0].map(Value::from));
    // The output has the maps that were built, and the scans that they were built from.
    let info = gridweave(folder, &["info", "out.mcap", "--json"]);
    let info: Value = serde_json::from_str(&info.stdout).unwrap();
    let topics: Vec<&str> =
        info["topics"].as_array().unwrap().iter().filter_map(|topic| topic["topic"].as_str()).collect();
    for topic in ["/robot1/drawn_map", "/robot2/drawn_map", "/map", "/robot1/scan", "/robot1/pose"] {
        assert!(topics.contains(&topic), "{topic}: {topics:?}");
    }
}

#[test]
fn poses_of_scans_may_come_from_tf_and_a_robot_may_have_its_map() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    logs_with(folder, "/{robot}/scan,/tf,/robot2/map");
    gridweave(folder, &["info", "scans.mcap"])
        .assert(0, &["`merge` builds one from its", "at the poses of tf (robot1/map to robot1/base_link)"]);
    let ended = merge(folder);
    ended.assert(0, &["no map of robot1: maps are built from scans", "merged 2 of 2"]);
    assert!(!ended.text().contains("were dropped: a result"), "{ended:?}");
    gridweave(folder, &["render", "out.mcap", "-o", "out.png"]).assert(0, &["wrote out.png"]);
    assert_eq!(judged(folder), [1, 0].map(Value::from));
}

#[test]
fn robots_with_scans_alone_are_merged() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    logs_with(folder, "/{robot}/scan");
    gridweave(folder, &["info", "scans.mcap"]).assert(0, &["by SLAM; odometry would make it surer"]);
    merge(folder).assert(0, &["maps are built from scans", "merged 2 of 2"]);
}

/// Writes a log again with odometry in place of poses, which finds every way 3 % too long, and with lidars that are
/// mounted askew, which tf says if `is_mounted`. The odometry is in tf alone if `in_tf`.
fn with_odometry(log: &Path, to: &Path, in_tf: bool, is_mounted: bool) {
    const ASKEW: f64 = 0.3;
    let bytes = std::fs::read(log).unwrap();
    let mut written = LogBuilder::new(to);
    let mounted = |robot: &str| TransformStamped {
        header: Header { frame_id: format!("{robot}/base_link"), ..Default::default() },
        child_frame_id: format!("{robot}/laser"),
        transform: Isometry2::rotation(ASKEW).into(),
    };
    if is_mounted {
        written.message(0.0, "/tf_static", &TFMessage { transforms: ["robot1", "robot2"].map(mounted).to_vec() });
    }
    let mut start = None;
    for message in mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap) {
        let seconds = (message.log_time - *start.get_or_insert(message.log_time)) as f64 * 1e-9;
        let robot = message.channel.topic.split('/').nth(1).unwrap();
        match message.channel.schema.as_ref().unwrap().name.as_str() {
            PoseStamped::NAME => {
                let PoseStamped { mut header, mut pose } = decode(&message.data).unwrap();
                header.frame_id = format!("{robot}/odom");
                (pose.position.x, pose.position.y) = (1.03 * pose.position.x, 1.03 * pose.position.y);
                if in_tf {
                    let (child_frame_id, transform) = (format!("{robot}/base_link"), pose.planar().into());
                    let moved = TransformStamped { header, child_frame_id, transform };
                    written.message(seconds, "/tf", &TFMessage { transforms: vec![moved] });
                    continue;
                }
                let mut odometry = Odometry { header, ..Default::default() };
                odometry.pose.pose = pose;
                written.message(seconds, &format!("/{robot}/odom"), &odometry);
            }
            LaserScan::NAME => {
                let mut scan: LaserScan = decode(&message.data).unwrap();
                scan.header.frame_id = format!("{robot}/laser");
                scan.angle_min -= ASKEW as f32;
                written.message(seconds, &format!("/{robot}/scan"), &scan);
            }
            _ => {}
        }
    }
    written.finish();
}

#[test]
fn robots_with_scans_and_odometry_alone_are_merged() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let world = ["--robots", "2", "--seed", "2", "--set", "overlap=0.9", "--set", "drift=0", "--set", "scans=true"];
    let small = ["--set", "width=12", "--set", "height=10", "--set", "tags=0", "--set", "map_offset=0"];
    simulate(folder, "in.mcap", &[&world[..], &small].concat());
    for (in_tf, along) in [(false, "`/robot1/odom`"), (true, "tf (robot1/odom to robot1/base_link)")] {
        with_odometry(&folder.join("in.mcap"), &folder.join("scans.mcap"), in_tf, true);
        let method = format!("by SLAM, with the odometry of {along}");
        gridweave(folder, &["info", "scans.mcap"]).assert(0, &[&method]);
        merge(folder).assert(0, &["no map of robot1 and robot2: maps are built from scans", "merged 2 of 2"]);
        assert_eq!(judged(folder), [1, 0].map(Value::from));
    }
    with_odometry(&folder.join("in.mcap"), &folder.join("scans.mcap"), false, false);
    let lidar = |value: &str| {
        let given = ["robot1", "robot2"].map(|robot| format!("--lidar={robot}={value}"));
        let options = ["merge", "scans.mcap", "-o", "out.mcap", "--summary", "summary.json"];
        gridweave(folder, &options.into_iter().chain(given.iter().map(String::as_str)).collect::<Vec<_>>())
    };
    let ended = lidar("0,0,0.3");
    ended.assert(0, &["merged 2 of 2"]);
    assert!(!ended.text().contains("tf has no transform"), "{}", ended.text());
    assert_eq!(judged(folder), [1, 0].map(Value::from));
    for wrong in ["0,0", "0,0,nan", "0,0,0,0,0", "ahead", "0,0,90"] {
        lidar(wrong).assert(2, &["--lidar robot1=", "write ROBOT=X,Y,YAW"]);
    }
    gridweave(folder, &["merge", "scans.mcap", "-o", "out.mcap", "--lidar", "robot9=0,0,0"])
        .assert(1, &["`lidars` names `robot9`", "robot1 and robot2"]);
    let degrees = ["merge", "scans.mcap", "-o", "out.mcap", "--set", "log.lidars={robot1 = [0, 0, 90]}"];
    gridweave(folder, &degrees).assert(2, &["must be [X, Y, YAW] or [X, Y, YAW, ROLL]", "90 degrees are 1.5708"]);
}

/// Odometry as bad as that of public logs: the maps are built by SLAM, and merged.
#[test]
fn robots_whose_odometry_drifts_are_merged() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let world =
        ["--robots", "2", "--seed", "5", "--set", "overlap=0.9", "--set", "scans=true", "--set", "odometry=true"];
    let small = ["--set", "width=12", "--set", "height=10", "--set", "tags=0", "--set", "odometry_slips=1"];
    simulate(folder, "in.mcap", &[&world[..], &small].concat());
    let raw = ["filter", "in.mcap", "-o", "scans.mcap", "--topics", "/{robot}/scan,/{robot}/odom"];
    gridweave(folder, &raw).assert(0, &[]);
    merge(folder).assert(0, &["maps are built from scans", "merged 2 of 2"]);
    assert_eq!(judged(folder), [1, 0].map(Value::from));
    assert_eq!(refined_together(folder), 2);
    let apart = ["run", "scan_merge", "--input", "scans.mcap", "--output", "apart.mcap", "--summary", "summary.json"];
    gridweave(folder, &[&apart[..], &["--set", "mapper.joint_refinement=false"]].concat())
        .assert(0, &["merged 2 of 2"]);
    assert_eq!(refined_together(folder), Value::Null);
    // The map of one is recorded, and the other's scans are straightened by it.
    let mixed = ["filter", "in.mcap", "-o", "scans.mcap", "--topics", "/robot1/map,/robot2/scan,/robot2/odom"];
    gridweave(folder, &mixed).assert(0, &[]);
    merge(folder).assert(0, &["no map of robot2: maps are built from scans", "merged 2 of 2"]);
    assert_eq!(judged(folder), [1, 0].map(Value::from));
    assert_eq!(refined_together(folder), 1);
}

/// Seconds of the drive of `with_gap` from the start of its first part to that of its second.
const SECOND_PART: f64 = 1000.0;

/// Writes the scans and the odometry of two robots as those of one, robot1, which was not recorded between them.
fn with_gap(log: &Path, to: &Path) {
    let bytes = std::fs::read(log).unwrap();
    let mut written = LogBuilder::new(to);
    let mut start = None;
    let as_robot1 = |text: &str| text.replace("robot2", "robot1");
    for message in mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap) {
        let topic = &message.channel.topic;
        let later = if topic.starts_with("/robot2/") { SECOND_PART } else { 0.0 };
        let seconds = (message.log_time - *start.get_or_insert(message.log_time)) as f64 * 1e-9 + later;
        let renamed = |header: &Header| gridweave_tests::header(seconds, as_robot1(&header.frame_id));
        match message.channel.schema.as_ref().unwrap().name.as_str() {
            Odometry::NAME => {
                let mut odometry: Odometry = decode(&message.data).unwrap();
                odometry.header = renamed(&odometry.header);
                odometry.child_frame_id = as_robot1(&odometry.child_frame_id);
                written.message(seconds, "/robot1/odom", &odometry);
            }
            LaserScan::NAME => {
                let mut scan: LaserScan = decode(&message.data).unwrap();
                scan.header = renamed(&scan.header);
                written.message(seconds, "/robot1/scan", &scan);
            }
            _ => {}
        }
    }
    written.finish();
}

/// The first and the last pose on a topic.
fn ends(log: &Path, topic: &str, pose: impl Fn(&[u8]) -> Isometry2<f64>) -> [Isometry2<f64>; 2] {
    let bytes = std::fs::read(log).unwrap();
    let messages = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap);
    let mut poses = messages.filter(|message| message.channel.topic == topic).map(|message| pose(&message.data));
    let first = poses.next().unwrap();
    [first, poses.last().unwrap()]
}

#[test]
fn a_drive_that_was_not_recorded_for_long_goes_on_where_both_parts_fit() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let world = ["--robots", "2", "--seed", "5", "--set", "overlap=0.9", "--set", "scans=true", "--set", "drift=0"];
    let small = ["--set", "width=12", "--set", "height=10", "--set", "tags=0", "--set", "odometry=true"];
    simulate(folder, "in.mcap", &[&world[..], &small].concat());
    with_gap(&folder.join("in.mcap"), &folder.join("scans.mcap"));
    let ended = merge(folder);
    ended.assert(0, &["only robot1 has a map"]);
    assert!(!ended.text().contains("lost its way"), "{}", ended.text());
    let truth: Value = serde_json::from_slice(&std::fs::read(folder.join("in.truth.json")).unwrap()).unwrap();
    let [first, last] = ["robot1", "robot2"].map(|robot| {
        let frame = ["x", "y", "yaw"].map(|key| truth["frames"][robot][key].as_f64().unwrap());
        let poses = ends(&folder.join("in.mcap"), &format!("/{robot}/pose"), |data| {
            decode::<PoseStamped>(data).unwrap().pose.planar()
        });
        poses.map(|pose| Isometry2::new(Vector2::new(frame[0], frame[1]), frame[2]) * pose)
    });
    let found = ends(&folder.join("out.mcap"), "/robot1/matched_pose", |data| {
        decode::<PoseWithCovarianceStamped>(data).unwrap().pose.pose.planar()
    });
    let off = first[0].inv_mul(&last[1]).inv_mul(&found[0].inv_mul(&found[1]));
    assert!(off.translation.vector.norm() < 0.2 && off.rotation.angle().abs() < 0.05, "{off}");
}

/// How many robots with scans were refined in one pose graph.
fn refined_together(folder: &Path) -> Value {
    let summary: Value = serde_json::from_slice(&std::fs::read(folder.join("summary.json")).unwrap()).unwrap();
    summary["stages"]["mapper"]["counts"]["robots refined together"].clone()
}

/// The lidar of robot2 sees too little to find its way.
#[test]
fn a_robot_that_loses_its_way_is_not_merged_and_the_reason_is_reported() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    for (robot, beams, range) in [("robot1", "beams=180", "lidar_range=12"), ("robot2", "beams=40", "lidar_range=0.8")]
    {
        let log = format!("{robot}.in.mcap");
        let world =
            ["--robots", "2", "--seed", "5", "--set", "scans=true", "--set", "odometry=true", "--set", "width=12"];
        let lidar = ["--set", "height=10", "--set", "tags=0", "--set", beams, "--set", range];
        simulate(folder, &log, &[&world[..], &lidar].concat());
        let topics = format!("/{robot}/scan,/{robot}/odom");
        let raw = ["filter", &log, "-o", &format!("{robot}.mcap"), "--topics", &topics];
        gridweave(folder, &raw).assert(0, &[]);
    }
    let merge = |logs: &[&str]| gridweave(folder, &[&["merge"], logs, &["-o", "out.mcap"]].concat());
    merge(&["robot1.mcap", "robot2.mcap"]).assert(3, &["not merged: robot2", "scans lie on none of its others"]);
    merge(&["robot2.mcap"]).assert(1, &["no usable map", "no map of robot2", "scans lie on none of its others"]);
}

/// Writes a log again in which what robot1 logs under a topic is cut in half.
fn with_cut_messages(log: &Path, to: &Path, topic: &str) {
    let bytes = std::fs::read(log).unwrap();
    let mut written = LogBuilder::new(to);
    for message in mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap) {
        let half = if message.channel.topic == topic { 2 } else { 1 };
        let type_name = &message.channel.schema.as_ref().unwrap().name;
        let data = &message.data[..message.data.len() / half];
        written.raw(message.log_time as f64 * 1e-9, &message.channel.topic, type_name, data);
    }
    written.finish();
}

#[test]
fn a_robot_of_which_nothing_can_be_read_is_named_as_not_merged() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    logs_with(folder, "/{robot}/scan");
    with_cut_messages(&folder.join("scans.mcap"), &folder.join("cut.mcap"), "/robot1/scan");
    let (options, text) =
        (["merge", "cut.mcap", "-o", "out.mcap", "--summary", "summary.json"], "none of its scans could be used");
    gridweave(folder, &options).assert(3, &["not merged: robot1", text]);
    let summary: Value = serde_json::from_slice(&std::fs::read(folder.join("summary.json")).unwrap()).unwrap();
    assert!(summary["unmerged"]["robot1"].as_str().is_some_and(|reason| reason.contains(text)), "{summary}");
    gridweave(folder, &[&options[..], &["--robots", "robot2"]].concat()).assert(0, &[]);
}
