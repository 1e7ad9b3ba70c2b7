//! Occupancy grids as numpy arrays.

use crate::errors::{GridweaveError, RequestError};
use gridweave_logs::map_file::{self, GridMap, Thresholds};
use gridweave_runtime::ros::{MapMetaData, Pose, Time};
use nalgebra::{Isometry2, Vector2};
use numpy::{IntoPyArray, PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;
use std::path::PathBuf;

/// The cells of a map (rows x columns, row 0 at the origin), its resolution (metres), and the pose of the outer corner
/// of cell (0, 0): x, y (metres), yaw (radians).
pub(crate) type Grid<'py> = (Bound<'py, PyArray2<i8>>, f64, (f64, f64, f64));

/// The map of an array.
pub(crate) fn from_array(
    cells: &PyReadonlyArray2<'_, i8>,
    resolution: f64,
    origin: (f64, f64, f64),
) -> PyResult<GridMap> {
    let cells = cells.as_array();
    let (rows, columns) = cells.dim();
    let side = |cells: usize| u32::try_from(cells).map_err(|_| RequestError::new_err("the map has too many cells"));
    let info = MapMetaData {
        map_load_time: Time::default(),
        resolution: resolution as f32,
        width: side(columns)?,
        height: side(rows)?,
        origin: Pose::from(Isometry2::new(Vector2::new(origin.0, origin.1), origin.2)),
    };
    Ok(GridMap { info, cells: cells.iter().copied().collect() })
}

/// The array of a map, which takes over its cells.
pub(crate) fn into_array(py: Python<'_>, map: GridMap) -> PyResult<Grid<'_>> {
    let info = map.info;
    let origin = info.origin.planar();
    let cells = map.cells.into_pyarray(py).reshape([info.height as usize, info.width as usize])?;
    Ok((cells, f64::from(info.resolution), (origin.translation.x, origin.translation.y, origin.rotation.angle())))
}

/// Reads a map file of nav2's map server. Returns the map, and a warning about it.
#[pyfunction]
pub(crate) fn load_map(py: Python<'_>, file: PathBuf) -> PyResult<(Grid<'_>, Option<String>)> {
    let loaded = py.detach(|| map_file::load_as(&file, Thresholds::ByPicture));
    let (map, warning) = loaded.map_err(|error| RequestError::new_err(error.to_string()))?;
    Ok((into_array(py, map)?, warning.map(|warning| warning.to_string())))
}

/// Writes a map file of nav2's map server, with the image beside it.
#[pyfunction]
pub(crate) fn save_map(
    py: Python<'_>,
    file: PathBuf,
    cells: PyReadonlyArray2<'_, i8>,
    resolution: f64,
    origin: (f64, f64, f64),
) -> PyResult<()> {
    let map = from_array(&cells, resolution, origin)?;
    py.detach(|| map_file::save(&file, &map)).map_err(|error| GridweaveError::new_err(error.to_string()))
}
