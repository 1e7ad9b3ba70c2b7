//! Map files are merged like the maps of logs, and a merge may write its map as one.

use crate::support::{Ended, TestMap, evaluate, gridweave, gridweave_with, json, simulate};
use gridweave_logs::map_file::{self, GridMap};
use gridweave_logs::picture::robot_colour;
use gridweave_runtime::ros::{MapMetaData, OccupancyGrid, Pose, RosMessage, decode};
use nalgebra::{Isometry2, Vector2};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The last grid on each topic of a log.
fn grids(log: &Path) -> BTreeMap<String, GridMap> {
    let bytes = fs::read(log).unwrap();
    let messages = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap);
    let grids = messages.filter(|message| message.channel.schema.as_ref().unwrap().name == OccupancyGrid::NAME);
    let read = |message: mcap::Message<'_>| {
        (message.channel.topic.clone(), GridMap::from_message(&decode(&message.data).unwrap()))
    };
    grids.map(read).collect()
}

/// A folder with the map of each robot of a simulated log as ROBOT.yaml, and the truth.
fn map_files(seed: &str) -> (TempDir, PathBuf) {
    let folder = TempDir::new().unwrap();
    let args = ["--robots", "2", "--seed", seed, "--set", "tags=0", "--set", "snapshots=1"];
    let (log, truth) = simulate(folder.path(), "robots.mcap", &args);
    for (topic, map) in grids(&log) {
        map_file::save(&folder.path().join(topic.replace("/map", ".yaml").replace('/', "")), &map).unwrap();
    }
    fs::remove_file(log).unwrap();
    (folder, truth)
}

/// Merges in `folder`, with a separate folder for temporary files, which must be empty afterwards.
#[track_caller]
pub(crate) fn merge(folder: &Path, args: &[&str]) -> Ended {
    let temporary = TempDir::new().unwrap();
    let args = [&["merge"], args].concat();
    let ended = gridweave_with(folder, &args, &[("TMPDIR", temporary.path().to_str().unwrap())]);
    let left: Vec<_> = fs::read_dir(temporary.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert!(left.is_empty(), "{left:?} is left");
    ended
}

/// The names of the files in a folder.
fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// Two maps that cannot be merged, as a.yaml and b.yaml.
pub(crate) fn two_rooms() -> TempDir {
    let folder = TempDir::new().unwrap();
    for name in ["a.yaml", "b.yaml"] {
        save_room(&folder.path().join(name));
    }
    folder
}

pub(crate) fn save_room(path: &Path) {
    let TestMap { info, cells } = TestMap::flat();
    map_file::save(path, &GridMap { info, cells }).unwrap();
}

#[test]
fn map_files_give_one_map_file_and_nothing_else() {
    let (folder, truth) = map_files("1001");
    let before = names(folder.path());
    let args = ["robot1.yaml", "robot2.yaml", "-o", "merged.yaml", "--summary", "summary.json"];
    let ended = merge(folder.path(), &[&args[..], &["--picture", "merged.png"]].concat());
    ended.assert(0, &["merged 2 of 2 robots", "known to one map"]);
    let evaluation = evaluate(folder.path(), &truth);
    assert_eq!((&evaluation["right"], &evaluation["wrong"]), (&Value::from(1), &Value::from(0)), "{evaluation}");

    let mut expected = before;
    expected.extend(["merged.pgm", "merged.png", "merged.yaml", "summary.json"].map(str::to_owned));
    expected.sort();
    assert_eq!(names(folder.path()), expected);
    let picture = image::open(folder.path().join("merged.png")).unwrap().to_rgb8();
    for robot in [0, 1] {
        let walls = picture.pixels().filter(|pixel| pixel.0 == robot_colour(robot)).count();
        assert!(walls > 50, "walls that robot {robot} alone has seen have its colour: {walls} pixels");
    }
    let merged = map_file::load(&folder.path().join("merged.yaml")).unwrap();
    let known = |map: &GridMap| map.cells.iter().filter(|cell| **cell != -1).count();
    for robot in ["robot1.yaml", "robot2.yaml"] {
        assert!(known(&merged) > known(&map_file::load(&folder.path().join(robot)).unwrap()), "more than {robot}");
    }

    // The order of the files changes nothing.
    let image = || fs::read(folder.path().join("merged.pgm")).unwrap();
    let first = image();
    merge(folder.path(), &["robot2.yaml", "./robot1.yaml", "-o", "merged.yaml"]).assert(0, &[]);
    assert!(image() == first);
}

#[test]
fn maps_of_other_resolutions_and_turned_origins_are_merged() {
    let (folder, truth) = map_files("1001");
    let path = folder.path().join("robot2.yaml");
    let map = map_file::load(&path).unwrap();
    // Twice as coarse: a cell is the most occupied of four.
    let (width, height) = (map.info.width as usize, map.info.height as usize);
    let value = |column: usize, row: usize| {
        let block = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, y)| (2 * column + x, 2 * row + y));
        let inside = block.into_iter().filter(|(column, row)| *column < width && *row < height);
        inside.map(|(column, row)| map.cells[row * width + column]).max().unwrap()
    };
    let (columns, rows) = (width.div_ceil(2), height.div_ceil(2));
    let cells = (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row)));
    let cells = cells.map(|(column, row)| value(column, row)).collect();
    let mut info = map.info;
    (info.width, info.height, info.resolution) = (columns as u32, rows as u32, 2.0 * info.resolution);
    // In a map frame that is turned by 0.4 rad against the first.
    let transform_turned_map = Isometry2::new(Vector2::new(3.0, -1.0), 0.4);
    info.origin = Pose::from(transform_turned_map * info.origin.planar());
    map_file::save(&path, &GridMap { info, cells }).unwrap();

    let args = ["robot1.yaml", "robot2.yaml", "-o", "merged.yaml", "--summary", "summary.json"];
    merge(folder.path(), &args).assert(0, &["merged 2 of 2 robots"]);
    let frame = |json: &Value, robot: &str| {
        let [x, y, yaw] = ["x", "y", "yaw"].map(|field| json["frames"][robot][field].as_f64().unwrap());
        Isometry2::new(Vector2::new(x, y), yaw)
    };
    let [found, truth]: [Value; 2] = [json(&folder.path().join("summary.json")), json(&truth)];
    let expected = frame(&truth, "robot1").inverse() * frame(&truth, "robot2") * transform_turned_map.inverse();
    let error = expected.inverse() * frame(&found, "robot2");
    println!("{:.3} m and {:.4} rad off", error.translation.vector.norm(), error.rotation.angle());
    // A cell of the coarser map is 0.1 m.
    assert!(error.translation.vector.norm() < 0.1 && error.rotation.angle().abs() < 0.01, "{error}");
    assert!((map_file::load(&folder.path().join("merged.yaml")).unwrap().info.resolution - 0.05).abs() < 1e-6);
}

