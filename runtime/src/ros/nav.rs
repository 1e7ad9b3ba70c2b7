//! `nav_msgs`.

use super::{
    EncodeError, Header, Pose, PoseStamped, PoseWithCovariance, RosMessage, Time, Vector3, encode_into, ros_messages,
};
use nalgebra::Isometry2;
use serde::{Deserialize, Serialize};

/// `nav_msgs/msg/MapMetaData`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MapMetaData {
    /// When the map was loaded.
    pub map_load_time: Time,
    /// Metres per cell.
    pub resolution: f32,
    /// Cells along x.
    pub width: u32,
    /// Cells along y.
    pub height: u32,
    /// The pose of the outer corner of cell (0, 0) in the map's frame; its yaw is honoured.
    pub origin: Pose,
}

/// `nav_msgs/msg/OccupancyGrid`, its cells borrowed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OccupancyGrid<'a> {
    /// Time, and the map's frame.
    pub header: Header,
    /// Size, resolution and origin.
    pub info: MapMetaData,
    /// The cells as raw bytes; see [`cells`](Self::cells).
    #[serde(borrow, with = "serde_bytes")]
    pub data: &'a [u8],
}

impl<'a> OccupancyGrid<'a> {
    /// The cells row by row, row 0 at the origin: -1 unknown, 0 free to 100 occupied; see [`cell`](super::cell).
    pub fn cells(&self) -> &'a [i8] {
        bytemuck::cast_slice(self.data)
    }

    /// Checks whether the message can be used as a grid.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn check(&self) -> Result<(), GridError> {
        let MapMetaData { width, height, resolution, origin, .. } = self.info;
        GridError::check(width as usize, height as usize, f64::from(resolution), &origin.planar(), self.data.len())
    }
}

/// Why a message cannot be used as a grid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GridError {
    /// The number of cells is not width x height.
    #[error("it has {actual} cells, but its size is {width} x {height}")]
    CellCount {
        /// Number of cells.
        actual: usize,
        /// Cells along x by the message.
        width: usize,
        /// Cells along y by the message.
        height: usize,
    },
    /// The resolution is not a positive number.
    #[error("its resolution is {0} m per cell, which is not positive")]
    Resolution(f32),
    /// The origin is not a pose.
    #[error("a value of its origin is not finite")]
    Origin,
}

impl GridError {
    /// Checks the size, the resolution in metres per cell, the origin and the number of cells of a grid.
    ///
    /// # Errors
    /// The first of these that cannot be used.
    pub fn check(
        width: usize,
        height: usize,
        resolution: f64,
        origin: &Isometry2<f64>,
        cells: usize,
    ) -> Result<(), Self> {
        if width.checked_mul(height) != Some(cells) {
            return Err(Self::CellCount { actual: cells, width, height });
        }
        if !(resolution.is_finite() && resolution > 0.0) {
            return Err(Self::Resolution(resolution as f32));
        }
        if !(origin.translation.vector.iter().all(|v| v.is_finite()) && origin.rotation.angle().is_finite()) {
            return Err(Self::Origin);
        }
        Ok(())
    }
}

impl RosMessage for OccupancyGrid<'_> {
    const NAME: &'static str = "nav_msgs/msg/OccupancyGrid";
    type Borrowed<'a> = OccupancyGrid<'a>;
}

/// An occupancy grid without its cells: the beginning of the encoded message.
///
/// A stage that makes a grid encodes this prefix, and then writes the cells directly to the memory of the sent message.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct GridPrefix {
    /// Time, and the map's frame.
    pub header: Header,
    /// Size, resolution and origin.
    pub info: MapMetaData,
}

impl GridPrefix {
    /// The number of cells, width times height.
    pub fn cell_count(&self) -> usize {
        self.info.width as usize * self.info.height as usize
    }

    /// The encoded message up to its first cell. [`cell_count`](Self::cell_count) bytes complete the message.
    pub fn encode(&self) -> Result<Vec<u8>, EncodeError> {
        let count = u32::try_from(self.cell_count()).map_err(|_| {
            EncodeError(format!("a grid of {} x {} cells is too large", self.info.width, self.info.height))
        })?;
        let mut bytes = Vec::with_capacity(160);
        encode_into(&(self, count), &mut bytes)?;
        Ok(bytes)
    }
}

/// `nav_msgs/msg/Odometry`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct Odometry {
    pub header: Header,
    pub child_frame_id: String,
    pub pose: PoseWithCovariance,
    pub twist_linear: Vector3,
    pub twist_angular: Vector3,
    pub twist_covariance: [[f64; 6]; 6],
}

/// `nav_msgs/msg/Path`: poses in the order in which they were reached.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct Path {
    pub header: Header,
    pub poses: Vec<PoseStamped>,
}

ros_messages!("nav_msgs": Odometry, Path);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ros::{decode, encode};

    #[test]
    fn a_grid_written_in_place_equals_the_encoded_grid() {
        let info = MapMetaData { resolution: 0.05, width: 3, height: 2, ..Default::default() };
        for frame in ["", "a", "map", "robot1/map"] {
            let header = Header { frame_id: frame.into(), ..Default::default() };
            let cells = [0xff, 0, 100, 1, 2, 3];
            let whole = encode(&OccupancyGrid { header: header.clone(), info, data: &cells }).unwrap();
            let mut in_place = GridPrefix { header, info }.encode().unwrap();
            in_place.extend_from_slice(&cells);
            assert_eq!(in_place, whole);
            let grid: OccupancyGrid<'_> = decode(&whole).unwrap();
            assert_eq!(grid.cells(), [-1, 0, 100, 1, 2, 3]);
            assert!(whole.as_ptr_range().contains(&grid.data.as_ptr()), "the cells are borrowed");
        }
    }

    #[test]
    fn truncated_bytes_are_an_error() {
        let info = MapMetaData { width: 3, height: 2, ..Default::default() };
        let whole = encode(&OccupancyGrid { info, data: &[0; 6], ..Default::default() }).unwrap();
        for end in 0..whole.len() {
            assert!(decode::<OccupancyGrid<'_>>(&whole[..end]).is_err());
        }
    }
}
