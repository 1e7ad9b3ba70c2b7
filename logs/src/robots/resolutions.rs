//! The resolutions of maps that the user sets.

use gridweave_runtime::ros::{OccupancyGrid, decode, encode};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// The side of a cell of each robot's maps, metres, in place of that in the messages.
pub type Resolutions = BTreeMap<String, f64>;

/// A map of a robot with the resolution that the user has set. The position of its origin stays.
pub(crate) fn with_resolution<'a>(resolutions: &Resolutions, robot: &str, map: &'a [u8]) -> Cow<'a, [u8]> {
    let corrected = || {
        let side = resolutions.get(robot)?;
        // Consumers of the map warn if it cannot be read.
        let mut grid: OccupancyGrid<'_> = decode(map).ok()?;
        grid.info.resolution = *side as f32;
        encode(&grid).ok()
    };
    corrected().map_or(Cow::Borrowed(map), Cow::Owned)
}

/// What is wrong with resolutions, in a sentence without its end; `None` if nothing is.
pub(crate) fn problem_of_resolutions(resolutions: &Resolutions) -> Option<String> {
    let (robot, side) = resolutions.iter().find(|(_, side)| !(side.is_finite() && **side > 0.0))?;
    Some(format!("a cell of {robot} must be wider than 0 m, not {side}"))
}
