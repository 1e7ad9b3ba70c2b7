//! The deformation of a map as a function on points.

use crate::errors::RequestError;
use gridweave_runtime::ros::{DeformationNode, MapDeformation};
use gridweave_stages::shared::deformation::Deformation;
use gridweave_stages::shared::geometry::Point2;
use numpy::{IntoPyArray, PyArray2, PyReadonlyArray2, ndarray::Array2};
use pyo3::prelude::*;

/// Deforms points (N x 2, metres, map frame of a robot) by the nodes of a summary, `[x, y, dx, dy, dyaw]` at a spacing.
#[pyfunction]
pub(crate) fn deform<'py>(
    py: Python<'py>,
    spacing: f64,
    nodes: Vec<[f64; 5]>,
    points: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let points = points.as_array();
    if points.ncols() != 2 {
        return Err(RequestError::new_err(format!("points have two columns, x and y, and not {}", points.ncols())));
    }
    let nodes =
        nodes.into_iter().map(|[x, y, dx, dy, dyaw]| DeformationNode { x, y, dx, dy, dyaw, ..Default::default() });
    let message = MapDeformation { spacing, nodes: nodes.collect(), ..Default::default() };
    let deformation = Deformation::from_message(&message)
        .ok_or_else(|| RequestError::new_err("the nodes of the deformation are not on a lattice"))?;
    let mut deformed = Array2::zeros((points.nrows(), 2));
    for (point, mut row) in points.rows().into_iter().zip(deformed.rows_mut()) {
        let moved = deformation.apply(&Point2::new(point[0], point[1]));
        (row[0], row[1]) = (moved.x, moved.y);
    }
    Ok(deformed.into_pyarray(py))
}
