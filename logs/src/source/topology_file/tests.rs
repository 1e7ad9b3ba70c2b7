use super::{kind, load};
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::TopologicalMap;
use gridweave_runtime::stage::{StageError, StageHarness};
use std::fs;
use std::path::PathBuf;

/// All topological maps that the source sends for files with these names and contents.
fn run(texts: &[(&str, &str)]) -> Result<Vec<TopologicalMap>, StageError> {
    let folder = tempfile::tempdir().unwrap();
    let files: Vec<PathBuf> = texts.iter().map(|(name, _)| folder.path().join(name)).collect();
    files.iter().zip(texts).for_each(|(file, (_, text))| fs::write(file, text).unwrap());
    let mut source = StageHarness::new(&kind(), &format!("files = {files:?}"))?;
    while source.node().advance()? {}
    assert_eq!(source.node().progress(), Some(1.0));
    source.take("topology")
}

#[test]
fn every_file_is_the_topological_map_of_a_robot() {
    let short = r#"{"nodes": [{"x": 0, "y": 0}, {"x": 3, "y": 4}], "paths": [{"start": 0, "end": 1}]}"#;
    let long = r#"{"nodes": [{"x": 0, "y": 1.5, "kind": "door", "probability": 0.5}],
        "paths": [{"start": 0, "end": 0, "probability": 0.25, "points": [[0, 1.5], [2, 1.5], [0, 1.5]]}]}"#;
    let maps = run(&[("robot2.json", short), ("robot1.json", long)]).unwrap();
    assert_eq!(maps.iter().map(|map| map.robot.as_str()).collect::<Vec<_>>(), ["robot1", "robot2"]);
    let [one, two] = &maps[..] else { panic!("{maps:?}") };
    assert_eq!((one.nodes[0].kind.as_str(), one.nodes[0].probability, one.paths[0].length), ("door", 0.5, 4.0));
    assert_eq!((one.paths[0].probability, one.paths[0].points.len()), (0.25, 3));
    assert_eq!((two.paths[0].length, two.paths[0].points.len(), two.nodes[0].probability), (5.0, 2, 1.0));
    assert_eq!((two.header.frame_id.as_str(), two.header.stamp.sec), ("robot2/map", 2));
    assert_eq!(LogTime::from(two.header.stamp), LogTime(2_000_000_000));
}

#[test]
fn invalid_topological_maps_are_reported_with_their_file() {
    for (text, expected) in [
        ("{", "EOF"),
        (r#"{"nodes": []}"#, "missing field `paths`"),
        (r#"{"nodes": [], "paths": [], "edges": []}"#, "unknown field `edges`"),
        (r#"{"nodes": [{"x": 0, "y": 0}], "paths": [{"start": 0, "end": 1}]}"#, "path 0 of"),
        (r#"{"nodes": [{"x": 1e999, "y": 0}], "paths": []}"#, "number out of range"),
        (r#"{"nodes": [{"x": 1e300, "y": 0}], "paths": []}"#, "the position of node 0"),
        (r#"{"nodes": [{"x": 0, "y": 0, "probability": 7}], "paths": []}"#, "the probability of node 0"),
        (r#"{"nodes": [{"x": 0, "y": 0}], "paths": [{"start": 0, "end": 0, "length": -3}]}"#, "the length of path 0"),
    ] {
        let error = run(&[("a.json", text)]).unwrap_err().to_string();
        assert!(error.contains(expected) && error.contains("a.json") && error.contains("map of a"), "{error}");
    }
    assert!(run(&[]).unwrap_err().to_string().contains("no input file"));
    assert!(load("/nowhere/a.json".as_ref()).unwrap_err().to_string().contains("cannot read /nowhere/a.json"));
}

#[test]
fn a_pipe_is_an_error_at_once() {
    use rustix::fs::{CWD, FileType, Mode, mknodat};
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe.json");
    mknodat(CWD, &pipe, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0).unwrap();
    let error = load(&pipe).unwrap_err().to_string();
    assert!(error.contains("pipe.json: it is no regular file"), "{error}");
}
