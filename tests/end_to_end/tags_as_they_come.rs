//! Tags as robots log them: ranges in messages of other types, signal strengths, tags that a camera sees, and logs of
//! tags without maps.

use crate::support::{Ended, LogBuilder, gridweave, json, simulate};
use gridweave_logs::reader::{LogFile, LogReader};
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{
    Header, OccupancyGrid, Path as RosPath, PoseStamped, RosMessage, TFMessage, TagRange, Transform, TransformStamped,
    Vector3, decode, encode,
};
use gridweave_tests::{Sense, TagDrive};
use nalgebra::{Isometry2, Point2, Vector2};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Two simulated robots.
struct World {
    folder: TempDir,
    log: PathBuf,
    truth: PathBuf,
}

impl World {
    fn new() -> Self {
        let folder = TempDir::new().unwrap();
        let (log, truth) = simulate(folder.path(), "simulated.mcap", &["--robots", "2", "--seed", "2"]);
        Self { folder, log, truth }
    }

    /// Writes the log again as `in.mcap`, without maps unless `maps`, and with `write` in place of the readings of
    /// tags: it is given the time in seconds, the robot, its last pose, and the reading.
    fn write(&self, maps: bool, mut write: impl FnMut(&mut LogBuilder, f64, &str, Isometry2<f64>, TagRange)) {
        let mut out = LogBuilder::new(&self.folder.path().join("in.mcap"));
        let mut reader = LogReader::new(vec![LogFile::open(&self.log).unwrap()]);
        let files = reader.files().clone();
        let mut poses: BTreeMap<String, Isometry2<f64>> = BTreeMap::new();
        while let Some(message) = reader.next_message() {
            let channel = files[0].channel(message.channel).unwrap();
            let seconds = message.log_time.seconds_since(LogTime(1_700_000_000_000_000_000));
            let robot = channel.topic.split('/').nth(1).unwrap_or_default();
            match channel.schema_name.as_str() {
                PoseStamped::NAME => {
                    let pose: PoseStamped = decode(message.data).unwrap();
                    poses.insert(robot.to_owned(), pose.pose.planar());
                    out.message(seconds, &channel.topic, &pose);
                }
                TagRange::NAME => {
                    let pose = poses.get(robot).copied().unwrap_or_default();
                    write(&mut out, seconds, robot, pose, decode(message.data).unwrap());
                }
                OccupancyGrid::NAME if maps => {
                    out.raw(seconds, &channel.topic, OccupancyGrid::NAME, message.data);
                }
                _ => {}
            }
        }
        out.finish();
    }

    fn run(&self, args: &[&str]) -> Ended {
        gridweave(self.folder.path(), args)
    }

    /// Runs a pipeline, and holds that the frames are right.
    #[track_caller]
    fn assert_right(&self, pipeline: &str) -> Ended {
        let args = ["run", pipeline, "--input", "in.mcap", "--output", "out.mcap", "--summary", "summary.json"];
        let ended = self.run(&args);
        ended.assert(0, &["merged 2 of 2"]);
        self.assert_true();
        ended
    }

    #[track_caller]
    fn assert_true(&self) {
        let truth = ["evaluate", "summary.json", "--truth", self.truth.to_str().unwrap()];
        self.run(&truth).assert(0, &["right 1, wrong 0, refused 0"]);
    }

    /// A pipeline as one that ships, with another section `[robots]`.
    fn pipeline(&self, name: &str, robots: &str) {
        own_pipeline(self.folder.path(), name, robots);
    }
}

/// Writes a pipeline as one that ships, with another section `[robots]`, as `own.toml`.
fn own_pipeline(folder: &Path, name: &str, robots: &str) {
    let text = fs::read_to_string(format!("{}/../pipelines/{name}.toml", env!("CARGO_MANIFEST_DIR"))).unwrap();
    let (before, rest) = text.split_once("[robots]").unwrap();
    let (_, after) = rest.split_once("[stages.log]").unwrap();
    fs::write(folder.join("own.toml"), format!("{before}[robots]\n{robots}\n[stages.log]{after}")).unwrap();
}

