//! Reading a map.

use super::description::Description;
use super::reading::{Remark, Thresholds};
use super::shades::Shades;
use super::{GridMap, MapFileError};
use gridweave_runtime::input_file;
use gridweave_runtime::ros::{MapMetaData, Pose};
use nalgebra::{Isometry2, Vector2};
use std::path::{Path, PathBuf};

/// The most bytes of an image file that are read: as many as the pixels of the largest image that is decoded.
const LARGEST_IMAGE: u64 = 512 << 20;

/// Reads the map that the YAML file at `yaml` describes, by its thresholds.
///
/// # Errors
///
/// A file cannot be read, or is no map.
pub fn load(yaml: &Path) -> Result<GridMap, MapFileError> {
    Ok(load_as(yaml, Thresholds::Literal)?.0)
}

/// Reads the map that the YAML file at `yaml` describes, and says if that is not as the file's thresholds have it.
///
/// # Errors
///
/// A file cannot be read, or is no map.
pub fn load_as(yaml: &Path, thresholds: Thresholds) -> Result<(GridMap, Option<Remark>), MapFileError> {
    let Description { image: path, resolution, origin: [x, y, yaw], reading } = describe(yaml)?;
    let shades = input_file::read(&path, LARGEST_IMAGE)
        .map_err(image::ImageError::from)
        .and_then(|bytes| Shades::decode(&bytes))
        .map_err(|error| MapFileError::Image {
            path: path.clone(),
            yaml: yaml.to_owned(),
            message: error.to_string(),
        })?;
    let (width, height) = shades.size();
    let origin = Pose::from(Isometry2::new(Vector2::new(x, y), yaw));
    let info = MapMetaData { resolution, width, height, origin, ..Default::default() };
    let (reading, remark) = match thresholds {
        Thresholds::Literal => (reading, None),
        Thresholds::ByPicture => reading.by_picture(&shades),
    };
    Ok((GridMap { info, cells: shades.cells(|samples, white| reading.pixel(samples, white)) }, remark))
}

/// The image of the map that the YAML file at `yaml` describes, which may not be there.
pub fn image_of(yaml: &Path) -> Result<PathBuf, MapFileError> {
    Ok(describe(yaml)?.image)
}

/// What the YAML file says, its image as seen from here.
fn describe(yaml: &Path) -> Result<Description, MapFileError> {
    let text = input_file::read_text(yaml).map_err(|source| MapFileError::Read { path: yaml.to_owned(), source })?;
    let description = Description::parse(&text, yaml)?;
    let image = yaml.parent().unwrap_or(Path::new("")).join(&description.image);
    Ok(Description { image, ..description })
}
