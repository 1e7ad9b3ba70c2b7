//! Map files: the YAML and image of nav2's map server.
//!
//! The YAML file contains the image path (relative to itself), the resolution, the pose of the image's lower left
//! corner, and the interpretation of the image's shades. The first row of the image is the last row of the map.

mod description;
mod error;
mod load;
mod middle_grey;
mod reading;
mod save;
mod shades;
mod sink;
mod warning;

pub use error::MapFileError;
pub(crate) use load::{Room, load_within};
pub use load::{image_of, load, load_as};
pub use reading::Thresholds;
pub use save::{image_beside, save};
pub use sink::kind;
pub use warning::{MapFileWarning, Misread, UnknownGrey};

use gridweave_runtime::ros::{MapMetaData, OccupancyGrid};

/// An occupancy grid that owns its cells.
#[derive(Clone, Debug, PartialEq)]
pub struct GridMap {
    /// Size, resolution and origin.
    pub info: MapMetaData,
    /// The cells row by row, row 0 at the origin: -1 unknown, 0 free to 100 occupied.
    pub cells: Vec<i8>,
}

impl GridMap {
    /// Copies the map in a message.
    pub fn from_message(message: &OccupancyGrid<'_>) -> Self {
        Self { info: message.info, cells: message.cells().to_vec() }
    }
}

/// The interpretation of an image's shades as occupancy (the `mode` of nav2's map server).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Mode {
    /// Occupied above one threshold, free below the other, and unknown in between.
    #[default]
    Trinary,
    /// As trinary, but between the thresholds occupancy rises from 0 to 100; transparent pixels are unknown.
    Scale,
    /// The shade, 0 to 255, is the occupancy; above 100 it is unknown.
    Raw,
}

impl Mode {
    const NAMES: [(&'static str, Self); 3] = [("trinary", Self::Trinary), ("scale", Self::Scale), ("raw", Self::Raw)];

    /// The mode of this name, without regard to case, as nav2 reads it.
    fn from_name(name: &str) -> Option<Self> {
        Self::NAMES.iter().find(|(known, _)| known.eq_ignore_ascii_case(name)).map(|(_, mode)| *mode)
    }
}

#[cfg(test)]
mod tests;
