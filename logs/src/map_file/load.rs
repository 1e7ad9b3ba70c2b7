//! Reading a map.

use super::description::Description;
use super::reading::Thresholds;
use super::shades::{MOST_PIXELS, Shades};
use super::{GridMap, MapFileError, MapFileWarning};
use crate::file::folder_of;
use gridweave_runtime::input_file;
use gridweave_runtime::ros::{MapMetaData, Pose};
use nalgebra::{Isometry2, Vector2};
use std::io;
use std::path::{Path, PathBuf};

/// The maximum size of a YAML file, bytes: real ones have some hundreds, and YAML takes a hundred times its size when it is read.
const LONGEST_DESCRIPTION: u64 = 1 << 20;
/// The maximum size of an image file, bytes.
const LARGEST_IMAGE: u64 = 512 << 20;
/// The extensions of images that are looked for beside a YAML file with the same name.
const IMAGE_ENDINGS: [&str; 6] = ["pgm", "png", "bmp", "jpg", "jpeg", "ppm"];

/// Reads the map in the YAML file at `yaml`, with its thresholds applied literally.
///
/// # Errors
///
/// A file cannot be read, or is not a map.
pub fn load(yaml: &Path) -> Result<GridMap, MapFileError> {
    Ok(load_as(yaml, Thresholds::Literal)?.0)
}

/// Reads the map in the YAML file at `yaml`, with a warning if it is not read literally.
///
/// # Errors
///
/// A file cannot be read, or is not a map.
pub fn load_as(yaml: &Path, thresholds: Thresholds) -> Result<(GridMap, Option<MapFileWarning>), MapFileError> {
    load_within(yaml, thresholds, &mut Room::default())
}

/// The number of pixels that the maps of a run may still have together.
#[derive(Debug)]
pub(crate) struct Room(pub(super) u64);

impl Default for Room {
    fn default() -> Self {
        Self(MOST_PIXELS)
    }
}

/// The same, if there is `room` for the map, which it takes.
///
/// # Errors
///
/// A file cannot be read, or is not a map, or there is no room for it.
pub(crate) fn load_within(
    yaml: &Path,
    thresholds: Thresholds,
    room: &mut Room,
) -> Result<(GridMap, Option<MapFileWarning>), MapFileError> {
    let (description, missing) = describe(yaml)?;
    let Description { image: path, resolution, origin: [x, y, yaw], reading, assumed } = description;
    let wrong = |message: String| MapFileError::Image { path: path.clone(), yaml: yaml.to_owned(), message };
    let shades = input_file::read(&path, LARGEST_IMAGE)
        .map_err(image::ImageError::from)
        .and_then(|bytes| match unreadable_type(&bytes) {
            Some(why) => Err(io::Error::new(io::ErrorKind::InvalidData, why).into()),
            None => Shades::decode(&bytes, room.0),
        })
        .map_err(|error| wrong(error.to_string()))?;
    let (width, height) = shades.size();
    room.0 = room.0.saturating_sub(u64::from(width) * u64::from(height));
    let origin = Pose::from(Isometry2::new(Vector2::new(x, y), yaw));
    let info = MapMetaData { resolution, width, height, origin, ..Default::default() };
    let (reading, warning) = match thresholds {
        Thresholds::Literal => (reading, MapFileWarning::default()),
        Thresholds::ByPicture => reading.by_picture(&shades),
    };
    let cells =
        shades.cells(|samples, white| reading.pixel(samples, white)).map_err(|error| wrong(error.to_string()))?;
    let warning = MapFileWarning {
        assumed,
        image: missing.map(|missing| (missing, path.clone())),
        inverted: more_occupied_than_free(&cells),
        ..warning
    };
    Ok((GridMap { info, cells }, warning.if_any()))
}

/// The numbers of occupied and of free cells, if more are occupied and some are free: robots drive where it is free.
fn more_occupied_than_free(cells: &[i8]) -> Option<(u64, u64)> {
    let count = |value: i8| cells.iter().filter(|cell| **cell == value).count() as u64;
    let (occupied, free) = (count(100), count(0));
    (free > 0 && occupied > free).then_some((occupied, free))
}

/// The path of the image in the YAML file at `yaml`. The image need not exist.
pub fn image_of(yaml: &Path) -> Result<PathBuf, MapFileError> {
    Ok(describe(yaml)?.0.image)
}

