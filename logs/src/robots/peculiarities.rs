//! What is unusual in the maps of a robot.

use super::cell_values::{CellValues, inversion_of};
use super::tilt::tilt_of;
use super::units::unit_of_map;
use gridweave_runtime::ros::{OccupancyGrid, decode};

/// The number of maps on a topic in which two values are looked for that are exchanged.
const FIRST_MAPS: u64 = 10;

/// A kind of what is unusual in the maps on a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Peculiarity {
    /// They are merged ones of another program.
    Merged,
    /// They may be merged ones of another program.
    Doubtful,
    /// Their origin is not in the plane.
    Tilted,
    /// Their resolution may be in another unit.
    OtherUnit,
    /// The values of walls and of free space may be exchanged.
    Inverted,
}

/// What is unusual in a map, whose values are read by `values` and before which `earlier` came on its topic.
pub(crate) fn peculiarities(
    map: &[u8],
    values: CellValues,
    earlier: u64,
) -> impl Iterator<Item = (Peculiarity, String)> {
    let grid = decode::<OccupancyGrid<'_>>(map).ok();
    let may_be_inverted = values == CellValues::Auto && earlier < FIRST_MAPS;
    let inversion = grid.as_ref().filter(|_| may_be_inverted).and_then(|grid| inversion_of(grid.cells()));
    let unit = grid.and_then(|grid| unit_of_map(&grid.info));
    let found =
        [(Peculiarity::Tilted, tilt_of(map)), (Peculiarity::OtherUnit, unit), (Peculiarity::Inverted, inversion)];
    found.into_iter().filter_map(|(peculiarity, text)| Some((peculiarity, text?)))
}
