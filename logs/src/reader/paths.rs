//! Which files a path stands for: itself, or the files of a ROS 2 bag.

use super::error::ReadError;
use gridweave_runtime::input_file;
use serde::Deserialize;
use std::collections::BTreeSet;
use std::path::{Component, Path, PathBuf};

/// `metadata.yaml` of a ROS 2 bag, as far as it is needed.
#[derive(Deserialize)]
struct Description {
    rosbag2_bagfile_information: BagInformation,
}

#[derive(Deserialize)]
struct BagInformation {
    relative_file_paths: Vec<PathBuf>,
    #[serde(default)]
    storage_identifier: String,
}

/// The log files that `paths` stand for, in order. A folder stands for the ROS 2 bag in it, as does its
/// `metadata.yaml`.
pub fn log_files(paths: &[PathBuf]) -> Result<Vec<PathBuf>, ReadError> {
    let mut files = Vec::new();
    for path in paths {
        let metadata = std::fs::metadata(path).map_err(|error| ReadError::io(path, error))?;
        match path.file_name() {
            _ if metadata.is_dir() => files.extend(bag_files(path)?),
            Some(name) if name == "metadata.yaml" => files.extend(described_files(path)?),
            _ => files.push(path.clone()),
        }
    }
    let mut seen = BTreeSet::new();
    for path in &files {
        let place = std::fs::canonicalize(path).map_err(|error| ReadError::io(path, error))?;
        if !seen.insert(place) {
            return Err(ReadError::Duplicate { path: path.clone() });
        }
    }
    match files.is_empty() {
        true => Err(ReadError::NothingGiven),
        false => Ok(files),
    }
}

fn bag_files(folder: &Path) -> Result<Vec<PathBuf>, ReadError> {
    let description = folder.join("metadata.yaml");
    if description.is_file() {
        return described_files(&description);
    }
    // A recorder that was killed leaves no description.
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|error| ReadError::io(folder, error))? {
        let path = entry.map_err(|error| ReadError::io(folder, error))?.path();
        if path.extension().is_some_and(|extension| extension == "mcap") && path.is_file() {
            files.push(path);
        }
    }
    files.sort();
    match files.is_empty() {
        true => Err(ReadError::NotABag { path: folder.to_owned() }),
        false => Ok(files),
    }
}

fn described_files(description: &Path) -> Result<Vec<PathBuf>, ReadError> {
    let wrong = |cause: String| ReadError::BagDescription { path: description.to_owned(), cause };
    let text = input_file::read_text(description).map_err(|error| ReadError::io(description, error))?;
    let bag: Description = serde_norway::from_str(&text).map_err(|error| wrong(error.to_string()))?;
    let bag = bag.rosbag2_bagfile_information;
    if bag.storage_identifier.starts_with("sqlite") {
        return Err(wrong(format!(
            "its storage is {}; convert it with `ros2 bag convert -i BAG -o out.yaml`, and `storage_id: mcap` in \
             out.yaml",
            bag.storage_identifier
        )));
    }
    if bag.relative_file_paths.is_empty() {
        return Err(wrong("it lists no files".into()));
    }
    let is_inside =
        |path: &Path| path.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    if let Some(outside) = bag.relative_file_paths.iter().find(|path| !is_inside(path)) {
        return Err(wrong(format!("{} leads out of the bag", outside.display())));
    }
    let folder = description.parent().unwrap_or(Path::new(""));
    Ok(bag.relative_file_paths.iter().map(|file| folder.join(file)).collect())
}
