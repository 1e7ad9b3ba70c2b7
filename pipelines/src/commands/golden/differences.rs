//! The folder of differences: the messages that a stage has sent, and pictures of grids that differ.

use super::compare::{Comparison, GridDifference};
use super::find::CaseFolder;
use super::recording::Recording;
use anyhow::{Context, Result};
use gridweave_logs::picture::render_difference;
use std::path::{Path, PathBuf};

/// Files that were written for a case.
#[derive(Debug, Default)]
pub(super) struct Written {
    /// The log of the messages that the stage has sent.
    pub(super) got: PathBuf,
    /// For every grid of the comparison its picture, or why it could not be drawn.
    pub(super) pictures: Vec<Result<PathBuf, String>>,
}

/// Writes the messages of a case, and its pictures, to KIND/CASE in `folder`. Pictures of an earlier run are removed.
pub(super) fn write(
    folder: &Path,
    case: &CaseFolder,
    got: &Recording,
    comparison: Option<&Comparison>,
) -> Result<Written> {
    let folder = folder.join(&case.kind).join(&case.case);
    let doing = || format!("cannot write the differences to {}", folder.display());
    std::fs::create_dir_all(&folder).with_context(doing)?;
    for entry in std::fs::read_dir(&folder).with_context(doing)? {
        let path = entry.with_context(doing)?.path();
        if path.extension().is_some_and(|end| end == "png") {
            std::fs::remove_file(&path).with_context(doing)?;
        }
    }
    let log = folder.join("got.mcap");
    got.write(&log).with_context(doing)?;
    let grids = comparison.map(|comparison| comparison.grids.as_slice()).unwrap_or_default();
    let pictures = grids.iter().enumerate().map(|(at, grid)| draw(&folder, at, grid));
    Ok(Written { got: log, pictures: pictures.collect() })
}

fn draw(folder: &Path, at: usize, grid: &GridDifference) -> Result<PathBuf, String> {
    let topic = grid.topic.trim_start_matches('/').replace(['/', '\\'], "_");
    let path = folder.join(format!("{topic}-{}.png", at + 1));
    let image = render_difference(grid.width, &grid.expected, &grid.got).map_err(|error| error.to_string())?;
    image.save(&path).map_err(|error| format!("cannot write {}: {error}", path.display()))?;
    Ok(path)
}
