//! Maps far from the origin of their frames: time and memory of a merge depend on the known area, not on that distance.

use crate::support::{Ended, change_log, gridweave_program, json, simulate, start_program};
use gridweave_runtime::ros::{OccupancyGrid, PoseStamped, RosMessage, decode, encode};
use nalgebra::{Isometry2, Vector2};
use serde_json::Value;
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

/// How far, metres.
const FAR: f64 = 10_000.0;

/// A log of two robots, where the frame of robot2 is moved so that its map is far from its origin, and the true frames.
struct Far {
    folder: TempDir,
    log: PathBuf,
    truth: PathBuf,
}

impl Far {
    /// `poses`: whether the robot says as well that it drives there.
    fn new(poses: bool) -> Self {
        let folder = TempDir::new().unwrap();
        let (log, truth) = simulate(folder.path(), "near.mcap", &["--robots", "2"]);
        let far = folder.path().join("far.mcap");
        change_log(&log, &far, |topic, type_name, data| {
            if topic.starts_with("/robot2/") && type_name == OccupancyGrid::NAME {
                let mut map: OccupancyGrid<'_> = decode(data).unwrap();
                map.info.origin.position.x += FAR;
                return Some(encode(&map).unwrap());
            }
            if poses && topic.starts_with("/robot2/") && type_name == PoseStamped::NAME {
                let mut pose: PoseStamped = decode(data).unwrap();
                pose.pose.position.x += FAR;
                return Some(encode(&pose).unwrap());
            }
            Some(data.to_vec())
        });
        // The same place in the world: the frame is as far on the other side.
        let mut true_frames: Value = json(&truth);
        let frame = &mut true_frames["frames"]["robot2"];
        let number = |name: &str| frame[name].as_f64().unwrap();
        let near = Isometry2::new(Vector2::new(number("x"), number("y")), number("yaw"));
        let moved = near * Isometry2::translation(-FAR, 0.0);
        (frame["x"], frame["y"]) = (moved.translation.x.into(), moved.translation.y.into());
        let centre = &mut true_frames["centres"]["robot2"][0];
        *centre = (centre.as_f64().unwrap() + FAR).into();
        let truth = folder.path().join("far.truth.json");
        fs::write(&truth, true_frames.to_string()).unwrap();
        Self { folder, log: far, truth }
    }

    /// A run that may take 4 GB of addresses: a grid or a table of so many cells a side would take more.
    fn run(&self, pipeline: &str) -> Ended {
        let program = gridweave_program().to_str().unwrap();
        let [log, limited] = [self.log.to_str().unwrap(), "ulimit -v 4000000; exec \"$0\" \"$@\""];
        let run =
            ["run", pipeline, "--engine", "single", "--input", log, "-o", "out.mcap", "--summary", "summary.json"];
        let args = [&["-c", limited, program], &run[..], &["--map", "map.yaml"]].concat();
        start_program("sh".as_ref(), self.folder.path(), &args, &[]).wait()
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn evaluate(&self) -> Ended {
        let [summary, truth] = [self.path("summary.json"), self.truth.clone()];
        let args = ["evaluate", summary.to_str().unwrap(), "--truth", truth.to_str().unwrap(), "--json"];
        start_program(gridweave_program(), self.folder.path(), &args, &[]).wait()
    }
}

#[test]
fn a_robot_whose_map_is_far_from_the_origin_of_its_frame_is_merged_right() {
    let far = Far::new(true);
    far.run("tag_merge").assert(0, &["merged 2 of 2 robots"]);
    far.evaluate().assert(0, &["\"right\": 1", "\"wrong\": 0"]);
    let (width, height) = image::image_dimensions(far.path("map.pgm")).unwrap();
    assert!(width.max(height) < 1000, "{width} x {height}");
}

#[test]
fn a_map_far_from_the_path_of_its_robot_is_not_merged_and_the_reason_is_reported() {
    let far = Far::new(false);
    far.run("tag_merge").assert(3, &["the maps have no walls near each other"]);
    // Without a comparison of the maps the tags decide, and the map is at its origin.
    far.run("tag_only").assert(0, &["longer than `max_extent`, 1000 m; does the origin of each map fit the poses"]);
    let (width, height) = image::image_dimensions(far.path("map.pgm")).unwrap();
    assert!(width.max(height) < 1000, "{width} x {height}");
}