/// The content of the YAML file, with the image's path relative to the working directory; and the path in the file if
/// that image is missing and another one is used.
fn describe(yaml: &Path) -> Result<(Description, Option<PathBuf>), MapFileError> {
    let text = input_file::read_text(yaml, LONGEST_DESCRIPTION)
        .map_err(|error| MapFileError::Read { path: yaml.to_owned(), error })?;
    let description = Description::parse(&text, yaml)?;
    let named = yaml.parent().unwrap_or(Path::new("")).join(&description.image);
    let (image, missing) = match image_beside_yaml(&named, yaml) {
        Some(image) => (image, Some(named)),
        None => (named, None),
    };
    Ok((Description { image, ..description }, missing))
}

/// The image beside the YAML file, if the one in the file cannot be reached: with the same name, as in a file that was
/// copied from another machine with its image, or with the name of the YAML file.
fn image_beside_yaml(named: &Path, yaml: &Path) -> Option<PathBuf> {
    // It may be missing, or in a folder of another user, or below what is no folder here.
    if std::fs::metadata(named).is_ok() {
        return None;
    }
    let text = named.to_str()?;
    // Windows paths are split, too.
    let name = text.rsplit(['/', '\\']).next().filter(|name| !name.is_empty())?;
    let same_name = yaml.with_file_name(name);
    let as_yaml = IMAGE_ENDINGS.iter().map(|ending| yaml.with_extension(ending));
    let images: Vec<PathBuf> = std::iter::once(same_name).chain(as_yaml).collect();
    images.iter().find(|image| image.is_file()).cloned().or_else(|| in_other_case(&images))
}

/// The first of some images in one folder that is there under a name in other case: Windows and macOS take both for
/// one.
fn in_other_case(images: &[PathBuf]) -> Option<PathBuf> {
    let lower_case = |path: &Path| path.file_name().and_then(|name| name.to_str()).map(str::to_lowercase);
    let entries = std::fs::read_dir(folder_of(images.first()?)).ok()?;
    let mut files: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    files.sort();
    let found = |image: &PathBuf| {
        let name = lower_case(image)?;
        let file = files.iter().find(|file| lower_case(file).as_ref() == Some(&name) && file.is_file())?;
        Some(image.with_file_name(file.file_name()?))
    };
    images.iter().find_map(found)
}

/// The type of a file that is no image of a supported format, by its first bytes, and advice; `None` if it may be one.
fn unreadable_type(bytes: &[u8]) -> Option<String> {
    const SUPPORTED: &str = "PGM, PPM, PBM, PNG, BMP and JPEG are read: convert it to one of these, such as PNG";
    let formats: [(&[u8], &str); 5] = [
        (b"II*\0", "a TIFF image"),
        (b"MM\0*", "a TIFF image"),
        (b"GIF8", "a GIF image"),
        (b"RIFF", "a WebP image"),
        (b"%PDF", "a PDF"),
    ];
    if let Some((_, what)) = formats.iter().find(|(start, _)| bytes.starts_with(start)) {
        return Some(format!("it is {what}; {SUPPORTED}"));
    }
    if bytes.starts_with(b"version https://git-lfs") {
        return Some("it is a pointer of Git LFS, and not the image; `git lfs pull` fetches that".to_owned());
    }
    let start = String::from_utf8_lossy(bytes.trim_ascii_start().get(..14).unwrap_or_default()).to_lowercase();
    let is_page = start.starts_with("<!doctype html") || start.starts_with("<html");
    is_page.then(|| "it is a page of HTML, and not the image; download the image itself".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn a_map_without_room_beside_those_before_it_is_refused_with_what_would_mend_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map.yaml");
        fs::write(folder.path().join("map.pgm"), b"P5 3 2 255 \x00\x64\xcd\xfe\xff\x32").unwrap();
        let yaml =
            "image: map.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25";
        fs::write(&path, yaml).unwrap();
        let mut room = Room(13);
        for _ in 0..2 {
            assert_eq!(load_within(&path, Thresholds::Literal, &mut room).unwrap().0.cells.len(), 6);
        }
        let text = load_within(&path, Thresholds::Literal, &mut room).unwrap_err().to_string();
        assert!(
            text.contains("3 x 2 pixels are more than the 1 that are left") && text.contains("crop them"),
            "{text}"
        );
    }
}
