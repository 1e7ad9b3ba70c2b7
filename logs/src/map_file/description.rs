//! The YAML file of a map.

use super::{MapFileError, Mode};
use serde::Deserialize;
use serde_norway::Value;
use std::path::{Path, PathBuf};

/// What the YAML file says, checked.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Description {
    /// The image, relative to the YAML file.
    pub(super) image: PathBuf,
    /// Metres a cell.
    pub(super) resolution: f32,
    /// x and y of the lower left corner, metres, and yaw, radians.
    pub(super) origin: [f64; 3],
    pub(super) reading: Reading,
}

/// How a shade is read as occupancy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Reading {
    pub(super) mode: Mode,
    /// Whether white stands for occupied.
    pub(super) negate: bool,
    /// Occupied above this occupancy, 0 to 1.
    pub(super) occupied_thresh: f64,
    /// Free below this occupancy, 0 to 1.
    pub(super) free_thresh: f64,
}

/// The file as it stands. Other fields, which some programs add, are passed over.
#[derive(Deserialize)]
struct Fields {
    image: PathBuf,
    resolution: f64,
    origin: Vec<f64>,
    occupied_thresh: f64,
    free_thresh: f64,
    #[serde(default)]
    negate: Value,
    mode: Option<String>,
}

impl Description {
    /// Reads `text`; `path` is for errors.
    pub(super) fn parse(text: &str, path: &Path) -> Result<Self, MapFileError> {
        let fields: Fields = serde_norway::from_str(text)
            .map_err(|error| MapFileError::Yaml { path: path.to_owned(), message: error.to_string() })?;
        let wrong = |field, problem: String| MapFileError::Field { path: path.to_owned(), field, problem };

        let Fields { image, origin, occupied_thresh, free_thresh, .. } = fields;
        if image.as_os_str().is_empty() {
            return Err(wrong("image", "is empty; name the image beside the file".into()));
        }
        let resolution = fields.resolution as f32;
        if !(resolution.is_finite() && resolution > 0.0) {
            let problem = format!("is {}; it must be the size of a cell in metres, above 0", fields.resolution);
            return Err(wrong("resolution", problem));
        }
        let origin = <[f64; 3]>::try_from(origin)
            .ok()
            .filter(|origin| origin.iter().all(|value| value.is_finite()))
            .ok_or_else(|| wrong("origin", "must be three finite numbers: [x, y, yaw], metres and radians".into()))?;
        for (field, value) in [("occupied_thresh", occupied_thresh), ("free_thresh", free_thresh)] {
            if !(0.0..=1.0).contains(&value) {
                return Err(wrong(field, format!("is {value}; it must lie between 0 and 1")));
            }
        }
        if free_thresh > occupied_thresh {
            let problem = format!("is {free_thresh}; it must not be above `occupied_thresh`, {occupied_thresh}");
            return Err(wrong("free_thresh", problem));
        }
        let negate = match &fields.negate {
            Value::Null => false,
            Value::Bool(negate) => *negate,
            Value::Number(number) if number.as_u64() == Some(0) => false,
            Value::Number(number) if number.as_u64() == Some(1) => true,
            _ => return Err(wrong("negate", "must be 0 or 1".into())),
        };
        let mode = match fields.mode.as_deref() {
            None => Mode::default(),
            Some(name) => Mode::from_name(name).ok_or_else(|| wrong("mode", unknown_mode(name)))?,
        };
        Ok(Self { image, resolution, origin, reading: Reading { mode, negate, occupied_thresh, free_thresh } })
    }
}

fn unknown_mode(name: &str) -> String {
    let nearest = Mode::NAMES.iter().map(|(known, _)| *known).min_by_key(|known| strsim::levenshtein(known, name));
    format!("is `{name}`, but only trinary, scale and raw exist; did you mean `{}`?", nearest.unwrap_or_default())
}
