//! Writing a map.

use super::{GridMap, MapFileError};
use crate::file::replace_or_leave;
use gridweave_runtime::ros::cell::{is_free, is_occupied};
use image::codecs::pnm::{PnmEncoder, PnmSubtype, SampleEncoding};
use image::{ExtendedColorType, ImageEncoder, ImageError};
use std::path::{Path, PathBuf};

/// The shades of occupied, free and unknown cells.
const OCCUPIED_SHADE: u8 = 0;
const FREE_SHADE: u8 = 254;
const UNKNOWN_SHADE: u8 = 205;
/// The thresholds that read those shades back. The shade of unknown has the occupancy 50 / 255 = 0.19608, so the usual
/// 0.25 would turn unknown cells into free ones.
const OCCUPIED_THRESHOLD: f64 = 0.65;
const FREE_THRESHOLD: f64 = 0.196;

/// Writes a map: the YAML file at `yaml`, and the image beside it with the extension `pgm`. Existing files are
/// replaced.
///
/// The mode is trinary: cells of 65 and more are occupied, 0 to 24 free, all others unknown. The origin is written in
/// full precision; height, roll and pitch are dropped.
pub fn save(yaml: &Path, map: &GridMap) -> Result<(), MapFileError> {
    save_or_leave(yaml, map, false)
}

/// Writes a map as [`save`] does, or leaves both files as parts.
pub(super) fn save_or_leave(yaml: &Path, map: &GridMap, leave_parts: bool) -> Result<(), MapFileError> {
    let (text, image, pixels) = describe(yaml, map)
        .map_err(|problem| MapFileError::Map { path: yaml.to_owned(), problem: problem.to_owned() })?;
    let mut file = Vec::with_capacity(pixels.len() + 32);
    let encoder = PnmEncoder::new(&mut file).with_subtype(PnmSubtype::Graymap(SampleEncoding::Binary));
    let encoded = encoder.write_image(&pixels, map.info.width, map.info.height, ExtendedColorType::L8);
    encoded.map_err(|error: ImageError| MapFileError::Map { path: yaml.to_owned(), problem: error.to_string() })?;

    // The image is written first, so that the YAML file never refers to a missing image.
    Ok(replace_or_leave(&[(&image, &file), (yaml, text.as_bytes())], leave_parts)?)
}

/// The image that [`save`] writes beside the YAML file at `yaml`.
pub fn image_beside(yaml: &Path) -> PathBuf {
    yaml.with_extension("pgm")
}

/// The YAML text, the path of the image, and its pixels, or an error text.
fn describe(yaml: &Path, map: &GridMap) -> Result<(String, PathBuf, Vec<u8>), &'static str> {
    let GridMap { info, cells } = map;
    let (width, height) = (info.width as usize, info.height as usize);
    if cells.is_empty() || width.checked_mul(height) != Some(cells.len()) {
        return Err("it must have width x height cells, and at least one");
    }
    let origin = info.origin.planar();
    let (x, y, yaw) = (origin.translation.x, origin.translation.y, origin.rotation.angle());
    if !(info.resolution.is_finite() && info.resolution > 0.0 && [x, y, yaw].iter().all(|value| value.is_finite())) {
        return Err("its resolution must be above 0 and its origin finite");
    }
    let image = image_beside(yaml);
    if image == yaml {
        return Err("give the YAML file; the image has the same name with the extension pgm");
    }
    let name = image.file_name().and_then(|name| name.to_str()).ok_or("the name of the file must be UTF-8 text")?;
    let name = serde_norway::to_string(name).map_err(|_| "the name of the file cannot be written as YAML")?;
    let text = format!(
        "image: {}\nmode: trinary\nresolution: {}\norigin: [{x}, {y}, {yaw}]\nnegate: 0\n\
         occupied_thresh: {OCCUPIED_THRESHOLD}\nfree_thresh: {FREE_THRESHOLD}\n",
        name.trim_end(),
        info.resolution,
    );
    let pixels = cells.chunks_exact(width).rev().flatten().map(|&cell| shade(cell)).collect();
    Ok((text, image, pixels))
}

fn shade(cell: i8) -> u8 {
    match cell {
        _ if is_free(cell) => FREE_SHADE,
        _ if is_occupied(cell) => OCCUPIED_SHADE,
        _ => UNKNOWN_SHADE,
    }
}