#[test]
fn maps_in_a_frame_far_from_its_origin_are_merged() {
    let (folder, _) = map_files("1001");
    let merged = |far: f64| -> [f64; 3] {
        for robot in ["robot1", "robot2"] {
            let path = folder.path().join(format!("{robot}.yaml"));
            let mut map = map_file::load(&path).unwrap();
            map.info.origin.position.x += 0.09 * far;
            map.info.origin.position.y += far;
            map_file::save(&path, &map).unwrap();
        }
        let args = ["robot1.yaml", "robot2.yaml", "-o", "merged.yaml", "--summary", "summary.json"];
        merge(folder.path(), &args).assert(0, &["merged 2 of 2 robots"]);
        let summary = fs::read(folder.path().join("summary.json")).unwrap();
        let summary: Value = serde_json::from_slice(&summary).unwrap();
        ["x", "y", "yaw"].map(|key| summary["frames"]["robot2"][key].as_f64().unwrap())
    };
    let near = merged(0.0);
    // As far as the origin of UTM: where the origin was before, the map of robot 2 lies as before.
    let (across, far) = (450_000.0, 5_000_000.0);
    let [x, y, yaw] = merged(far);
    let (sin, cos) = yaw.sin_cos();
    let there = [x + cos * across - sin * far - across, y + sin * across + cos * far - far];
    let off = (there[0] - near[0]).hypot(there[1] - near[1]);
    assert!(off < 0.05 && (yaw - near[2]).abs() < 1e-3, "{off} m, {yaw} {}", near[2]);
}

