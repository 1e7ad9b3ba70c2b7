//! The log files of an input path: the file itself, or the files of a ROS 2 bag.

use super::error::ReadError;
use crate::file::folder_of;
use crate::map_file::image_of;
use crate::yaml;
use gridweave_runtime::input_file;
use serde::Deserialize;
use std::collections::BTreeSet;
use std::path::{Component, Path, PathBuf};

/// The number of entries of a folder that is no bag that are looked at, and of those that are named.
const MOST_ENTRIES: usize = 1000;
const MOST_NAMED: usize = 5;

/// `metadata.yaml` of a ROS 2 bag, limited to the needed fields.
#[derive(Deserialize)]
struct Description {
    rosbag2_bagfile_information: BagInformation,
}

#[derive(Deserialize)]
struct BagInformation {
    relative_file_paths: Vec<PathBuf>,
}

/// The log files of `paths`, in order, each with the index of its path. The path of a ROS 2 bag is its folder or its
/// `metadata.yaml`.
pub fn log_files(paths: &[PathBuf]) -> Result<Vec<(usize, PathBuf)>, ReadError> {
    let mut files = Vec::new();
    for (number, path) in paths.iter().enumerate() {
        let metadata = std::fs::metadata(path).map_err(|error| ReadError::io(path, error))?;
        let of_path = match path.file_name() {
            _ if metadata.is_dir() => bag_files(path)?,
            Some(name) if name == "metadata.yaml" => described_files(path)?,
            _ => vec![path.clone()],
        };
        files.extend(of_path.into_iter().map(|file| (number, file)));
    }
    let mut seen = BTreeSet::new();
    for (_, path) in &files {
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
    match description.is_file() {
        true => described_files(&description),
        false => undescribed_files(folder),
    }
}

/// The log files in a folder without metadata, as a killed recorder leaves it.
fn undescribed_files(folder: &Path) -> Result<Vec<PathBuf>, ReadError> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|error| ReadError::io(folder, error))? {
        let path = entry.map_err(|error| ReadError::io(folder, error))?.path();
        if is_log(&path) && path.is_file() {
            files.push(path);
        }
    }
    files.sort();
    match files.is_empty() {
        true => Err(ReadError::NotABag { path: folder.to_owned(), advice: advice_in(folder) }),
        false => Ok(files),
    }
}

/// The advice for a folder that is no bag: the maps, bags or logs in it.
fn advice_in(folder: &Path) -> String {
    let entries = std::fs::read_dir(folder).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()));
    let mut entries: Vec<PathBuf> = entries.collect();
    entries.sort();
    let is_called =
        |path: &Path, ending: &str| path.extension().is_some_and(|found| found.eq_ignore_ascii_case(ending));
    let is_map = |path: &Path| ["yaml", "yml"].iter().any(|ending| is_called(path, ending)) && image_of(path).is_ok();
    let holds_log = |path: &Path| {
        let mut inside = std::fs::read_dir(path).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()));
        inside.any(|path| is_log(&path) || path.ends_with("metadata.yaml"))
    };
    let is_bag = |path: &Path| is_called(path, "bag") || path.is_dir() && holds_log(path);
    let found = |what: &str, is_meant: &dyn Fn(&Path) -> bool| {
        // A folder may hold thousands of other files.
        let paths: Vec<String> = entries
            .iter()
            .take(MOST_ENTRIES)
            .filter(|path| is_meant(path))
            .take(MOST_NAMED + 1)
            .map(|path| path.display().to_string())
            .collect();
        let more = if paths.len() > MOST_NAMED { " ..." } else { "" };
        let named = paths.iter().take(MOST_NAMED).map(String::as_str).collect::<Vec<_>>().join(" ");
        (!paths.is_empty()).then(|| format!("give the {what} in it: {named}{more}"))
    };
    let advice = found("maps", &is_map).or_else(|| found("bags", &is_bag));
    advice.unwrap_or_else(|| "give the log file itself".to_owned())
}

fn described_files(description: &Path) -> Result<Vec<PathBuf>, ReadError> {
    let wrong = |cause: String| ReadError::BagDescription { path: description.to_owned(), cause };
    let text = input_file::read_text(description, input_file::LONGEST_TEXT)
        .map_err(|error| ReadError::io(description, error))?;
    // A recorder that was killed, or had a full disk, may leave the file empty.
    if text.trim_matches(|one: char| one.is_whitespace() || one == '\0').is_empty() {
        return undescribed_files(folder_of(description));
    }
    let bag: Description = yaml::parse(&text).map_err(wrong)?;
    let bag = bag.rosbag2_bagfile_information;
    if bag.relative_file_paths.is_empty() {
        return Err(wrong("it lists no files".into()));
    }
    let is_inside =
        |path: &Path| path.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    if let Some(outside) = bag.relative_file_paths.iter().find(|path| !is_inside(path)) {
        return Err(wrong(format!("{} is outside of the bag", outside.display())));
    }
    let folder = description.parent().unwrap_or(Path::new(""));
    Ok(bag.relative_file_paths.iter().map(|file| described_file(folder, file)).collect())
}

/// The location of a file listed in a bag's metadata. Up to Foxy the names include the bag's folder; and the file may
/// have been compressed, or decompressed, since.
fn described_file(folder: &Path, file: &Path) -> PathBuf {
    let named = folder.join(file);
    let beside = |file: &Path| {
        let mut compressed = file.as_os_str().to_owned();
        compressed.push(".zstd");
        [file.to_owned(), PathBuf::from(compressed), file.with_extension("")]
    };
    let by_name = folder.join(file.file_name().unwrap_or_default());
    let mut candidates = beside(&named).into_iter().chain(beside(&by_name));
    // A missing file is reported under its expected name.
    candidates.find(|path| is_log(path) && path.is_file()).unwrap_or(named)
}

/// Whether a file has the extension of a bag's log file.
fn is_log(path: &Path) -> bool {
    let is_called = |path: &Path| path.extension().is_some_and(|ending| ending == "mcap" || ending == "db3");
    let is_compressed = path.extension().is_some_and(|ending| ending == "zstd" || ending == "zst");
    is_called(path) || is_compressed && path.file_stem().is_some_and(|name| is_called(Path::new(name)))
}
