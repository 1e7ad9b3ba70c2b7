//! Maps that change their shape, their place, their resolution or their direction while they grow, or are sent in
//! parts.

use crate::support::{LogBuilder, SMALL_BUILDING, TestMap, gridweave, json, simulate};
use gridweave_logs::reader::{LogFile, LogReader};
use gridweave_runtime::ros::{OccupancyGrid, OccupancyGridUpdate, RosMessage, decode, encode};
use gridweave_tests::header;
use nalgebra::{Isometry2, Point2, Vector2};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// The last map of each of two simulated robots.
fn last_maps(folder: &Path) -> BTreeMap<String, TestMap> {
    let (log, _) = simulate(folder, "simulated.mcap", &[&SMALL_BUILDING[..], &["--seed", "3"]].concat());
    let mut reader = LogReader::new(vec![LogFile::open(&log).unwrap()]);
    let files = reader.files().clone();
    let mut maps = BTreeMap::new();
    while let Some(message) = reader.next_message() {
        let channel = files[0].channel(message.channel).unwrap();
        if channel.schema_name == OccupancyGrid::NAME {
            let map: OccupancyGrid<'_> = decode(message.data).unwrap();
            let robot = channel.topic.split('/').nth(1).unwrap().to_owned();
            maps.insert(robot, TestMap { info: map.info, cells: map.cells().to_vec() });
        }
    }
    maps
}

/// What `map` shows on other cells: of another size, from a corner at another pose in the map's frame.
fn on_other_cells(map: &TestMap, resolution: f32, [width, height]: [u32; 2], corner: Isometry2<f64>) -> TestMap {
    let mut other = TestMap::filled(width, height, resolution, -1);
    other.info.origin = corner.into();
    let to_map = map.info.origin.planar().inverse() * corner;
    for (index, cell) in other.cells.iter_mut().enumerate() {
        let (row, column) = (index / width as usize, index % width as usize);
        let centre = Point2::new(column as f64 + 0.5, row as f64 + 0.5) * f64::from(resolution);
        let place = (to_map * centre) / f64::from(map.info.resolution);
        let is_inside = place.x >= 0.0 && place.x < f64::from(map.info.width) && place.y >= 0.0;
        let index = place.y as usize * map.info.width as usize + place.x as usize;
        if let Some(value) = map.cells.get(index).filter(|_| is_inside) {
            *cell = *value;
        }
    }
    other
}

/// A map as `map` that has `more` columns and rows of unknown cells on all sides.
fn padded(map: &TestMap, more: u32) -> TestMap {
    let step = -f64::from(more) * f64::from(map.info.resolution);
    let corner = map.info.origin.planar() * Isometry2::translation(step, step);
    on_other_cells(map, map.info.resolution, [map.info.width + 2 * more, map.info.height + 2 * more], corner)
}

/// Merges the maps of a log: where robot2 lies in robot1, and the merged map file's image.
fn merge(folder: &Path, name: &str, fill: impl FnOnce(&mut LogBuilder)) -> (Isometry2<f64>, Vec<u8>) {
    let log = folder.join(name);
    let mut out = LogBuilder::new(&log);
    fill(&mut out);
    out.finish();
    let args = ["run", "map_merge", "--input", name, "--output", "out.mcap", "--summary", "summary.json"];
    gridweave(folder, &[&args[..], &["--map", "map.yaml"]].concat()).assert(0, &["merged 2 of 2"]);
    let summary: Value = json(&folder.join("summary.json"));
    let number = |field: &str| summary["frames"]["robot2"][field].as_f64().unwrap();
    let frame = Isometry2::new(Vector2::new(number("x"), number("y")), number("yaw"));
    (frame, fs::read(folder.join("map.pgm")).unwrap())
}

/// The number of walls' cells in an image.
fn walls(image: &[u8]) -> usize {
    image.iter().filter(|shade| **shade == 0).count()
}

#[test]
fn a_map_that_shrinks_moves_turns_or_changes_its_resolution_is_merged_as_the_last_one_is() {
    let folder = TempDir::new().unwrap();
    let maps = last_maps(folder.path());
    let (one, two) = (&maps["robot1"], &maps["robot2"]);
    let both = |log: &mut LogBuilder, first: &TestMap, last: &TestMap| {
        log.map(1.0, "robot1", one).map(1.0, "robot2", first).map(2.0, "robot2", last);
    };
    let (frame, image) = merge(folder.path(), "plain.mcap", |log| both(log, two, two));
    let resolution = two.info.resolution;
    let reach = [two.info.width, two.info.height].map(|cells| cells * 5 / 4);
    let corner = |x: f64, y: f64, yaw: f64| two.info.origin.planar() * Isometry2::new(Vector2::new(x, y), yaw);
    let last_maps = [
        ("smaller", padded(two, 30), two.clone()),
        ("moved", two.clone(), on_other_cells(two, resolution, reach, corner(-0.65, -0.35, 0.0))),
        ("coarser", two.clone(), on_other_cells(two, 1.5 * resolution, reach, corner(-0.1, -0.1, 0.0))),
        ("turned", two.clone(), on_other_cells(two, resolution, reach, corner(0.6, -1.3, 0.15))),
    ];
    for (name, first, last) in last_maps {
        let (other, of_it) = merge(folder.path(), &format!("{name}.mcap"), |log| both(log, &first, &last));
        let off = frame.inv_mul(&other);
        let place = off.translation.vector.norm();
        assert!(place < 0.1 && off.rotation.angle().abs() < 0.01, "{name}: {off}");
        // What the last map does not show is gone, what it shows is there, once.
        let (before, after) = (walls(&image) as f64, walls(&of_it) as f64);
        assert!((0.75..1.35).contains(&(after / before)), "{name}: {before} and {after} cells of walls");
    }
}

#[test]
fn a_map_that_came_in_parts_is_merged_as_the_whole_is() {
    let folder = TempDir::new().unwrap();
    let maps = last_maps(folder.path());
    let (one, two) = (&maps["robot1"], &maps["robot2"]);
    let mut unknown = two.clone();
    unknown.cells.fill(-1);
    let begin = |log: &mut LogBuilder| {
        log.map(0.5, "robot1", one).map(1.0, "robot2", &unknown);
    };
    let whole = merge(folder.path(), "whole.mcap", |log| {
        begin(log);
        log.map(5.0, "robot2", two);
    });
    let width = two.info.width;
    let parts = merge(folder.path(), "parts.mcap", |log| {
        begin(log);
        for (number, rows) in two.cells.chunks(10 * width as usize).enumerate() {
            let seconds = 1.5 + 0.01 * number as f64;
            let (y, height) = (10 * number as i32, rows.len() as u32 / width);
            let data: Vec<u8> = rows.iter().map(|cell| *cell as u8).collect();
            let header = header(seconds, "robot2/map");
            let update = OccupancyGridUpdate { header, x: 0, y, width, height, data: &data };
            log.raw(seconds, "/robot2/map_updates", OccupancyGridUpdate::NAME, &encode(&update).unwrap());
        }
    });
    assert_eq!(whole, parts);
    gridweave(folder.path(), &["info", "parts.mcap"]).assert(0, &["1 + ", "updates"]);
    // What was made of the parts is in the output, and so are the parts.
    let info = gridweave(folder.path(), &["info", "out.mcap"]);
    info.assert(0, &["/robot2/log/map", "/robot2/map_updates"]);
}
