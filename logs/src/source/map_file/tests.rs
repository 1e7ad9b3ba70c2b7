use super::kind;
use crate::map_file::{self, GridMap};
use gridweave_runtime::message::{LogTime, Message, MessageFlags};
use gridweave_runtime::ros::{MapMetaData, OccupancyGrid};
use gridweave_runtime::stage::{Context, RobotTopics, StageError, StageHarness};
use nalgebra::{Isometry2, Vector2};
use std::fs;
use std::path::{Path, PathBuf};

fn map(resolution: f32, yaw: f64, cells: &[i8]) -> GridMap {
    let origin = Isometry2::new(Vector2::new(1.0, -2.0), yaw).into();
    let info = MapMetaData { resolution, width: cells.len() as u32, height: 1, origin, ..Default::default() };
    GridMap { info, cells: cells.to_vec() }
}

fn save(folder: &Path, name: &str, map: &GridMap) -> PathBuf {
    let path = folder.join(name);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    map_file::save(&path, map).unwrap();
    path
}

/// All maps that the source sends.
fn run(files: Vec<PathBuf>, robots: RobotTopics) -> Result<Vec<Message>, StageError> {
    let context = Context { stage: "maps".into(), robots, ..Default::default() };
    let files: Vec<&str> = files.iter().map(|file| file.to_str().unwrap()).collect();
    let mut source = StageHarness::with_context(&kind(), &format!("files = {files:?}"), &context)?;
    while source.node().advance()? {}
    assert_eq!(source.node().progress(), Some(1.0));
    assert!(!source.node().advance()?, "it stays finished");
    let sent = source.take_messages("map").into_iter();
    Ok(sent.filter(|message| message.header().flags.contains(MessageFlags::DATA)).collect())
}

#[test]
fn every_file_is_the_map_of_a_robot() {
    let folder = tempfile::tempdir().unwrap();
    let (one, other) = (map(0.05, 0.3, &[0, 100, -1]), map(0.1, -2.0, &[100, 0]));
    let files = vec![save(folder.path(), "b.yaml", &other), save(folder.path(), "a.yaml", &one)];
    let messages = run(files.clone(), RobotTopics::default()).unwrap();
    let robots: Vec<&str> = messages.iter().map(Message::robot).collect();
    assert_eq!(robots, ["a", "b"], "by name, whatever the order of the files");
    for (message, (topic, second, file)) in messages.iter().zip([("/a/map", 1, &files[1]), ("/b/map", 2, &files[0])]) {
        let grid: OccupancyGrid<'_> = message.decode().unwrap();
        assert_eq!(message.header().topic.as_str(), topic);
        assert_eq!(message.header().log_time, LogTime(second * 1_000_000_000));
        assert_eq!(grid.header.frame_id, topic.trim_start_matches('/'));
        assert_eq!(GridMap::from_message(&grid), map_file::load(file).unwrap());
    }
}

#[test]
fn topics_are_those_of_the_pipeline() {
    let folder = tempfile::tempdir().unwrap();
    let files = vec![save(folder.path(), "a.yaml", &map(0.05, 0.0, &[0]))];
    let robots = RobotTopics { map: "/fleet/{robot}/slam".into(), ..Default::default() };
    assert_eq!(run(files, robots).unwrap()[0].header().topic.as_str(), "/fleet/a/slam");
}

#[test]
fn files_that_are_no_maps_are_errors_that_name_them() {
    let folder = tempfile::tempdir().unwrap();
    let good = save(folder.path(), "good.yaml", &map(0.05, 0.0, &[0]));
    let empty = folder.path().join("empty.yaml");
    fs::write(&empty, "").unwrap();
    let without_image = save(folder.path(), "alone.yaml", &map(0.05, 0.0, &[0]));
    fs::remove_file(without_image.with_extension("pgm")).unwrap();
    let long = save(folder.path(), &format!("{}.yaml", "long".repeat(20)), &map(0.05, 0.0, &[0]));
    let missing = folder.path().join("missing.yaml");
    for (bad, word) in [
        (&empty, "empty.yaml"),
        (&without_image, "alone.pgm"),
        (&long, "choose a shorter name"),
        (&missing, "missing.yaml"),
        (&folder.path().to_owned(), "cannot read"),
        (&good, "twice"),
    ] {
        let error = run(vec![good.clone(), bad.clone()], RobotTopics::default()).unwrap_err().to_string();
        assert!(error.contains(word), "{error}");
    }
    assert!(run(Vec::new(), RobotTopics::default()).unwrap_err().to_string().contains("--input"));
}

#[test]
fn unknown_cells_in_grey_205_are_unknown_unless_thresholds_are_literal() {
    let folder = tempfile::tempdir().unwrap();
    let file = save(folder.path(), "a-b.yaml", &map(0.05, 0.0, &[0, 100, -1]));
    let text = fs::read_to_string(&file).unwrap().replace("free_thresh: 0.196", "free_thresh: 0.25");
    fs::write(&file, text).unwrap();
    for (more, cells, warnings) in [("", vec![0, 100, -1], 1), ("literal_thresholds = true", vec![0, 100, 0], 0)] {
        let parameters = format!("files = [{:?}]\n{more}", file.to_str().unwrap());
        let mut source = StageHarness::with_context(&kind(), &parameters, &Context::default()).unwrap();
        while source.node().advance().unwrap() {}
        let sent = source.take_messages("map");
        let message = sent.iter().find(|message| message.header().flags.contains(MessageFlags::DATA)).unwrap();
        assert_eq!(message.robot(), "a-b", "as it was typed");
        assert_eq!(GridMap::from_message(&message.decode().unwrap()).cells, cells);
        assert_eq!(source.warnings().len(), warnings, "{:?}", source.warnings());
    }
}