#[test]
fn a_wrong_resolution_is_named_and_merged_only_with_the_right_one() {
    let (folder, truth) = map_files("1001");
    let path = folder.path().join("robot2.yaml");
    let right = map_file::load(&path).unwrap();
    let resolution = right.info.resolution;
    let wrong = MapMetaData { resolution: resolution / 0.88, ..right.info };
    map_file::save(&path, &GridMap { info: wrong, ..right }).unwrap();
    let args = ["robot1.yaml", "robot2.yaml", "-o", "merged.yaml", "--summary", "summary.json"];
    let refused = merge(folder.path(), &args);
    refused.assert(3, &["the maps may fit if robot2 is 0.8"]);
    let text = refused.stdout;
    let proposed = text.split("--resolution robot2=").nth(1).unwrap().split_whitespace().next().unwrap();
    let side: f64 = proposed.parse().unwrap();
    assert!((side / f64::from(resolution) - 1.0).abs() < 0.01, "{side} instead of {resolution}");

    let right = format!("robot2={resolution}");
    merge(folder.path(), &[&args[..], &["--resolution", &right]].concat()).assert(0, &["merged 2 of 2 robots"]);
    let evaluation = evaluate(folder.path(), &truth);
    assert_eq!((&evaluation["right"], &evaluation["wrong"]), (&Value::from(1), &Value::from(0)), "{evaluation}");

    for (resolution, status, problem) in [
        ("robot3=0.05", 1, "the robots are robot1 and robot2"),
        ("robot2=0", 2, "above 0"),
        ("robot2", 2, "ROBOT=METRES"),
    ] {
        merge(folder.path(), &[&args[..], &["--resolution", resolution]].concat()).assert(status, &[problem]);
    }
}

#[test]
fn maps_of_16_million_cells_are_merged_alike_on_every_engine() {
    const SIDE: usize = 4000;
    let (folder, _) = map_files("1001");
    for robot in ["robot1.yaml", "robot2.yaml"] {
        let path = folder.path().join(robot);
        let map = map_file::load(&path).unwrap();
        let mut cells = vec![-1; SIDE * SIDE];
        for (row, known) in cells.chunks_exact_mut(SIDE).zip(map.cells.chunks_exact(map.info.width as usize)) {
            row[..known.len()].copy_from_slice(known);
        }
        let info = MapMetaData { width: SIDE as u32, height: SIDE as u32, ..map.info };
        map_file::save(&path, &GridMap { info, cells }).unwrap();
    }
    let merged = ["single", "threads", "processes"].map(|engine| {
        let args = ["robot1.yaml", "robot2.yaml", "-o", "merged.yaml", "--engine", engine];
        merge(folder.path(), &args).assert(0, &["merged 2 of 2 robots"]);
        fs::read(folder.path().join("merged.pgm")).unwrap()
    });
    assert!(merged[0] == merged[1] && merged[0] == merged[2]);
}

#[test]
fn map_files_give_a_log_on_demand() {
    let (folder, _) = map_files("1001");
    let args = ["robot1.yaml", "robot2.yaml", "-o", "out.mcap", "--map", "merged.yaml"];
    merge(folder.path(), &args).assert(0, &["merged 2 of 2 robots"]);
    let out = grids(&folder.path().join("out.mcap"));
    assert_eq!(
        out.keys().map(String::as_str).collect::<Vec<_>>(),
        ["/map", "/map_conflicts", "/robot1/map", "/robot2/map"]
    );
    assert_eq!(out["/robot1/map"].cells, map_file::load(&folder.path().join("robot1.yaml")).unwrap().cells);
    assert_eq!(out["/map"].info, out["/map_conflicts"].info);
    let (map, conflicts) = (&out["/map"].cells, &out["/map_conflicts"].cells);
    assert!(map.iter().zip(conflicts).all(|(cell, conflict)| *cell != -1 || *conflict == -1));
    assert!(conflicts.contains(&0) && conflicts.contains(&-1));
    let map = map_file::load(&folder.path().join("merged.yaml")).unwrap();
    assert_eq!(map.cells.len(), out["/map"].cells.len());

    let args = ["robot1.yaml", "robot2.yaml", "-o", "out.mcap", "--results-only", "--reference", "robot2"];
    let ended = merge(folder.path(), &[&args[..], &["--set", "fuser.resolution=0.1", "--json"]].concat());
    let summary: Value = serde_json::from_str(&ended.stdout).unwrap();
    assert_eq!(summary["reference"], "robot2");
    let out = grids(&folder.path().join("out.mcap"));
    assert_eq!(out.keys().map(String::as_str).collect::<Vec<_>>(), ["/map", "/map_conflicts"]);
    assert!((out["/map"].info.resolution - 0.1).abs() < 1e-6);
}