/// `sensor_msgs/msg/Range`, named by its frame.
fn range(header: Header, range: f32) -> Vec<u8> {
    encode(&(header, 1u8, 0.1f32, 0.0f32, 100.0f32, range)).unwrap()
}

#[test]
fn a_log_of_tags_without_maps_gives_frames_and_no_map() {
    let world = World::new();
    world.write(false, |out, seconds, robot, _, reading| {
        let header = Header { frame_id: format!("{robot}/{}", reading.tag_id), ..reading.header };
        out.raw(
            seconds,
            &format!("/{robot}/tag_ranges"),
            "sensor_msgs/msg/Range",
            &range(header, reading.range as f32),
        );
    });
    let ended = world.run(&["merge", "in.mcap", "-o", "out.mcap", "--summary", "summary.json"]);
    ended.assert(0, &["merged 2 of 2"]);
    world.assert_true();
    let info = world.run(&["info", "out.mcap"]);
    info.assert(0, &["/tf_static", "/robot_frames", "/robot1/log/tags", "/robot2/merged_path"]);
    assert!(!info.stdout.contains("OccupancyGrid"), "{info:#?}");
    let info = world.run(&["info", "in.mcap", "--json"]);
    let output: Value = serde_json::from_str(&info.stdout).unwrap();
    let tags = output["robots"]["robot1"]["tags"].as_object().unwrap();
    assert!(tags.len() > 5 && tags.keys().all(|tag| !tag.contains('/')), "{tags:?}");
}

#[test]
fn fields_of_any_message_are_ranges_or_signal_strengths_of_tags() {
    let world = World::new();
    // The range in millimetres, and then the strength of a signal without noise, in a message of another type and
    // topic.
    let models: [(&str, &dyn Fn(f64) -> f64); 2] = [
        ("range_field = \"range\", range_unit = 0.001, stddev = 0.05", &|metres| 1000.0 * metres),
        ("rssi_field = \"range\", rssi_at_1m = -40, path_loss_exponent = 2.5, rssi_stddev = 0.5", &|metres| {
            -40.0 - 25.0 * metres.max(0.01).log10()
        }),
    ];
    for (fields, value) in models {
        world.write(true, |out, seconds, robot, _, reading| {
            let header = Header { frame_id: reading.tag_id, ..reading.header };
            let bytes = range(header, value(reading.range) as f32);
            out.raw(seconds, &format!("/{robot}/radio/readings"), "sensor_msgs/msg/Range", &bytes);
        });
        let robots =
            format!("tags = {{ topic = \"/{{robot}}/radio/readings\", id_field = \"header.frame_id\", {fields} }}");
        world.pipeline("tag_merge", &robots);
        world.assert_right("own.toml");
    }
    world.pipeline(
        "tag_merge",
        "tags = { topic = \"/{robot}/radio/readings\", id_field = \"header.frame_id\", range_field = \"mm\" }",
    );
    let args = ["run", "own.toml", "--input", "in.mcap", "--output", "out.mcap"];
    world.run(&args).assert(3, &["tag readings on `/robot1/radio/readings` were dropped", "no field `mm`"]);
    world.pipeline("tag_merge", "tags = { topic = \"/{robot}/radio/readings\", rssi_field = \"dbm\", range = 1 }");
    world.run(&args).assert(2, &["`tags` has no `id_field`", "`tags` has no `rssi_at_1m`", "did you mean `range_"]);
}

