//! Reading a map.

use super::description::Description;
use super::shades::Shades;
use super::{GridMap, MapFileError};
use gridweave_runtime::ros::{MapMetaData, Pose};
use nalgebra::{Isometry2, Vector2};
use std::fs;
use std::path::Path;

/// Reads the map that the YAML file at `yaml` describes.
pub fn load(yaml: &Path) -> Result<GridMap, MapFileError> {
    let text = fs::read_to_string(yaml).map_err(|source| MapFileError::Read { path: yaml.to_owned(), source })?;
    let Description { image, resolution, origin: [x, y, yaw], reading } = Description::parse(&text, yaml)?;

    let path = yaml.parent().unwrap_or(Path::new("")).join(image);
    let shades =
        fs::read(&path).map_err(image::ImageError::from).and_then(|bytes| Shades::decode(&bytes)).map_err(|error| {
            MapFileError::Image { path: path.clone(), yaml: yaml.to_owned(), message: error.to_string() }
        })?;
    let (width, height) = shades.size();
    let origin = Pose::from(Isometry2::new(Vector2::new(x, y), yaw));
    let info = MapMetaData { resolution, width, height, origin, ..Default::default() };
    Ok(GridMap { info, cells: shades.cells(&reading) })
}