#[test]
fn a_log_gives_a_map_file_on_demand() {
    let folder = TempDir::new().unwrap();
    let (log, _) = simulate(folder.path(), "in.mcap", &["--robots", "2", "--seed", "2"]);
    merge(folder.path(), &["in.mcap", "-o", "merged.yaml"]).assert(0, &["merged 2 of 2 robots"]);
    assert_eq!(names(folder.path()), ["in.mcap", "in.truth.json", "merged.pgm", "merged.yaml"]);
    merge(folder.path(), &[log.to_str().unwrap(), "-o", "out.mcap", "--map", "other.yaml"]).assert(0, &[]);
    let read = |name: &str| map_file::load(&folder.path().join(name)).unwrap();
    assert_eq!(read("merged.yaml"), read("other.yaml"));
}

#[test]
fn unrelated_maps_are_not_merged_and_the_reference_stands_alone() {
    let (folder, _) = map_files("1001");
    let (other, _) = map_files("1002");
    let stranger = other.path().join("robot2.yaml");
    let stranger = ["robot1.yaml", stranger.to_str().unwrap(), "-o", "merged.yaml"];
    merge(folder.path(), &stranger).assert(3, &["not merged: robot2", "fuser"]);
    let read = |name: &str| map_file::load(&folder.path().join(name)).unwrap();
    let walls = |map: GridMap| map.cells.iter().filter(|cell| **cell == 100).count();
    assert_eq!(walls(read("merged.yaml")), walls(read("robot1.yaml")));
}

#[test]
fn what_is_in_map_files_is_shown_as_a_merge_reads_it() {
    let folder = two_rooms();
    let info = |more: &[&str]| gridweave(folder.path(), &[&["info", "a.yaml", "b.yaml"], more].concat());
    info(&[]).assert(0, &["occupied m2", "  a  ", "  b  "]);
    let shown: Value = serde_json::from_str(&info(&["--json"]).stdout).unwrap();
    let map = map_file::load(&folder.path().join("a.yaml")).unwrap();
    assert_eq!((&shown[0]["robot"], &shown[1]["robot"]), (&Value::from("a"), &Value::from("b")));
    assert_eq!((&shown[0]["width"], &shown[0]["height"]), (&map.info.width.into(), &map.info.height.into()));
    let occupied =
        map.cells.iter().filter(|cell| **cell == 100).count() as f64 * f64::from(map.info.resolution).powi(2);
    assert!((shown[0]["occupied_m2"].as_f64().unwrap() - occupied).abs() < 1e-6, "{shown}");
    gridweave(folder.path(), &["info", "a.yaml", "a.mcap"]).assert(1, &["a.mcap: no such file or folder"]);
    gridweave(folder.path(), &["info", "missing.yaml"]).assert(1, &["missing.yaml"]);
}

#[test]
fn one_map_has_nothing_to_be_merged_with() {
    let folder = two_rooms();
    merge(folder.path(), &["a.yaml", "-o", "merged.yaml"]).assert(0, &["only a", "nothing to merge"]);
    let read = |name: &str| map_file::load(&folder.path().join(name)).unwrap();
    assert_eq!(read("merged.yaml"), read("a.yaml"));
}

#[test]
fn more_pairs_than_a_reader_has_room_for_are_merged_to_the_end() {
    let folder = TempDir::new().unwrap();
    let files: Vec<String> = (1..=9).map(|number| format!("robot{number}.yaml")).collect();
    files.iter().for_each(|file| save_room(&folder.path().join(file)));
    let args: Vec<&str> = files.iter().map(String::as_str).chain(["-o", "merged.yaml"]).collect();
    merge(folder.path(), &args).assert(0, &["merged 9 of 9"]);
}