#[test]
fn tags_that_a_camera_sees_merge_maps() {
    let world = World::new();
    let truth: Value = json(&world.truth);
    let number = |value: &Value| value.as_f64().unwrap();
    let transform_world_map = |robot: &str| {
        let frame = &truth["frames"][robot];
        Isometry2::new(Vector2::new(number(&frame["x"]), number(&frame["y"])), number(&frame["yaw"]))
    };
    let mut started = false;
    world.write(true, |out, seconds, robot, pose, reading| {
        if !std::mem::replace(&mut started, true) {
            for robot in ["robot1", "robot2"] {
                // Messages of the detector beside tf; their layout differs between versions, and they are not read.
                let topic = format!("/{robot}/camera/detections");
                out.raw(seconds, &topic, "apriltag_msgs/msg/AprilTagDetectionArray", &[0, 1, 0, 0]);
                let mount = Isometry2::new(Vector2::new(0.2, -0.1), 0.3);
                let header = Header { frame_id: format!("{robot}/base_link"), ..reading.header.clone() };
                let mount =
                    TransformStamped { header, child_frame_id: format!("{robot}/camera"), transform: mount.into() };
                out.message(seconds, "/tf_static", &TFMessage { transforms: vec![mount] });
            }
        }
        let place = &truth["tags"][&reading.tag_id];
        let place = Point2::new(number(&place[0]), number(&place[1]));
        // Off by what the range is off, along the line of sight.
        let in_base = (transform_world_map(robot) * pose).inverse() * place;
        let in_base = in_base.coords * (reading.range / in_base.coords.norm());
        let seen = Isometry2::new(Vector2::new(0.2, -0.1), 0.3).inverse() * Point2::from(in_base);
        let translation = Vector3 { x: seen.x, y: seen.y, z: 0.4 };
        let header = Header { frame_id: format!("{robot}/camera"), ..reading.header };
        let number: String = reading.tag_id.chars().filter(char::is_ascii_digit).collect();
        let transform = Transform { translation, ..Default::default() };
        let tag = TransformStamped { header, child_frame_id: format!("tag36h11:{number}"), transform };
        out.message(seconds, "/tf", &TFMessage { transforms: vec![tag] });
    });
    let ended = world.assert_right("tag_merge");
    assert!(!ended.text().contains("no reading of a tag"), "{ended:#?}");
    world.run(&["info", "out.mcap"]).assert(0, &["/robot1/log/positions", "gridweave_msgs/msg/TagPosition"]);
}

/// What was found of two drives, and the truth.
struct MergedDrives {
    /// The frame of robot2 in that of robot1: found, and the truth.
    frame: [Isometry2<f64>; 2],
    /// How far the end of robot2's path is from where it was, metres.
    off_at_the_end: f64,
}

/// Two robots that drive round a place of this size, in metres, from two sides, with odometry that drifts.
fn merged_drives(
    [width, height]: [f64; 2],
    drift: f64,
    reach: f64,
    sense: Sense,
    tags: &[Point2<f64>],
    args: &[&str],
) -> MergedDrives {
    let folder = TempDir::new().unwrap();
    let mut log = LogBuilder::new(&folder.path().join("in.mcap"));
    let corner = |x: f64, y: f64| Point2::new(x * width, y * height);
    let corners = [corner(0.1, 0.1), corner(0.9, 0.1), corner(0.9, 0.9), corner(0.1, 0.9)];
    let starts = [Isometry2::new(corner(0.1, 0.1).coords, 0.0), Isometry2::new(corner(0.9, 0.9).coords, 2.0)];
    // Robot2 begins at the third corner, so it ends at the second.
    let end = starts[0].inverse() * corners[1];
    for (number, robot) in ["robot1", "robot2"].into_iter().enumerate() {
        let mut corners = corners.to_vec();
        corners.rotate_left(2 * number);
        let (start, seed) = (starts[number], 7 + number as u64);
        TagDrive { robot, start, corners, drift, reach, sense, seed }.write(&mut log, tags);
    }
    log.finish();
    let robots = match sense {
        Sense::Bearings { .. } => {
            "tags = { topic = \"/{robot}/directions\", id_field = \"name[0]\", bearing_field = \"position[0]\", \
             bearing_unit = -0.0174532925, bearing_stddev = 0.05 }"
        }
        _ => "",
    };
    own_pipeline(folder.path(), "tag_frames", robots);
    let run = ["run", "own.toml", "--input", "in.mcap", "--output", "out.mcap", "--summary", "summary.json"];
    gridweave(folder.path(), &[&run, args].concat()).assert(0, &["merged 2 of 2"]);
    let summary: Value = json(&folder.path().join("summary.json"));
    let number = |field: &str| summary["frames"]["robot2"][field].as_f64().unwrap();
    let found = Isometry2::new(Vector2::new(number("x"), number("y")), number("yaw"));
    let file = LogFile::open(folder.path().join("out.mcap")).unwrap();
    let path = file.channels().find(|(_, channel)| channel.topic == "/robot2/merged_path").unwrap().0;
    let mut reader = LogReader::new(vec![file]);
    let mut last = None;
    while let Some(message) = reader.next_message() {
        if message.channel == path {
            let path: RosPath = decode(message.data).unwrap();
            last = path.poses.last().map(|pose| pose.pose.planar());
        }
    }
    let off_at_the_end = (last.unwrap().translation.vector - end.coords).norm();
    MergedDrives { frame: [found, starts[0].inverse() * starts[1]], off_at_the_end }
}

