//! The YAML file of a map.

use super::reading::Reading;
use super::{MapFileError, Mode};
use crate::yaml;
use gridweave_runtime::message::shortened;
use serde::{Deserialize, Deserializer};
use serde_norway::Value;
use std::path::{Path, PathBuf};

/// The validated contents of the YAML file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Description {
    /// The image, relative to the YAML file.
    pub(super) image: PathBuf,
    /// The resolution, metres per cell.
    pub(super) resolution: f32,
    /// x and y of the lower left corner, metres, and yaw, radians.
    pub(super) origin: [f64; 3],
    pub(super) reading: Reading,
    /// What the file leaves out or writes in other units, and how that was read.
    pub(super) assumed: Vec<String>,
}

/// The longest path that Linux opens, bytes.
const LONGEST_PATH: usize = 4096;
/// The farthest origin along an axis, metres: ten times farther than any coordinates of the earth's grids.
const FARTHEST_ORIGIN: f64 = 1e8;
/// The thresholds of a file without any: those of ROS map servers and savers.
const USUAL_THRESHOLDS: [(&str, f64); 2] = [("occupied_thresh", 0.65), ("free_thresh", 0.196)];
/// A threshold from here on, up to 100, is in percent.
const LEAST_PERCENT: f64 = 5.0;

/// The fields of the file. Other fields, which some programs add, are ignored.
#[derive(Deserialize)]
struct Fields {
    image: PathBuf,
    resolution: Number,
    origin: Vec<Number>,
    occupied_thresh: Option<Number>,
    free_thresh: Option<Number>,
    #[serde(default)]
    negate: Value,
    mode: Option<String>,
}

/// A number, which some programs put in quotes.
struct Number(f64);

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = Value::deserialize(deserializer)?;
        let number = match &value {
            Value::String(text) => text.trim().parse().ok(),
            value => value.as_f64(),
        };
        number.map(Self).ok_or_else(|| serde::de::Error::custom(not_a_number(&value)))
    }
}

/// The error of a value that is no number, with the mend where its decimal sign is a comma.
fn not_a_number(value: &Value) -> String {
    let Value::String(text) = value else { return format!("expected a number, not {value:?}") };
    let text = shortened(text.trim());
    let with_point = text.replacen(',', ".", 1);
    match with_point.parse::<f64>() {
        Ok(_) => format!("expected a number, not `{text}`; the decimal sign is a point: {with_point}"),
        Err(_) => format!("expected a number, not `{text}`"),
    }
}

impl Description {
    /// Parses `text`; `path` is for errors.
    pub(super) fn parse(text: &str, path: &Path) -> Result<Self, MapFileError> {
        // Editors of Windows write a byte order mark.
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let fields: Fields =
            yaml::parse(text).map_err(|message| MapFileError::Yaml { path: path.to_owned(), message })?;
        let wrong = |field, problem: String| MapFileError::Field { path: path.to_owned(), field, problem };

        let Fields { image, resolution: Number(metres), origin, .. } = fields;
        if image.as_os_str().is_empty() {
            return Err(wrong("image", "is empty; it must be the image file".into()));
        }
        if image.as_os_str().len() > LONGEST_PATH || image.to_string_lossy().contains(char::is_control) {
            let problem = format!("is no path of a file: it has control characters, or more than {LONGEST_PATH} bytes");
            return Err(wrong("image", problem));
        }
        let resolution = metres as f32;
        if !(resolution.is_finite() && resolution > 0.0) {
            let problem = format!("is {metres}; it must be the size of a cell in metres, above 0");
            return Err(wrong("resolution", problem));
        }
        let mut assumed = Vec::new();
        let mut origin: Vec<f64> = origin.into_iter().map(|Number(value)| value).collect();
        if origin.len() == 2 {
            assumed.push("its `origin` has no yaw, which is read as 0".to_owned());
            origin.push(0.0);
        }
        // `[1,5, 2,5, 0,0]` is six numbers.
        let sign = if origin.len() > 3 { "; the decimal sign is a point" } else { "" };
        let origin = <[f64; 3]>::try_from(origin)
            .ok()
            .filter(|origin| origin.iter().all(|value| value.is_finite()))
            .ok_or_else(|| {
                let problem = format!("must be three finite numbers: [x, y, yaw], metres and radians{sign}");
                wrong("origin", problem)
            })?;
        if origin[..2].iter().any(|value| value.abs() > FARTHEST_ORIGIN) {
            let problem = format!(
                "is farther than {FARTHEST_ORIGIN:e} m from the origin of the map frame, on no map of the earth"
            );
            return Err(wrong("origin", problem));
        }
        let mut thresholds = [0.0; 2];
        let written = [fields.occupied_thresh, fields.free_thresh];
        for ((threshold, (field, usual)), written) in thresholds.iter_mut().zip(USUAL_THRESHOLDS).zip(written) {
            *threshold = match written {
                None => {
                    assumed.push(format!("it has no `{field}`, which is read as {usual}"));
                    usual
                }
                Some(Number(value)) if (0.0..=1.0).contains(&value) => value,
                Some(Number(percent)) if (LEAST_PERCENT..=100.0).contains(&percent) => {
                    assumed.push(format!("its `{field}`, {percent}, is read as percent: {}", percent / 100.0));
                    percent / 100.0
                }
                Some(Number(value)) => return Err(wrong(field, format!("is {value}; it must be between 0 and 1"))),
            };
        }
        let [occupied_thresh, free_thresh] = thresholds;
        if free_thresh > occupied_thresh {
            let problem = format!("is {free_thresh}; it must not be above `occupied_thresh`, {occupied_thresh}");
            return Err(wrong("free_thresh", problem));
        }
        let negate = match &fields.negate {
            Value::Null => false,
            Value::Bool(negate) => *negate,
            Value::Number(number) if number.as_u64() == Some(0) => false,
            Value::Number(number) if number.as_u64() == Some(1) => true,
            Value::String(text) if ["0", "false"].contains(&text.trim()) => false,
            Value::String(text) if ["1", "true"].contains(&text.trim()) => true,
            _ => return Err(wrong("negate", "must be 0 or 1".into())),
        };
        let mode = match fields.mode.as_deref() {
            None => Mode::default(),
            Some(name) => Mode::from_name(name).ok_or_else(|| wrong("mode", unknown_mode(name)))?,
        };
        let reading =
            Reading { mode, negate, occupied_thresh, free_thresh, unknown: None, transparent_is_unknown: false };
        Ok(Self { image, resolution, origin, reading, assumed })
    }
}

fn unknown_mode(name: &str) -> String {
    let nearest = Mode::NAMES.iter().map(|(known, _)| *known).min_by_key(|known| strsim::levenshtein(known, name));
    format!("is `{name}`, but only trinary, scale and raw exist; did you mean `{}`?", nearest.unwrap_or_default())
}
