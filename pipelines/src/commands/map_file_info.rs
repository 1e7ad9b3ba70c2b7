//! `gridweave info` for map files: shows their contents as a merge reads them.

use crate::table::Table;
use crate::text_wrapping::wrap;
use anyhow::Result;
use gridweave_logs::map_file::{Thresholds, load_as};
use gridweave_logs::names::name_map_files;
use gridweave_runtime::ros::cell::{is_free, is_known, is_occupied};
use serde::Serialize;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Contents of a map file.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct MapFileInfo {
    /// The robot that a merge assigns it to.
    robot: String,
    /// The YAML file.
    file: PathBuf,
    /// Number of columns.
    width: u32,
    /// Number of rows.
    height: u32,
    /// The side of a cell, metres.
    resolution: f32,
    /// The pose of the lower left corner: metres and radians.
    origin: [f64; 3],
    /// Area of free cells, square metres.
    free_m2: f64,
    /// Area of occupied cells, square metres.
    occupied_m2: f64,
    /// Area of cells that are known, but neither free nor occupied, square metres.
    undecided_m2: f64,
    /// A warning if the file was not read by its thresholds.
    #[serde(rename = "remark", skip_serializing_if = "Option::is_none")]
    warning: Option<String>,
}

/// Reads map files.
///
/// # Errors
/// A file cannot be read or is not a map, or two have the same name.
pub(super) fn inspect(files: &[PathBuf]) -> Result<Vec<MapFileInfo>> {
    name_map_files(files)?.into_iter().map(|(robot, file)| inspect_one(robot, &file)).collect()
}

fn inspect_one(robot: String, file: &Path) -> Result<MapFileInfo> {
    let (map, warning) = load_as(file, Thresholds::ByPicture)?;
    let cell_area = f64::from(map.info.resolution).powi(2);
    let area =
        |is_counted: &dyn Fn(i8) -> bool| cell_area * map.cells.iter().filter(|cell| is_counted(**cell)).count() as f64;
    let origin = map.info.origin.planar();
    Ok(MapFileInfo {
        robot,
        file: file.to_owned(),
        width: map.info.width,
        height: map.info.height,
        resolution: map.info.resolution,
        origin: [origin.translation.x, origin.translation.y, origin.rotation.angle()],
        free_m2: area(&is_free),
        occupied_m2: area(&is_occupied),
        undecided_m2: area(&|cell| is_known(cell) && !is_free(cell) && !is_occupied(cell)),
        warning: warning.map(|warning| warning.to_string()),
    })
}

/// Formats a table of map files in lines of at most `width` columns.
pub(super) fn to_text(maps: &[MapFileInfo], width: Option<usize>) -> String {
    let heads = ["robot", "cells", "cell m", "origin x m", "y m", "yaw deg", "free m2", "occupied m2", "undecided m2"];
    let mut table = Table::new(heads);
    for map in maps {
        let [x, y, yaw] = map.origin;
        table.row([
            map.robot.clone(),
            format!("{} x {}", map.width, map.height),
            format!("{:.3}", map.resolution),
            format!("{x:.2}"),
            format!("{y:.2}"),
            format!("{:.1}", yaw.to_degrees()),
            format!("{:.1}", map.free_m2),
            format!("{:.1}", map.occupied_m2),
            format!("{:.1}", map.undecided_m2),
        ]);
    }
    let mut text = table.fit(width);
    for MapFileInfo { file, warning, .. } in maps {
        if let Some(warning) = warning {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{}", wrap(&format!("{}: {warning}", file.display()), 2, width));
        }
    }
    text
}