/// The frames agree to so many metres where the tags are, and radians.
#[track_caller]
fn assert_near(merged: MergedDrives, metres: f64, radians: f64) {
    let [found, truth] = merged.frame;
    let off = truth.inv_mul(&found);
    let (place, turn) = (off.translation.vector.norm(), off.rotation.angle().abs());
    let end = merged.off_at_the_end;
    let is_near = place < metres && turn < radians && end < 2.0 * metres;
    assert!(is_near, "{place:.3} m, {:.3} degrees off, the end of the path {end:.3} m", turn.to_degrees());
}

/// 15 landmarks in a hall of 15 x 8 m, as in UTIAS.
fn landmarks() -> Vec<Point2<f64>> {
    (0..15).map(|n| Point2::new(1.0 + 0.9 * f64::from(n), 1.0 + 6.0 * (0.37 * f64::from(n)).fract())).collect()
}

/// Four beacons round a lawn of 30 x 20 m, as in Plaza, and a fifth.
fn beacons() -> Vec<Point2<f64>> {
    [[-1.0, -1.0], [31.0, 1.0], [29.0, 21.0], [2.0, 19.0], [14.0, 8.0]].map(|[x, y]| Point2::new(x, y)).to_vec()
}

#[test]
fn landmarks_that_cameras_see_place_drives_whose_odometry_drifts() {
    let camera = Sense::Camera { stddev: 0.05 };
    assert_near(merged_drives([15.0, 8.0], 0.003, 4.0, camera, &landmarks(), &[]), 0.35, 0.05);
}

#[test]
fn directions_alone_place_drives_whose_odometry_drifts() {
    let bearings = Sense::Bearings { stddev: 0.05, outliers: 0.05 };
    assert_near(merged_drives([15.0, 8.0], 0.003, 4.0, bearings, &landmarks(), &[]), 0.35, 0.05);
}

#[test]
fn radio_ranges_of_tens_of_metres_with_outliers_place_drives_whose_odometry_drifts() {
    let ranges = Sense::Ranges { stddev: 0.2, outliers: 0.1 };
    let args = [
        "tags.reach=25",
        "tags.grid_size=60",
        "tags.resolution=0.1",
        "tags.window=0.3",
        "tags.range_stddev=0.3",
        "tags.outlier_share=0.1",
        "tags.position_stddev=0.1",
    ];
    let args: Vec<&str> = args.iter().flat_map(|set| ["--set", *set]).collect();
    assert_near(merged_drives([30.0, 20.0], 0.002, 25.0, ranges, &beacons(), &args), 0.6, 0.04);
}

#[test]
fn a_drive_whose_odometry_is_off_by_metres_is_estimated_with_its_tags() {
    // After two rounds of 38 m the heading is off by 25 degrees, after two of 84 m by 7.
    let camera = Sense::Camera { stddev: 0.05 };
    assert_near(merged_drives([15.0, 8.0], 0.05, 4.0, camera, &landmarks(), &[]), 0.35, 0.05);
    let bearings = Sense::Bearings { stddev: 0.05, outliers: 0.05 };
    assert_near(merged_drives([15.0, 8.0], 0.05, 4.0, bearings, &landmarks(), &[]), 0.35, 0.05);
    let ranges = Sense::Ranges { stddev: 0.2, outliers: 0.1 };
    assert_near(merged_drives([30.0, 20.0], 0.01, 25.0, ranges, &beacons(), &[]), 0.6, 0.04);
}
