//! `map_msgs`.

use super::{Header, RosMessage};
use serde::{Deserialize, Serialize};

/// `map_msgs/msg/OccupancyGridUpdate`: the changed cells of a part of the last map, borrowed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OccupancyGridUpdate<'a> {
    /// Time, and the map's frame.
    pub header: Header,
    /// The first column of the part in the map.
    pub x: i32,
    /// The first row of the part in the map.
    pub y: i32,
    /// Columns of the part.
    pub width: u32,
    /// Rows of the part.
    pub height: u32,
    /// The cells as raw bytes, row by row, as in an [`OccupancyGrid`](super::OccupancyGrid).
    #[serde(borrow, with = "serde_bytes")]
    pub data: &'a [u8],
}

impl RosMessage for OccupancyGridUpdate<'_> {
    const NAME: &'static str = "map_msgs/msg/OccupancyGridUpdate";
    type Borrowed<'a> = OccupancyGridUpdate<'a>;
}
