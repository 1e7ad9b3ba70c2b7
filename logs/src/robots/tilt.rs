//! Origins of maps that do not lie in the plane.

use gridweave_runtime::ros::{Header, MapMetaData, Quaternion, decode};
use serde::Deserialize;

/// A map is reported as tilted from this angle on, degrees: a smaller one changes no cell by more than thousandths of
/// its place.
const LEAST_TILT: f64 = 1.0;

/// The beginning of a map, up to its cells.
#[derive(Deserialize)]
struct MapStart {
    #[serde(rename = "header")]
    _header: Header,
    info: MapMetaData,
}

/// The error in the rotation of a map's origin, of which only the yaw is used; `None` if it is in the plane, or
/// if the message is no map.
pub(crate) fn tilt_of(map: &[u8]) -> Option<String> {
    let Quaternion { x, y, z, w } = decode::<MapStart>(map).ok()?.info.origin.orientation;
    let squares = [x, y, z, w].map(|value| value * value);
    let norm: f64 = squares.iter().sum();
    // Four zeros are no rotation. What is not finite is an error of the map.
    if [x, y, z, w] == [0.0; 4] || ![x, y, z, w].iter().all(|value| value.is_finite()) {
        return None;
    }
    if !norm.is_normal() {
        let size = if norm < 1.0 { "small" } else { "large" };
        return Some(format!("the rotation of the origin is too {size} to be one: they cannot be used"));
    }
    let upward = (1.0 - 2.0 * (squares[0] + squares[1]) / norm).clamp(-1.0, 1.0);
    let degrees = upward.acos().to_degrees();
    match degrees {
        _ if degrees < LEAST_TILT => None,
        _ if upward < 0.0 => Some(format!(
            "the origin has a roll or pitch of {degrees:.1} degrees, by which the map would be a mirror image: it is read as not \
             mirrored, by its yaw alone"
        )),
        _ => {
            Some(format!("the origin has a roll or pitch of {degrees:.1} degrees: the map is placed by its yaw alone"))
        }
    }
}