#[test]
fn files_that_are_no_maps_are_named() {
    let folder = two_rooms();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("empty.yaml"), "").unwrap();
    fs::create_dir(path("folder")).unwrap();
    save_room(&path("alone.yaml"));
    fs::remove_file(path("alone.pgm")).unwrap();
    fs::copy(path("a.yaml"), path("cut.yaml")).unwrap();
    let text = fs::read_to_string(path("a.yaml")).unwrap();
    fs::write(path("cut.yaml"), text.replace("a.pgm", "cut.pgm")).unwrap();
    fs::write(path("cut.pgm"), &fs::read(path("a.pgm")).unwrap()[..1000]).unwrap();
    // More cells than any computer has room for, and than a number can count.
    fs::write(path("huge.yaml"), text.replace("a.pgm", "huge.pgm")).unwrap();
    fs::write(path("huge.pgm"), b"P5\n4000000000 4000000000\n255\n").unwrap();
    for (bad, status, words) in [
        ("missing.yaml", 1, &["missing.yaml"][..]),
        ("empty.yaml", 1, &["empty.yaml", "does not describe a map"]),
        ("alone.yaml", 1, &["alone.pgm", "alone.yaml"]),
        ("cut.yaml", 1, &["cut.pgm"]),
        ("huge.yaml", 1, &["huge.pgm"]),
        ("./a.yaml", 1, &["a.yaml", "twice"]),
        ("folder", 1, &["folder"]),
        ("b.pgm", 2, &["b.pgm is an image", "YAML"]),
    ] {
        for output in ["merged.yaml", "out.mcap"] {
            merge(folder.path(), &["a.yaml", bad, "-o", output]).assert(status, words);
            assert!(!path("merged.yaml").exists(), "nothing is written of {bad}");
        }
    }
}

#[test]
fn neither_a_map_nor_its_image_is_overwritten_and_no_file_is_written_twice() {
    let folder = two_rooms();
    let files =
        || names(folder.path()).iter().map(|name| fs::read(folder.path().join(name)).unwrap()).collect::<Vec<_>>();
    let before = files();
    for (args, word) in [
        (&["-o", "a.yaml"][..], "a.yaml is an input"),
        (&["-o", "a.yml"], "a.pgm is an input"),
        (&["-o", "a.pgm"], "a.pgm is an input"),
        (&["-o", "out.mcap", "--map", "./b.yaml"], "b.yaml is an input"),
        (&["-o", "merged.yaml", "--picture", "b.pgm"], "b.pgm is an input"),
        (&["-o", "merged.yaml", "--summary", "a.yaml"], "a.yaml is an input"),
        (&["-o", "merged.yaml", "--picture", "merged.pgm"], "merged.pgm would be written twice"),
        (&["-o", "out.mcap", "--summary", "./out.mcap"], "would be written twice"),
        (&["-o", "merged.yaml", "--map", "other.yaml"], "omit --map"),
        (&["-o", "merged.yaml", "--results-only"], "--results-only"),
    ] {
        merge(folder.path(), &[&["a.yaml", "b.yaml"], args].concat()).assert(2, &[word]);
        assert!(files() == before, "{args:?}");
    }
    merge(folder.path(), &["a.yaml", "b.yaml", "-o", "no/such/merged.yaml"]).assert(1, &["no folder no/such"]);
    // A picture of a map may have the format of its image.
    fs::copy(folder.path().join("a.pgm"), folder.path().join("c.png")).unwrap();
    let yaml = fs::read_to_string(folder.path().join("a.yaml")).unwrap();
    fs::write(folder.path().join("c.yaml"), yaml.replace("a.pgm", "c.png")).unwrap();
    let image = fs::read(folder.path().join("c.png")).unwrap();
    gridweave(folder.path(), &["render", "c.yaml", "b.yaml", "-o", "./c.png"]).assert(2, &["c.png is an input"]);
    assert!(fs::read(folder.path().join("c.png")).unwrap() == image);
}

#[test]
fn the_pipeline_runs_by_itself() {
    let folder = two_rooms();
    let run = |args: &[&str]| gridweave(folder.path(), &[&["run", "map_file_merge"], args].concat());
    run(&["--input", "a.yaml", "--input", "b.yaml", "--output", "out.mcap"]).assert(0, &["merged 2 of 2"]);
    run(&["--input", "a.yaml", "--output", "merged.yaml"]).assert(2, &["--map merged.yaml"]);
    run(&["--input", "in.mcap", "--output", "out.mcap"]).assert(2, &["no stage of kind `mcap_source`"]);
}
