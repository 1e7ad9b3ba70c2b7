//! The robots of map files: named by the user, or after files and folders.

use crate::merge_map_files::{merge, save_room, two_rooms};
use crate::support::gridweave;
use gridweave_logs::map_file;
use std::fs;
use tempfile::TempDir;

#[test]
fn equal_names_are_distinguished_by_their_folders() {
    let folder = TempDir::new().unwrap();
    for robot in ["r1", "r2", "b/r2"] {
        fs::create_dir_all(folder.path().join(robot)).unwrap();
        save_room(&folder.path().join(robot).join("map.yaml"));
    }
    merge(folder.path(), &["r1/map.yaml", "r2/map.yaml", "-o", "merged.yaml"]).assert(0, &["merged 2 of 2", "r1 r2"]);
    let ended = merge(folder.path(), &["b/r2/map.yaml", "r2/map.yaml", "-o", "merged.yaml"]);
    ended.assert(1, &["named `r2`", "rename"]);
}

#[test]
fn map_files_with_robots_are_read_as_those_without() {
    let folder = two_rooms();
    // What a map saver writes: unknown cells in grey 205 that the threshold makes free.
    let path = folder.path().join("b.yaml");
    let mut map = map_file::load(&path).unwrap();
    map.cells[..300].fill(-1);
    map_file::save(&path, &map).unwrap();
    let yaml = fs::read_to_string(&path).unwrap();
    let free_thresh = yaml.lines().find(|line| line.starts_with("free_thresh")).unwrap().to_owned();
    fs::write(&path, yaml.replace(&free_thresh, "free_thresh: 0.25")).unwrap();
    let args = ["robot1=a.yaml", "robot2=b.yaml", "-o", "merged.yaml", "--resolution", "robot2=0.05"];
    merge(folder.path(), &args).assert(0, &["robot1 robot2", "300 cells in grey 205 are read as unknown"]);
    gridweave(folder.path(), &["info", "robot2=b.yaml"]).assert(0, &["robot2", "300 cells in grey 205"]);
    // One initial pose is that in the frame of the reference, which is the first robot.
    let initial = ["a.yaml", "b.yaml", "-o", "merged.yaml", "--initial", "b=0,0,0", "--accept", "b=initial"];
    merge(folder.path(), &initial).assert(0, &["merged 2 of 2", "in the frame of a"]);
    // Pipelines of logs read them as logs.
    let run = ["run", "map_merge", "--input", "r1=a.yaml", "--output", "out.mcap"];
    gridweave(folder.path(), &run).assert(0, &["only r1 has a map"]);
}
